// Contact of bodies with each other and with themselves (method.md, "Bodies in contact"). The broad phase, once in up
// to four steps, finds candidates near each vertex of a surface; the narrow phase, in each substep, finds and resolves
// contacts with them. It runs on the GPU; CPU modes and the reference have offset_contact.h.
#pragma once

#include "sim/contact/pair_layout.h"
#include "sim/gl/pass.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Carried;
struct Settings;
struct SolverInput;
struct Sim;

/// Whether bodies can be in contact with each other or themselves.
bool bodies_touch(const Model& model, const Settings& settings);
/// Whether kernels that move vertices apply the contact corrections of the substep before.
bool contacts_lag(const Model& model, const Settings& settings);

/// The surfaces of all bodies.
struct PairMesh {
  struct Item {
    std::uint32_t vertex, body;
  };
  struct Edge {
    std::uint32_t vertex[2], beside[2], body;  ///< ends; third vertices of the triangles left and right of it
  };
  static constexpr std::uint32_t none = pair_layout::NONE;
  std::vector<std::array<std::uint32_t, 4>> triangles;  ///< vertices, body
  std::vector<pair_layout::SurfaceLeaf> leaves;         ///< filled by order_in_leaves()
  std::vector<Tet> tets;                                ///< near the surface; filled by add_tets()
  std::vector<std::array<std::uint32_t, 4>> beyond;     ///< by tet those across from its vertices, or none
  std::vector<std::uint32_t> behind;                    ///< by triangle its tet, or none; filled by add_tets()
  std::vector<Edge> edges;                              ///< of solids, where they are convex and sharp at rest
  std::vector<Item> vertices;                           ///< each once, by body
  std::vector<float> thicknesses;                       ///< m, by body: the gap that a sheet keeps; 0 for solids
  double edge = 1;                                      ///< m, the mean length
  double thickness = 0;                                 ///< m, the largest
};
PairMesh pair_mesh(const Model& model);
/// Orders triangles, vertices and edges body by body so that those near each other at rest share a leaf.
void order_in_leaves(const TetMesh& rest, PairMesh& mesh);
/// Adds the tets through which one can walk inwards from a triangle.
void add_tets(const TetMesh& rest, PairMesh& mesh);
/// m, without the thickness: how near candidates of slow bodies are.
inline double pair_margin(const PairMesh& mesh) { return 0.5 * mesh.edge; }

/// The carried values of contact, beside parts of buffers.
struct PairNumbers {
  long detections = 0;        ///< broad phases since the start
  std::uint64_t touches = 0;  ///< active contacts, summed over substeps since the start
  std::uint64_t crowded = 0;  ///< full lists of candidates among which some cannot push
  std::uint64_t outrun = 0;   ///< readbacks in which a vertex of a body was too fast for the margin
  double deepest = 0;         ///< m, the largest depth of a vertex in any substep
  double depth = 0;           ///< m, the same between the last two readbacks
  bool near = true;           ///< bodies may touch before the readback after the next
  double start_depth = 0;     ///< m, by which bodies overlap at the start, until the first broad phase
  double fastest = 0;         ///< m/s, of any body at the last readback
  double approach_speed = 0;  ///< m/s, the largest of two bodies near each other at the last readback
  long age = -1;              ///< substeps since the last broad phase; below 0: there was none
  unsigned side = 0;          ///< of the contact counts of vertices, the one for the next substep
  bool counted = false;       ///< and whether that side is known
};

/// Part of a Sim.
struct Pairs : PairNumbers {
  static constexpr long readback_interval = 2;  ///< steps
  static constexpr long most_lifetime = 4;      ///< steps until candidates of slow bodies are sought anew
  Buffer mesh, rest, spheres, lists, sums, empty, readback;
  Fence requested;
  Pass boxes, cull, query, query_edges, meet, push, meet_and_push;  ///< from `query` on with work-groups from `lists`
  bool lag = false;                                                 ///< contacts_lag()
  unsigned phases = 0;                                              ///< of the next dispatch that moves vertices
  std::size_t slices = 0, leaves = 0, items = 0;                    ///< items: vertices of surfaces and sharp edges
  double margin = 0;                                                ///< m, of slow bodies
  double thickness = 0;                                             ///< m, the largest of a body
  PairRanges ranges;
  std::vector<std::string> sizes;  ///< definitions for kernels that read `mesh` and `lists` (surfaces.glsl)
  explicit operator bool() const { return bool(mesh); }
};
Pairs make_pairs(const SolverInput& input);
/// Before a step: reads boxes of bodies and requests the next readback.
void plan_body_contacts(Sim& sim);
/// After a substep's last dispatch, with so many substeps of the step `left`: finds contacts and corrects positions,
/// velocities and quantized positions, unless the next substep's dispatch will apply the corrections.
void resolve_body_contacts(Sim& sim, int left);
void add_carried(Carried& all, Pairs& pairs);
/// From a given state.
void start_pairs(Sim& sim, const State& state);
/// The values after the last step; waits for the GPU.
PairNumbers touched(Sim& sim);

}  // namespace tetpbd
