// Contact of bodies with each other and with themselves on the GPU (method.md, "Bodies in contact"). A detection lists
// pairs of surfaces that may touch before the next; in each substep they act and keep each other from crossing. CPU
// modes and the reference have offset_contact.h.
#pragma once

#include "sim/contact/pair_layout.h"
#include "sim/gl/pass.h"

namespace tetpbd {

struct Carried;
struct Settings;
struct SolverInput;
struct Sim;

/// Whether bodies can be in contact with each other or themselves.
bool bodies_touch(const Model& model, const Settings& settings);

/// The carried values of contact, beside parts of buffers.
struct PairNumbers {
  long detections = 0;             ///< since the start
  std::uint64_t touches = 0;       ///< pairs that acted, summed over substeps since the start
  std::uint64_t truncated = 0;     ///< vertices stopped on their way, likewise
  double taken = 0;                ///< m/s, the momentum that this took over the mass of all bodies, likewise
  double nearest = 1;              ///< the least distance of a pair that acted, over its offset
  std::uint64_t listed_pairs = 0;  ///< the most of a detection
  std::uint64_t left_out = 0;      ///< pairs for which there was no room, so that their vertices were held
  bool boxed = false;              ///< boxes of leaves are known
  bool kept_any = false;           ///< impulses of hard bodies, for the next list of pairs
  bool near = true;                ///< bodies may touch before the readback after the next
  double fastest = 0, usual = 0;   ///< m/s, of any vertex of a surface, and of most leaves, at the last readback
};

/// Part of a Sim.
struct Pairs : PairNumbers {
  static constexpr long readback_interval = 2;  ///< steps
  Buffer mesh, lists, balls, leaf_pairs, candidates, pairs, sums, listed, empty, readback;
  Buffer hard_pairs, kept;  ///< only where bodies move as rigid ones
  Texture listed_texels;
  Fence requested;
  Pass boxes, near_leaves, cull;
  Pass find, list, impulses, truncate;  ///< with work-groups from `lists`
  Pass keep, hard, carry;               ///< only where bodies move as rigid ones
  unsigned phases = 0;                  ///< of dispatches that end a substep
  unsigned side = 0;                    ///< of vertices' shares: the next substep's
  double edge = 1;                      ///< m, the mean of surfaces
  std::vector<std::uint32_t> leaf_bodies;
  PairRanges ranges;
  std::vector<std::string> defines;  ///< for kernels that read `mesh`, `lists` and `pairs` (surfaces.glsl)
  explicit operator bool() const { return bool(mesh); }
};
Pairs make_pairs(const SolverInput& input);
/// Before a step: reads boxes of leaves and requests the next readback.
void plan_body_contacts(Sim& sim);
/// Before a substep of a step: lists pairs anew, if it is time.
void list_pairs(Sim& sim, int substep);
/// After the solver's last dispatch of a substep, which may be the `last` of its step: changes positions, velocities
/// and quantized positions.
void resolve_body_contacts(Sim& sim, bool last);
void add_carried(Carried& all, Pairs& pairs);
/// Before the next step bodies were moved from outside: impulses that pairs had are not those of the next.
void forget_impulses(Pairs& pairs);
/// From a given state.
void start_pairs(Sim& sim, const State& state);
/// The values after the last step; waits for the GPU.
PairNumbers touched(Sim& sim);

}  // namespace tetpbd
