#include "app/lab/truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/error.h"

namespace tetpbd {

namespace {

constexpr const char* finer_switches = "pYq1.2/15o/130";
constexpr std::size_t fewest_tets = 5000;  // a surface of few triangles keeps TetGen from making as many
constexpr double finer_lattice = 45000;    // tets
constexpr double fewest_cells = 300;       // of a block

void refine(BodyDescription& body, const std::string& scene) {
  const auto refuse = [&](const char* what, const char* remedy) {
    throw Error(what, fmt::format("body '{}' of {}", body.name, scene), remedy);
  };
  if (body.sheet || body.thickness > 0) refuse("a sheet has no total error", "judge it by its motion");
  if (!body.heavy.empty()) refuse("masses at random have no total error", "leave out \"heavy\"");
  for (const char* random : {"random", "jitter", "invert-one", "coincident", "fold"})
    if (body.deform.starts_with(random))
      refuse("a start that depends on the mesh has no total error", "take another deformation");
  if (body.block) {
    const glm::dvec3 cells(body.block->cells);
    body.block->cells *= std::max(1, int(std::ceil(std::cbrt(fewest_cells / (cells.x * cells.y * cells.z)))));
    return;
  }
  if (body.tet) return;
  const std::filesystem::path file = body.mesh.empty() ? body.surface : body.mesh;
  body.mesh = file, body.surface.clear(), body.fill = "auto", body.tets.reset(), body.spacing.reset();
  if (!is_surface_file(file)) return;
  SurfaceMesh surface = load_surface(file);
  for (glm::dvec3& p : surface.positions) p = upright(p, body.up);
  const bool clean = fill(surface, {}, file.string()).carried.vertices.empty();
  body.fill = clean ? "tetgen" : "lattice";
  if (!clean) {
    body.tets = finer_lattice;
    return;
  }
  body.tetgen = finer_switches;
  const TetMesh filled = fill(surface, {.by = "tetgen", .switches = body.tetgen}, file.string()).mesh;
  if (filled.tets.size() < fewest_tets)  // so its triangles are divided as well
    body.tetgen = fmt::format("pq1.2/15o/130a{:.3g}", 2 * filled_volume(filled) / double(fewest_tets));
}

}  // namespace

Scene finer_scene(Scene scene, const std::filesystem::path& mesh) {
  if (!mesh.empty()) {
    BodyDescription& body = scene.bodies[0];
    body.mesh = mesh, body.surface.clear(), body.fill = "auto", body.tetgen = FillOptions().switches;
    body.block.reset(), body.tet.reset(), body.sheet.reset(), body.tets.reset(), body.spacing.reset();
  }
  for (BodyDescription& body : scene.bodies)
    if (mesh.empty() || &body != &scene.bodies[0]) refine(body, scene.name);
  return scene;
}

}  // namespace tetpbd
