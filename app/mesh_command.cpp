#include <fmt/format.h>

#include <algorithm>

#include "app/commands.h"
#include "app/files.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/fill.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

void turn(std::vector<glm::dvec3>& positions, const std::string& up) {
  for (glm::dvec3& p : positions) p = upright(p, up);
}

// s, of a rubber of 1 MPa.
double longest_step_of_rubber(const TetMesh& mesh) {
  Settings settings;
  settings.material = "neo-hookean", settings.young_modulus = 1e6, settings.poisson_ratio = 0.45;
  Model model;
  add_body(model, "mesh", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  const ConstraintSystem system = build_constraints(model, settings);
  return longest_stable_step({model, system, settings, model.inverse_masses});
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
    const SurfaceMesh surface = load_surface(file, mends);
    SurfaceMesh oriented = surface;
    const SurfaceCheck check = check_surface(oriented);
    FillOptions options = fill_options(o.filled.fill, o.filled.tetgen, o.filled.tets, o.filled.spacing, file.string());
    const bool asked = !options.by.empty() || options.sized;
    if (!check.defect.empty() && mends && !asked) {
      say_mended(fmt::format("{} ({})", check.defect, check.place));
      return print_document(), 1;
    }
    if (!check.defect.empty() && !asked)
      throw Error(check.defect, check.place + " in " + file.string(),
                  check.hint + (check.hopeless ? "" : "; --repair may mend it, --fill lattice takes it, as scenes do"));
    if (!asked) options.by = "tetgen";
    Filled result;
    try {
      result = fill(surface, options, file.string());
    } catch (const NotSolid& left) {
      if (!mends) throw;
      say_mended(fmt::format("not sound ({})", left.what()));
      return print_document(), 1;
    }
    if (mends) say_mended(check.defect.empty() ? "" : fmt::format("{} ({})", check.defect, check.place));
    if (mends && o.out.empty()) return print_document(), check.defect.empty() ? 0 : 1;
    if (options.by == "tetgen") document["tetgen"] = options.switches;
    ordered_json found = {{"vertices", surface.positions.size()}, {"triangles", surface.triangles.size()}};
    if (check.defect.empty())
      found.update({{"components", check.components},
                    {"euler_characteristic", check.euler_characteristic},
                    {"volume", check.volume},
                    {"cavities", check.cavities.size()},
                    {"triangles_turned", check.flipped_triangles}});
    else
      found["defect"] = fmt::format("{}: {}", check.defect, check.place);
    put("surface", found);
    if (!result.note.empty()) document["fill"] = result.note;
    if (!result.note.empty() && !o.json) fmt::print("{}\n", result.note);
    mesh = std::move(result.mesh);
  } else {
    mesh = load_mesh(file, o.filled.tetgen);
  }
  if (!mends) turn(mesh.positions, o.up);
  const MeshReport counts = report(mesh);
  put("mesh", mesh_json(counts, 1000 * counts.filled, longest_step_of_rubber(mesh)));
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
