#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "app/commands.h"
#include "app/files.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {
namespace {

using Json = nlohmann::ordered_json;

struct Row {
  const char *key, *label, *remark;
  Json value;
};

std::vector<Row> rows_of(const MeshReport& r) {
  return {{"vertices", "vertices", "V", r.vertices},
          {"surface_vertices", "  on the surface", "", r.surface_vertices},
          {"surface_triangles", "surface triangles", "B", r.surface_triangles},
          {"edges", "edges", "E (stretch constraints)", r.edges},
          {"faces", "faces", "F", r.faces},
          {"tets", "tets", "T (volume constraints)", r.tets},
          {"bends", "bends", "surface edges (bend constraints)", r.bends},
          {"euler_characteristic", "Euler characteristic", "V - E + F - T", r.euler_characteristic},
          {"genus", "genus", "", r.genus},
          {"components", "components", "", r.components},
          {"volume", "volume", "m^3", r.volume},
          {"smallest_tet_volume", "smallest tet", "m^3", r.smallest_tet_volume},
          {"mean_tet_volume", "mean tet", "m^3", r.mean_tet_volume},
          {"min_dihedral_deg", "smallest dihedral angle", "degrees", r.min_dihedral_deg},
          {"max_dihedral_deg", "largest dihedral angle", "degrees", r.max_dihedral_deg},
          {"mean_min_dihedral_deg", "mean smallest of a tet", "degrees", r.mean_min_dihedral_deg},
          {"slivers", "slivers", "under 5 or over 175 degrees", r.slivers},
          {"inverted", "inverted", "", r.inverted}};
}

// Into the document, and on the terminal unless the document is all that is wanted.
void put_table(Json& document, const char* title, const std::vector<Row>& rows, bool json) {
  if (!json) fmt::print("{}\n", title);
  for (const auto& [key, label, remark, value] : rows) {
    document[key] = value;
    const std::string text =
        value.is_number_float() ? fmt::format("{:.6g}", value.get<double>()) : value.dump();
    if (!json) fmt::print("  {:<28}{:>14}{}{}\n", label, text, *remark ? "  " : "", remark);
  }
}

}  // namespace

int run_mesh_command(const std::filesystem::path& file, const std::string& switches,
                     const std::filesystem::path& out, bool json) {
  catch_interrupts();
  if (!out.empty()) require_mesh_format(out);
  Json document{{"file", file.string()}};
  TetMesh mesh;
  if (is_surface_file(file)) {
    const SurfaceMesh surface = load_surface(file);
    SurfaceMesh oriented = surface;
    const SurfaceCheck check = check_surface(oriented);
    if (!check.defect.empty()) throw Error(check.defect, check.place + " in " + file.string(), check.hint);
    document["tetgen"] = switches;
    put_table(document["surface"], "surface",
              {{"vertices", "vertices", "", surface.positions.size()},
               {"triangles", "triangles", "", surface.triangles.size()},
               {"components", "components", "", check.components},
               {"euler_characteristic", "Euler characteristic", "V - E + F", check.euler_characteristic},
               {"volume", "volume", "m^3", check.volume},
               {"triangles_turned", "triangles turned", "to face outward", check.flipped_triangles}},
              json);
    mesh = tetrahedralise(surface, switches, 600, file.string());
  } else {
    mesh = load_mesh(file, switches);
  }
  const MeshReport r = report(mesh);
  put_table(document["mesh"], "tetrahedra", rows_of(r), json);
  if (interrupted()) throw Error("interrupted", file.string(), "start again; nothing was written", 1);
  if (!out.empty()) {
    write_mesh(out, mesh);
    document["written"] = out.string();
    if (!json) fmt::print("written {}\n", out.string());
  }
  if (json) fmt::print("{}\n", json_text(document, 2));
  return r.inverted == 0 ? 0 : 1;
}

}  // namespace tetpbd
