// Measurements of a state (method.md eqs. 64-71): errors, momentum and energy, reduced on the GPU and read back late.
#pragma once

#include <array>
#include <deque>
#include <limits>
#include <optional>
#include <vector>

#include "sim/measure/ledger.h"
#include "sim/measure/overlap.h"
#include "sim/sim.h"

namespace tetpbd {

/// The measurement of one state, over all bodies. Errors are relative to the rest shape; 0 is exact where every
/// constraint can be met.
struct Measurement {
  long step = 0;
  double time = 0;                  ///< s
  double volume = 0;                ///< m^3, signed
  double volume_error_percent = 0;  ///< 100 (V - V0) / V0: negative where volume is lost
  double tet_volume_rms = 0;        ///< of (V - V0) / V0 over tets
  double tet_volume_max = 0;        ///< largest |V - V0| / V0
  double inverted_tets = 0;
  double stretch_rms = 0;  ///< of (l - d) / d over edges
  double stretch_max = 0;
  double bend_rms_rad = 0;            ///< of the angle error over hinges
  double rigid_distance = 0;          ///< RMS (by mass) distance to the rigidly aligned rest shape, over the size
  glm::dvec3 momentum{0};             ///< kg m/s
  glm::dvec3 angular_momentum{0};     ///< kg m^2/s about the centre of mass of all
  double speed = 0;                   ///< sum m |v|, kg m/s, to which drift is relative
  glm::dvec3 centre{0};               ///< m, of mass
  double kinetic = 0, potential = 0;  ///< J; potential of gravity above the ground (above 0 without one)
  double elastic = 0;                 ///< J, of materials and of constraints with compliance
  /// J, all three as the mode's steps conserve them: where velocities are of mid-substep, of positions there.
  double total = 0;
  double stored = 0;           ///< J, the elastic part of the total
  double work = 0;             ///< J that obstacles that move have done since the start
  bool by_hand = false;        ///< what the total changed by since the measurement before counts as work of a hand
  double contacts = 0;         ///< pairs of a vertex and an obstacle, or the ground, that it touches
  double penetration_max = 0;  ///< depth of the deepest vertex over the body's size; NaN without obstacles
  double penetration_999 = 0;  ///< depth below which 99.9 % of the vertices stay, likewise
  double non_finite = 0;       ///< vertices with a position or velocity that is not finite
  bool finite() const { return non_finite == 0; }
  double energy() const { return kinetic + potential; }
};

struct Metrics {
  /// A body's part of each list: first and end.
  struct BodyRanges {
    glm::uvec2 vertices, edges, hinges, tets;
    double mass = 0, size = 0;
  };
  struct Pending {
    Fence fence;  ///< empty once the result is read
    std::size_t slot;
    Measurement result;  ///< only step and time until it is read
    double ground, gravity;
    double midway;  ///< s, that positions are ahead of velocities
    bool obstacles;
  };

  std::vector<BodyRanges> bodies;
  double mass = 0, volume = 0, vertices = 0;  ///< of all bodies
  double mass_sizes = 0;                      ///< the sum of mass times size
  std::vector<Buffer> records;                ///< by kind
  std::array<std::size_t, 3> counts{};        ///< constraints, by kind
  std::vector<BodySettings> of_regions;       ///< whose moduli the records of tets have, where bodies have regions
  std::vector<float> shares;                  ///< and the parts of them that the solver holds
  struct Held {
    std::vector<double> attachments, fibres;  ///< compliances, of which the records are
    std::vector<float> shares;
    std::size_t count = 0;
    Buffer records;
    Pass pass;
  } held;  ///< attachments and fibres that have energy
  Buffer rest, partials;
  std::vector<Pass> passes;  ///< in order of dispatch
  Pass yielding;             ///< in place of the first where any body yields
  Recorder recorder;
  std::vector<Buffer> rows;     ///< a ring of results, each with a row per body
  std::deque<Pending> pending;  ///< in order
  std::size_t measured = 0;
};

/// Uses the constraints of `made`, of the same model, if it has all kinds that are measured; without `masses`, the
/// model's.
Metrics create_metrics(const Model& model, const ConstraintSystem& made = {}, const std::vector<double>& masses = {});
inline Metrics create_metrics(const Sim& sim) { return create_metrics(*sim.model, sim.system, sim.masses); }
/// Queues a measurement of the current state. Waits only if the ring of results is full. `by_hand`: since the one
/// before, somebody has led vertices.
void measure(Metrics& metrics, const Sim& sim, bool by_hand = false);
/// The oldest measurement that is ready; with `wait`, the oldest of all.
std::optional<Measurement> collect(Metrics& metrics, bool wait = false);

/// A measurement of NaN, which files show as null.
Measurement nothing_measured();

/// The errors of a run, from its measurements in order.
struct RunErrors {
  double max_volume_loss_percent = 0;  ///< the paper's measure, the largest 100 (V0 - V) / V0
  /// The largest |P - (P0 + M g t)| / sum m|v| and |L - L0| / |L0|, of a body that hardly spins |L - L0| over
  /// size * sum m|v|. NaN with fixed vertices, damping, loads, or contact from the start.
  double linear_drift = std::numeric_limits<double>::quiet_NaN();
  double angular_drift = std::numeric_limits<double>::quiet_NaN();
  double start_energy = 0, max_energy = 0;          ///< J
  double penetration_max = 0, penetration_999 = 0;  ///< the largest of all measurements, the first of wide faces too
  EnergyLedger ledger;
  std::optional<Overlap> overlap;          ///< the largest of each, where bodies touch
  std::optional<long> crossed;             ///< the step at whose end surfaces cut each other, where that ends a run
  bool free = true;                        ///< no contact, damping, load or fixed vertex so far
  std::optional<Measurement> first, last;  ///< the first and last finite state
  bool finite = true;
  std::optional<NonFinite> non_finite;  ///< the result of check_finite(), if the caller asked for it
};
/// Adds a measurement to the errors of its run.
void add_measurement(RunErrors& errors, const Measurement& measurement, const Sim& sim);

}  // namespace tetpbd
