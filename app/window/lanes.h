// Simulations side by side: the same bodies, start and clock, each with its own way to solve; and how far
// each is from the reference motion.
#pragma once

#include <string>
#include <vector>

#include "app/scene.h"
#include "render/renderer.h"
#include "sim/measure/metrics.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"

namespace tetpbd {

inline constexpr std::size_t most_lanes = 4;

/// Something over time: all of it, in even steps that grow with its length, and the newest value.
struct History {
  static constexpr std::size_t most = 4096;
  std::vector<float> values;
  std::vector<double> times;  ///< s
  long added = 0, every = 1;
  /// What it has of later times is forgotten: somebody went back.
  void add(double value, double time);
  std::optional<float> at(double time) const;  ///< the last value until then
};

/// What is seen of a lane while the stepping thread has its simulation: how it was when that step began.
struct Shown {
  Frame frame;  ///< of buffers of the lane's own
  long steps = 0;
  double time = 0;  ///< s
  Plan plan;
  AdaptiveValues adaptive;
  std::optional<NonFinite> found;
};

struct Lane {
  Sim sim;  ///< while `shown`, nobody but the stepping thread may use what a step changes of it
  std::optional<Shown> shown{};
  Buffer shown_positions{}, shown_velocities{};
  std::optional<Metrics> metrics{};             ///< made when first shown
  History step_ms{}, volume_error{}, energy{};  ///< J, with the elastic one of a material
  History distance{};                           ///< from what is right, % of the size
  EnergyLedger ledger{};                        ///< since the start, or since somebody last changed something
  History created{};                            ///< of the ledger, in % of its scale
  bool gain_said = false;
  History depth{};   ///< of the vertex deepest in an obstacle or another body, % of the size
  Buffer apart{};    ///< by vertex, the same as last found, as a part of the size; none: not asked for, or not
                     ///< known
  Buffer patches{};  ///< by vertex, the number of its patch (patch_numbers)
  const Buffer& positions() const { return shown ? shown_positions : sim.positions; }
  const Buffer& velocities() const { return shown ? shown_velocities : sim.velocities; }
  long steps() const { return shown ? shown->steps : sim.steps; }
  double time() const { return shown ? shown->time : simulated_time(sim); }
  const Plan& plan() const { return shown ? shown->plan : sim.plan; }
  const AdaptiveValues& adaptive() const { return shown ? shown->adaptive : sim.adaptive; }
  const std::optional<NonFinite>& found() const { return shown ? shown->found : sim.check.found; }
  std::optional<float> far() const { return distance.at(time()); }  ///< now
  /// Steps no more, since its state is not finite, while others go on.
  bool stopped() const { return found().has_value(); }
};

/// Before the thread steps it: keeps what is seen of it. `view`: what the picture shows.
void keep_shown(Lane& lane, const ViewOptions& view);
/// A picture of what is seen of it.
Frame make_frame(const Lane& lane, const Camera& camera, const ViewOptions& view, const Target& target);

/// Lanes of one key have one reference motion. Reads the whole mesh.
std::uint64_t motion_key(const Lane& lane);
/// Whether the solver's work-groups have vertices of their own.
bool has_patches(const Lane& lane);
/// A buffer of floats, made when first asked for: waits for the GPU then. 0 where there are no patches.
GLuint patch_numbers(Lane& lane);
/// "node, 25 iterations": what sets it apart from others.
std::string describe(const Lane& lane, bool material = true);
/// Body colour, sRGB.
glm::vec3 lane_colour(std::size_t lane);
/// Where it is drawn among `count`: side by side, four in two rows.
Viewport tile_of(std::size_t lane, std::size_t count, int width, int height);

/// Ways to solve that are worth seeing side by side, as lists of what each lane puts in place of the scene's
/// settings: names of solvers, or PARAMETER=TEXT, separated by commas.
struct Comparison {
  const char *name, *help;
  std::vector<std::string> lanes;
};
const std::vector<Comparison>& comparisons();
/// The world, the clock and the start are those of all lanes.
bool shared_by_lanes(const Parameter& row);
/// Words "budget_ms=X" take what auto chooses within that time per step, for this model; without one nothing.
/// Throws Error naming `where` for words that are none of these, or that all lanes share.
/// `bodies`: how many the scene has, where there is no model.
Settings lane_settings(Settings settings, const std::string& words, const std::string& where,
                       const std::shared_ptr<const Model>& model = nullptr, std::size_t bodies = 1);

/// That lanes have taken, but for stopped ones.
long steps_of(const std::vector<Lane>& lanes);
/// The lane that others are held against where the reference motion is not known: mode explicit, else the one
/// with most iterations.
std::size_t yardstick(const std::vector<Lane>& lanes);
/// The one that is nearest to what is right now.
std::size_t best_lane(const std::vector<Lane>& lanes);
/// After a step of all lanes: adds each one's distance from the reference motion, where this has that step, or
/// from the yardstick; every fourth step, of large bodies more rarely. Waits for the GPU then.
void hold_lanes(std::vector<Lane>& lanes, const Motion* right);
/// Sends where `right` has the vertices at this step; false where it is not kept.
bool send_answers(const Motion& right, long step, Buffer& answers);
/// The same of each vertex, by the GPU: fills Lane::apart, where `right` has this step.
void hold_vertices(std::vector<Lane>& lanes, const Motion* right, Renderer& renderer, Buffer& answers);

}  // namespace tetpbd
