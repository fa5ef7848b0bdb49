#include <fmt/format.h>

#include <algorithm>

#include "app/commands.h"
#include "app/files.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/wrap.h"

namespace tetpbd {

int run_mesh_command(const std::filesystem::path& file, const std::string& switches, const std::filesystem::path& out,
                     bool json) {
  if (!out.empty()) require_mesh_format(out);
  ordered_json document{{"file", file.string()}};
  const auto put = [&](const char* title, const ordered_json& table) {
    document[title] = table;
    if (json) return;
    fmt::print("{}\n", title);
    for (const auto& [name, value] : table.items()) fmt::print("  {:<28}{:>14}\n", name, text_of(value, 6));
  };
  TetMesh mesh;
  if (is_surface_file(file)) {
    const SurfaceMesh surface = load_surface(file);
    SurfaceMesh oriented = surface;
    const SurfaceCheck check = check_surface(oriented);
    if (!check.defect.empty())
      throw Error(check.defect, check.place + " in " + file.string(),
                  check.hint + (check.hopeless ? "" : "; --repair may mend it, a scene wraps it"));
    document["tetgen"] = switches;
    put("surface", {{"vertices", surface.positions.size()},
                    {"triangles", surface.triangles.size()},
                    {"components", check.components},
                    {"euler_characteristic", check.euler_characteristic},
                    {"volume", check.volume},
                    {"triangles_turned", check.flipped_triangles}});
    mesh = tetrahedralise(surface, switches, 600, file.string());
  } else {
    mesh = load_mesh(file, switches);
  }
  const MeshReport counts = report(mesh);
  put("mesh", mesh_json(counts, 1000 * counts.volume));
  if (const std::string units = question_units(counts.size); !json && !units.empty()) fmt::print("{}\n", units);
  if (interrupted()) throw Error("interrupted", file.string(), "start again; nothing was written", 1);
  if (!out.empty()) {
    write_mesh(out, mesh);
    document["written"] = out.string();
    if (!json) fmt::print("written {}\n", out.string());
  }
  if (json) fmt::print("{}\n", json_text(document, 2));
  return counts.inverted == 0 ? 0 : 1;
}

int run_repair(const std::filesystem::path& file, const std::filesystem::path& out) {
  if (!is_surface_file(out)) throw Error("not a surface format", out.string(), "use .ply, .obj, .stl or .off");
  SurfaceMesh surface = load_as_is(file);
  const std::string done = repair(surface);
  write_surface(out, surface);
  SurfaceMesh oriented = surface;
  const SurfaceCheck left = check_surface(oriented);
  fmt::print("{}: {}; {}, written {}\n", file.string(), done.empty() ? "nothing to mend" : done,
             left.defect.empty() ? "sound" : fmt::format("{} ({})", left.defect, left.place), out.string());
  return left.defect.empty() ? 0 : 1;
}

}  // namespace tetpbd
