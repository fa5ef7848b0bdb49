#include "sim/mesh/fill.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/mesh/cache.h"

namespace tetpbd {
namespace {

constexpr double poor = 0.02;  // least altitude over the mean edge, a fifth of what TetGen makes of clean surfaces

Filled by_lattice(SurfaceMesh surface, const FillOptions& options, const std::string& why, const std::string& source) {
  for (glm::dvec3& p : surface.positions) p *= options.scale;
  const std::string how = fmt::format("lattice 2 {} {} {}", options.size.tets, options.size.spacing, why);
  const std::uint64_t key = mesh_key(surface, how, "");
  const std::string file = fmt::format("{:016x}.lattice", key);
  Filled filled{.scale = options.scale};
  std::vector<char> note;
  std::vector<int> counts;
  std::vector<Fit> fits;
  if (take_sealed(read_cached(file), key, filled.mesh.positions, filled.mesh.tets, filled.mesh.fill,
                  filled.carried.vertices, filled.carried.triangles, note, counts, fits) &&
      filled.mesh.fill.size() == filled.mesh.tets.size() && counts.size() == 1 && fits.size() == 1) {
    filled.note.assign(note.begin(), note.end()), filled.cavities = counts[0], filled.fit = fits[0];
    finish_tets(filled.mesh, file);
    return filled;
  }
  Lattice lattice = fill_with_lattice(surface, options.size, source, options.progress);
  filled.mesh = std::move(lattice.mesh), filled.carried = std::move(lattice.carried);
  filled.cavities = lattice.cavities, filled.fit = lattice.fit;
  filled.note = fmt::format("{}a lattice of {} tets fills it, its points {:.3g} m apart{}{}{}",
                            why.empty() ? "" : why + ", so ", filled.mesh.tets.size(), lattice.spacing,
                            lattice.parts > 1 ? fmt::format(", in {} parts", lattice.parts) : "",
                            lattice.note.empty() ? "" : "; ", lattice.note);
  keep_cached(file, key, filled.mesh.positions, filled.mesh.tets, filled.mesh.fill, filled.carried.vertices,
              filled.carried.triangles, std::vector<char>(filled.note.begin(), filled.note.end()),
              std::vector{filled.cavities}, std::vector{filled.fit});
  return filled;
}

Filled as_it_is(TetMesh mesh) {
  Filled filled{.mesh = std::move(mesh)};
  filled.fit.gap = 0, filled.fit.edge = mean_edge(filled.mesh);
  return filled;
}

}  // namespace

std::string too_flat(const TetMesh& mesh) {
  const FlattestTet flattest = flattest_tet(mesh);
  if (flattest.quality >= poor) return {};
  return fmt::format("tet {} near {} is as flat as {:.2g} of an edge", flattest.tet,
                     point_text(mesh.positions[mesh.tets[flattest.tet][0]]), flattest.quality);
}

Filled refill(TetMesh mesh, const FillOptions& options, const std::string& source) {
  const bool asked = !options.by.empty() || options.sized;
  const std::string why = asked ? "" : too_flat(mesh);
  Filled filled;
  if (options.by == "file" || (!asked && why.empty())) {
    filled = as_it_is(std::move(mesh));
  } else {
    SurfaceMesh boundary{std::move(mesh.positions), std::move(mesh.surface)};
    drop_unused_vertices(boundary.positions, boundary.triangles);
    filled = asked ? fill(boundary, options, source) : by_lattice(std::move(boundary), options, why, source);
    if (!asked) filled.note += "; --fill file keeps its tets";
  }
  if (mesh.other_cells > 0)
    filled.note = fmt::format("hexahedra, prisms and the like are left out: {}{}{}", mesh.other_cells,
                              filled.note.empty() ? "" : "; ", filled.note);
  return filled;
}

Filled fill(const SurfaceMesh& surface, const FillOptions& options, const std::string& source) {
  if (options.by == "file") throw Error("a surface has no tets to keep", source, "fill it by tetgen or a lattice");
  if (options.by == "lattice" || (options.by.empty() && options.sized)) return by_lattice(surface, options, "", source);
  std::string why;
  try {
    const double seconds = options.by.empty() ? 60 : 600;
    Filled filled = as_it_is(tetrahedralise(surface, options.switches, seconds, source));
    // Who gives switches wants those tets.
    const bool judged = options.by.empty() && options.switches == FillOptions().switches;
    const double quality = judged ? flattest_tet(filled.mesh).quality : 1;
    if (quality >= poor) return filled;
    why = fmt::format("its tets by TetGen are as flat as {:.2g} of an edge", quality);
  } catch (const NotSolid& refusal) {
    if (!options.by.empty()) throw;
    why = refusal.what();
    why = why.substr(0, why.find(" in " + source));
  }
  return by_lattice(surface, options, why, source);
}

}  // namespace tetpbd
