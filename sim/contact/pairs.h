// Contact of bodies with each other and with themselves (method.md, "Bodies in contact"): once in up to four
// steps, or more often where bodies are fast, deep in each other or folded, each vertex of a surface finds
// the triangles near it; in each substep the one that it is in pushes it out. On the GPU here, in double in
// solvers/pair_contact.h. A scene whose bodies are far apart pays for their boxes alone.
#pragma once

#include "sim/contact/pair_layout.h"
#include "sim/gl/pass.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Carried;
struct Settings;
struct SolverInput;
struct Sim;

/// Whether anything can touch.
bool bodies_touch(const Model& model, const Settings& settings);
/// Whether kernels that move vertices take in what contact found after the substep before.
bool contacts_lag(const Model& model, const Settings& settings);

/// Surfaces of all bodies.
struct PairMesh {
  struct Item {
    std::uint32_t vertex, body;
  };
  struct Edge {
    std::uint32_t vertex[2], beside[2], body;  ///< ends; third vertices of the triangles left and right of it
  };
  static constexpr std::uint32_t none = pair_layout::NONE;
  struct Tet {
    std::uint32_t vertices[4],
        beyond[4];  ///< the tet across the face that is opposite of each vertex, or none
  };
  std::vector<std::array<std::uint32_t, 4>> triangles;  ///< vertices, body
  std::vector<pair_layout::SurfaceLeaf> leaves;         ///< none before order_in_leaves()
  std::vector<Tet> tets;                                ///< those near the surface; none before add_tets()
  std::vector<std::uint32_t> behind;                    ///< by triangle its tet, or none
  std::vector<Edge> edges;                              ///< of solids, where they are convex and sharp at rest
  std::vector<Item> vertices;                           ///< each once, by body
  std::vector<float> thicknesses;                       ///< m, by body: how near a sheet lets others come; of solids 0
  double edge = 1;                                      ///< m, the mean
  double thickness = 0;                                 ///< m, the largest
};
PairMesh pair_mesh(const Model& model);
/// Triangles, vertices and edges that are near each other at rest come together, body by body.
void order_in_leaves(const TetMesh& rest, PairMesh& mesh);
/// To walk from a triangle to what is behind it.
void add_tets(const TetMesh& rest, PairMesh& mesh);
/// m: how near a candidate is, of bodies that move slowly, beside the thickness.
inline double pair_margin(const PairMesh& mesh) { return 0.5 * mesh.edge; }

/// What a step hands on to the next, beside parts of buffers.
struct PairNumbers {
  long detections = 0;              ///< since the start
  std::uint64_t touches = 0;        ///< contacts, summed over substeps, since the start
  std::uint64_t crowded = 0;        ///< lists of candidates that were full, with some that push nothing
  std::uint64_t outrun = 0;         ///< looks at boxes that found a vertex too fast for the margin
  double deepest = 0;               ///< m, the largest depth that a vertex came to in a substep
  double depth = 0;                 ///< m, the same between the last two looks at boxes
  bool near = true;                 ///< bodies may touch before the answer after the next
  double overlap = 0;               ///< m, how deep they start in each other
  double fastest = 0, closing = 0;  ///< m/s, any body, and two that are near, by the last answer
  long since = -1;                  ///< substeps since candidates were looked for; below 0: never
  unsigned side = 0;                ///< of the numbers of contacts that share a vertex, that of the next substep
  bool counted = false;             ///< and it is known
};

/// Part of a Sim.
struct Pairs : PairNumbers {
  static constexpr long every = 2;       ///< steps from one look at the boxes to the next
  static constexpr long serve_most = 4;  ///< steps that candidates serve, of slow bodies not deep in others
  Buffer mesh, rest, spheres, lists, sums, empty, readback;
  Fence requested;
  Pass boxes, cull, query, query_edges, meet, push, meet_and_push;  ///< some as often as `lists` counts
  bool lag = false;     ///< within a step, what contact corrects comes in with the next substep's forces
  unsigned phases = 0;  ///< of the next dispatch that moves vertices
  std::size_t slices = 0, leaves = 0, items = 0;  ///< items: vertices of surfaces and sharp edges
  double margin = 0;                              ///< m, of slow bodies
  double thickness = 0;                           ///< m, the largest of a vertex
  PairRanges ranges;
  std::vector<std::string> sizes;  ///< definitions for kernels that read `mesh` and `lists` (surfaces.glsl)
  explicit operator bool() const { return bool(mesh); }
};
Pairs make_pairs(const SolverInput& input);
/// Before a step: takes the last answer and asks again.
void plan_body_contacts(Sim& sim);
/// After a substep's last dispatch, with so many substeps of the step `left`: changes positions, velocities
/// and what neighbours see next, at once if none is or contacts were not counted ahead.
void resolve_body_contacts(Sim& sim, int left);
void add_carried(Carried& all, Pairs& pairs);
/// Of a state that is given.
void start_pairs(Sim& sim, const State& state);
/// As of the last step. Waits.
PairNumbers touched(Sim& sim);

}  // namespace tetpbd
