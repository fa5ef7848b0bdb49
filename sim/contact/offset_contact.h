// Contact of bodies with each other and themselves on the CPU, in double (method.md, "Bodies in contact"). Surfaces
// keep a distance from each other; impulses stop what comes nearer, and no motion takes a surface through another.
#pragma once

#include <span>

#include "sim/contact/hard_body.h"
#include "sim/contact/surfaces.h"
#include "sim/model/formulas.h"
#include "sim/model/settings.h"

namespace tetpbd {

class OffsetContact {
 public:
  using Points = std::vector<glm::dvec3>;
  struct Counts {
    long detections = 0;               ///< how often pairs were found
    long pairs = 0, touching = 0;      ///< in the last substep: that are near each other, that act
    long truncated = 0;                ///< vertices stopped on their way, summed over substeps
    glm::dvec3 truncated_momentum{0};  ///< kg m/s, which that took, summed
    double gained = 0;                 ///< J of kinetic energy that impulses gave, summed
    double nearest = 1;                ///< the least distance of a pair that acted, over its offset
  };

  explicit OffsetContact(const Model& model) : model_(&model) {}
  void change_model(const Model& model) { model_ = &model; }
  /// Before a step: pairs are found anew, so that it goes the same way wherever a run begins. Those of hard bodies go
  /// on with the impulses that the state keeps.
  void begin_step(const State& state = {});
  /// After it.
  void end_step(State& state) const;
  /// Before a substep moves positions `x` of velocities `v`.
  void begin(const Settings& settings, const Points& x, const Points& v);
  /// After it has moved them, in `h` s: changes them and velocities `v`. What is too near moves apart by so many
  /// offsets at most. `rigid`: by body, whether it moved as a rigid one; empty: none did.
  void resolve(const Settings& settings, Points& x, Points& v, const std::vector<double>& inverse_masses, double h,
               double push_limit = INFINITY, std::span<const char> rigid = {});
  /// By body, what pairs did to it in the last substep, with which rigid bodies begin the next; or empty.
  const std::vector<Wrench>& wrenches() const { return wrenches_; }
  /// s, in which an offset is recovered at the fastest where constraints turn every way into a velocity.
  static constexpr double recovery = 0.05;
  /// Passes over the pairs of rigid bodies in a substep, until no impulse changes by more than a part of the largest.
  static constexpr int most_passes = 64;
  static constexpr double settled = 5e-3;
  const Counts& counts() const { return counts_; }

 private:
  struct Pair {
    bool edges;                   // of two edges, else of a vertex and a triangle
    std::uint32_t first, second;  // numbers of these
    std::array<std::uint32_t, 4> vertices;
    double offset;  // m
    Formulas<double>::Proximity near{};
    bool belongs = false;
    std::array<std::uint8_t, 4> shares{};  // of its vertices' masses, in 255ths; 0: it does not touch
    double push = 0;                       // push_apart()
    WarmImpulse warm{};                    // of its first side, where a side is a rigid body
    std::size_t side_of(std::size_t k) const { return (edges ? k < 2 : k == 0) ? 0 : 1; }
    bool acts() const { return belongs && shares[0] > 0; }
  };
  using Ways = std::array<glm::dvec3, 4>;
  struct Substep {
    Points &x, &v;
    const std::vector<double>& weights;
    double h;
  };

  bool list_holds(const Points& x) const;
  void set_margins(const Points& x, const std::vector<double>& weights);
  struct Extents {  // of bodies, where the substep begins
    std::vector<Bounds> boxes;
    std::vector<double> margins;  // m, the largest of each
    double cell = 1;              // m, of a grid for all
    bool may_meet(std::uint32_t own, const Bounds& box) const;
  };
  Extents find_extents() const;
  Bounds box_around(std::span<const std::uint32_t> vertices, bool kept) const;
  void find_pairs(bool self);
  static void keep(const Pair& pair, std::vector<PairImpulse>& kept);
  void take_up_kept();
  void add_pair(bool self, bool edges, std::uint32_t first, std::uint32_t second, std::vector<Pair>& found) const;
  void evaluate_pairs();
  Formulas<double>::Proximity proximity(const Pair& pair, const Points& x) const;
  void share_masses(Pair& pair, Ways ways) const;
  Ways ways_of(const Pair& pair, const Points& x) const;  // since the substep began
  void apply_impulses(const Settings& settings, double push_limit, Substep& substep);
  /// Of the two bodies of a pair, with `of` one of friction_of() and restitution_of().
  double mean_of_bodies(double (*of)(const Settings&, std::size_t), const Settings& settings, const Pair& pair) const;
  void turn_pushed(Substep& substep);
  static bool all_move(const Pair& pair, const std::vector<double>& weights);
  double kinetic_energy(const Substep& substep) const;  // J, of surfaces
  // A pair of which a side is a rigid body, in a substep.
  struct HardPair {
    Pair* pair;
    std::array<HardBody*, 2> sides{};  // null: soft
    std::array<glm::dvec3, 2> arms{};  // m, from their centres to where they touch
    glm::dvec3 soft_way{0};            // m, of soft sides as they were solved
    double soft_weight = 0;            // 1/kg
    Formulas<double>::Touch touch{};
    glm::dvec3 before{0};  // the impulse of the last pass, without what it went further
    bool active = false;   // in this pass
  };
  void find_hard_bodies(const Substep& substep, std::span<const char> rigid);
  std::array<HardBody*, 2> hard_sides(const Pair& pair);
  std::vector<HardPair> find_hard_pairs();
  void set_out(const Settings& settings, const std::vector<int>& shared, const Substep& substep, HardPair& hard);
  static glm::dvec3 way_of(const HardPair& hard);
  static glm::dmat3 response_of(const HardPair& hard, int HardBody::*sharing);
  bool pass_over(std::vector<HardPair>& hard_pairs, int pass, bool last);
  void solve_hard_pairs(const Settings& settings, double push_limit, const std::vector<int>& shared,
                        const Substep& substep, Points& stopped, Points& pushed);
  void move_hard_bodies(const Substep& substep);
  void truncate(Substep& substep);

  const Model* model_;
  Surfaces surfaces_;  // made with the first contacts
  Points start_;       // where the substep began; empty where bodies do not touch
  Points start_velocities_;
  Points listed_;                // where pairs_ were found; empty: not yet
  std::vector<double> margins_;  // m, by vertex: half of it may be moved until pairs are found anew
  std::vector<Pair> pairs_;
  std::vector<PairImpulse> kept_;  // of pairs that are to be found again
  std::vector<HardBody> hard_;     // by body; empty: none moves as a rigid one
  std::vector<Wrench> wrenches_;
  std::vector<std::uint32_t> body_of_;
  Counts counts_;
};

}  // namespace tetpbd
