#include <fmt/format.h>

#include <algorithm>

#include "app/commands.h"
#include "app/files.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/wrap.h"

namespace tetpbd {

namespace {

void turn(std::vector<glm::dvec3>& positions, const std::string& up) {
  for (glm::dvec3& p : positions) p = upright(p, up);
}

// Writes the surface, and says what was done to it.
std::string mend(const MeshOptions& o) {
  for (const std::filesystem::path& file : {o.file, o.repaired})
    if (!is_surface_file(file)) throw Error("not a surface format", file.string(), "use .ply, .obj, .stl or .off");
  SurfaceMesh surface = load_as_is(o.file);
  const std::string done = repair(surface);
  turn(surface.positions, o.up);
  write_surface(o.repaired, surface);
  return done.empty() ? "nothing to mend" : done;
}

}  // namespace

int run_mesh_command(const MeshOptions& o) {
  if (!o.out.empty()) require_mesh_format(o.out);
  ordered_json document{{"file", o.file.string()}};
  const auto put = [&](const char* title, const ordered_json& table) {
    document[title] = table;
    if (o.json) return;
    fmt::print("{}\n", title);
    for (const auto& [name, value] : table.items()) fmt::print("  {:<28}{:>14}\n", name, text_of(value, 6));
  };
  const auto print_document = [&] {
    if (o.json) fmt::print("{}\n", json_text(document, 2));
  };
  const bool mends = !o.repaired.empty();
  const std::string done = mends ? mend(o) : "";
  const auto say_mended = [&](const std::string& left) {
    document["repaired"] = {{"done", done}, {"left", left}, {"written", o.repaired.string()}};
    if (o.json) return;
    const std::string not_filled = left.empty() || o.out.empty() ? "" : fmt::format(", not {}", o.out.string());
    fmt::print("{}: {}; {}, written {}{}\n", o.file.string(), done, left.empty() ? "sound" : left, o.repaired.string(),
               not_filled);
  };
  // What was mended is read again: its format may have rounded it.
  const std::filesystem::path& file = mends ? o.repaired : o.file;
  TetMesh mesh;
  if (is_surface_file(file)) {
    SurfaceMesh surface = mends ? load_as_is(file) : load_surface(file);
    if (mends && !surface.triangles.empty()) surface = load_surface(file);
    SurfaceMesh oriented = surface;
    const SurfaceCheck check = check_surface(oriented);
    if (!check.defect.empty() && mends) {
      say_mended(fmt::format("{} ({})", check.defect, check.place));
      return print_document(), 1;
    }
    if (!check.defect.empty())
      throw Error(check.defect, check.place + " in " + file.string(),
                  check.hint + (check.hopeless ? "" : "; --repair may mend it, a scene wraps it"));
    try {
      mesh = tetrahedralise(surface, o.switches, 600, file.string());
    } catch (const NotSolid& left) {
      if (!mends) throw;
      say_mended(fmt::format("not sound ({})", left.what()));
      return print_document(), 1;
    }
    if (mends) say_mended("");
    if (mends && o.out.empty()) return print_document(), 0;
    document["tetgen"] = o.switches;
    put("surface", {{"vertices", surface.positions.size()},
                    {"triangles", surface.triangles.size()},
                    {"components", check.components},
                    {"euler_characteristic", check.euler_characteristic},
                    {"volume", check.volume},
                    {"triangles_turned", check.flipped_triangles}});
  } else {
    mesh = load_mesh(file, o.switches);
  }
  if (!mends) turn(mesh.positions, o.up);
  const MeshReport counts = report(mesh);
  put("mesh", mesh_json(counts, 1000 * counts.volume));
  if (const std::string units = question_units(counts.size); !o.json && !units.empty()) fmt::print("{}\n", units);
  if (interrupted()) throw Error("interrupted", file.string(), "start again; nothing was written", 1);
  if (!o.out.empty()) {
    write_mesh(o.out, mesh);
    document["written"] = o.out.string();
    if (!o.json) fmt::print("written {}\n", o.out.string());
  }
  print_document();
  return counts.inverted == 0 ? 0 : 1;
}

}  // namespace tetpbd
