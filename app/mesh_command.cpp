#include "app/mesh_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/files.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {
namespace {

struct SurfaceReport {
  std::size_t vertices, triangles;
  SurfaceCheck check;
};

template <class T>
void row(const char* name, const T& value, const char* remark = "") {
  fmt::print("  {:<28}{:>14}{}{}\n", name, value, *remark ? "  " : "", remark);
}

std::string short_number(double value) { return fmt::format("{:.6g}", value); }

void print_surface(const SurfaceReport& s) {
  fmt::print("surface\n");
  row("vertices", s.vertices);
  row("triangles", s.triangles);
  row("components", s.check.components);
  row("Euler characteristic", s.check.euler_characteristic, "V - E + F");
  row("volume", short_number(s.check.volume), "m^3");
  if (s.check.flipped_triangles > 0) row("triangles turned", s.check.flipped_triangles, "to face outward");
  row("checks", "passed", "finite, closed, 2-manifold, orientable, not flat, no duplicates");
}

void print_tets(const MeshReport& r) {
  fmt::print("tetrahedra\n");
  row("vertices", r.vertices, "V");
  row("  on the surface", r.surface_vertices);
  row("surface triangles", r.surface_triangles, "B");
  row("edges", r.edges, "E (stretch constraints)");
  row("faces", r.faces, "F");
  row("tets", r.tets, "T (volume constraints)");
  row("bends", r.bends, "surface edges (bend constraints)");
  row("Euler characteristic", r.euler_characteristic, "V - E + F - T");
  row("genus", r.genus);
  row("components", r.components);
  row("volume", short_number(r.volume), "m^3");
  row("smallest tet", short_number(r.smallest_tet_volume), "m^3");
  row("mean tet", short_number(r.mean_tet_volume), "m^3");
  row("smallest / mean", short_number(r.smallest_tet_volume / r.mean_tet_volume));
  row("smallest dihedral angle", fmt::format("{:.2f}", r.min_dihedral_deg), "degrees");
  row("largest dihedral angle", fmt::format("{:.2f}", r.max_dihedral_deg), "degrees");
  row("mean smallest of a tet", fmt::format("{:.2f}", r.mean_min_dihedral_deg), "degrees");
  row("slivers", r.slivers, "under 5 or over 175 degrees");
  row("inverted", r.inverted);
}

nlohmann::ordered_json as_json(const SurfaceReport& s) {
  return {{"vertices", s.vertices},           {"triangles", s.triangles},
          {"components", s.check.components}, {"euler_characteristic", s.check.euler_characteristic},
          {"volume", s.check.volume},         {"triangles_turned", s.check.flipped_triangles}};
}

nlohmann::ordered_json as_json(const MeshReport& r) {
  return {{"vertices", r.vertices},
          {"surface_vertices", r.surface_vertices},
          {"surface_triangles", r.surface_triangles},
          {"edges", r.edges},
          {"faces", r.faces},
          {"tets", r.tets},
          {"bends", r.bends},
          {"euler_characteristic", r.euler_characteristic},
          {"genus", r.genus},
          {"components", r.components},
          {"volume", r.volume},
          {"smallest_tet_volume", r.smallest_tet_volume},
          {"mean_tet_volume", r.mean_tet_volume},
          {"min_dihedral_deg", r.min_dihedral_deg},
          {"max_dihedral_deg", r.max_dihedral_deg},
          {"mean_min_dihedral_deg", r.mean_min_dihedral_deg},
          {"slivers", r.slivers},
          {"inverted", r.inverted}};
}

}  // namespace

int run_mesh_command(const std::filesystem::path& file, const std::string& switches,
                     const std::filesystem::path& out, bool json) {
  catch_interrupts();
  if (!out.empty()) require_mesh_format(out);
  std::optional<SurfaceReport> surface_report;
  TetMesh mesh;
  if (is_surface_file(file)) {
    SurfaceMesh surface = load_surface(file);
    SurfaceMesh oriented = surface;
    const SurfaceCheck check = check_surface(oriented);
    if (!check.defect.empty()) throw Error(check.defect, check.place + " in " + file.string(), check.mend);
    surface_report = SurfaceReport{surface.positions.size(), surface.triangles.size(), check};
    if (!json) print_surface(*surface_report);
    mesh = tetrahedralise(surface, switches, 600, file.string());
  } else {
    mesh = load_mesh(file, switches);
  }
  const MeshReport r = report(mesh);
  if (!json) print_tets(r);
  if (interrupted()) throw Error("interrupted", file.string(), "start again; nothing was written", 1);
  if (!out.empty()) {
    write_mesh(out, mesh);
    if (!json) fmt::print("written {}\n", out.string());
  }
  if (json) {
    nlohmann::ordered_json document{{"file", file.string()}};
    if (surface_report) {
      document["tetgen"] = switches;
      document["surface"] = as_json(*surface_report);
    }
    document["mesh"] = as_json(r);
    if (!out.empty()) document["written"] = out.string();
    fmt::print("{}\n", json_text(document, 2));
  }
  return r.inverted == 0 ? 0 : 1;
}

}  // namespace tetpbd
