#include <fmt/format.h>

#include <cmath>
#include <optional>

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
  return done.empty() ? "nothing to repair" : done;
}

struct Command {
  const MeshOptions& o;
  const bool mends = !o.repaired.empty();
  /// What was mended is read again: its format may have rounded it.
  const std::filesystem::path& file = mends ? o.repaired : o.file;
  ordered_json document{{"file", o.file.string()}};

  void put(const char* title, const ordered_json& table) {
    document[title] = table;
    if (o.json) return;
    fmt::print("{}\n", title);
    for (const auto& [name, value] : table.items()) {
      std::string text = value.is_array() ? "" : text_of(value, 6);
      for (std::size_t i = 0; value.is_array() && i < value.size(); ++i) text += (i ? ", " : "") + text_of(value[i], 4);
      fmt::print("  {:<28}{:>14}\n", name, text);
    }
  }
  void say(const std::string& line) const {
    if (!o.json && !line.empty()) fmt::print("{}\n", line);
  }
  void say_mended(const std::string& done, const std::string& left) {
    document["repaired"] = {{"done", done}, {"left", left}, {"written", o.repaired.string()}};
    const std::string not_filled = left.empty() || o.out.empty() ? "" : fmt::format(", not {}", o.out.string());
    say(fmt::format("{}: {}; {}, written {}{}", o.file.string(), done, left.empty() ? "sound" : left,
                    o.repaired.string(), not_filled));
  }
  int end(int status) const {
    if (o.json) fmt::print("{}\n", json_text(document, 2));
    return status;
  }

  FillOptions options() const {
    FillOptions options = fill_options(o.filled.fill, o.filled.tetgen, o.filled.tets, o.filled.spacing, file.string());
    options.progress = fill_progress(file.string());
    return options;
  }
  /// Nothing where that ends the command, with status 1 unless the surface is sound.
  std::optional<Filled> fill_surface(const std::string& done, int& status) {
    const SurfaceMesh surface = load_surface(file, mends);
    SurfaceMesh oriented = surface;
    const SurfaceCheck check = check_surface(oriented);
    const std::string defect = check.defect.empty() ? "" : fmt::format("{} ({})", check.defect, check.place);
    FillOptions how = options();
    const bool asked = !how.by.empty() || how.sized;
    if (!check.defect.empty() && mends && !asked) return say_mended(done, defect), status = 1, std::nullopt;
    if (!check.defect.empty() && !asked)
      throw Error(
          check.defect, check.place + " in " + file.string(),
          check.hint + (check.hopeless ? "" : "; try --repair, or --fill lattice, which scenes use for such surfaces"));
    if (!asked) how.by = "tetgen";
    Filled result;
    try {
      result = fill(surface, how, file.string());
    } catch (const NotSolid& left) {
      if (!mends) throw;
      return say_mended(done, fmt::format("not sound ({})", left.what())), status = 1, std::nullopt;
    }
    how.progress = {};  // its line goes before what follows
    if (mends) say_mended(done, defect);
    if (mends && o.out.empty()) return status = check.defect.empty() ? 0 : 1, std::nullopt;
    if (how.by == "tetgen") document["tetgen"] = how.switches;
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
    return result;
  }
  Filled fill_tets() const {
    FillOptions how = options();
    if (how.by.empty() && !how.sized) how.by = "file";
    return refill(load_mesh(file, {}), how, file.string());
  }

  /// Reports on it and writes it.
  int finish(Filled filled) {
    if (!filled.note.empty()) document["fill"] = filled.note;
    say(filled.note);
    TetMesh& mesh = filled.mesh;
    if (!mends) turn(mesh.positions, o.up), filled.fit.thinnest_at = upright(filled.fit.thinnest_at, o.up);
    if (std::isnan(filled.fit.thinnest)) {
      const Depth found = thinnest_part({mesh.positions, mesh.surface});
      filled.fit.thinnest = found.depth, filled.fit.thinnest_at = found.at;
    }
    const MeshReport counts = report(mesh);
    put("mesh", mesh_json(counts, 1000 * counts.filled, longest_step_of_rubber(mesh), filled.fit));
    if (const std::string flat = too_flat(mesh); !flat.empty())
      say(flat + ": scenes fill a soft body with a lattice instead, unless told otherwise by --fill");
    say(question_units(counts.size));
    if (interrupted()) throw Error("interrupted", file.string(), "start again; nothing was written", 1);
    if (!o.out.empty()) {
      write_mesh(o.out, mesh);
      document["written"] = o.out.string();
      say(fmt::format("written {}", o.out.string()));
    }
    return end(counts.inverted == 0 ? 0 : 1);
  }
};

}  // namespace

int run_mesh_command(const MeshOptions& o) {
  if (!o.out.empty()) require_mesh_format(o.out);
  const std::string done = o.repaired.empty() ? "" : mend(o);
  Command command{o};
  if (!is_surface_file(command.file)) return command.finish(command.fill_tets());
  int status = 0;
  std::optional<Filled> filled = command.fill_surface(done, status);
  return filled ? command.finish(std::move(*filled)) : command.end(status);
}

}  // namespace tetpbd
