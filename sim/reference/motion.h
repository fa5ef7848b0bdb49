// The right motion of a scene: what a run is held against. For k = 1 that of rigid bodies (rigid.h), with
// compliance that of leapfrog.h; found twice, the second time in steps half as long, and the distance between
// the two is the error that it states of itself.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sim/reference/reference.h"

namespace tetpbd {

struct Motion {
  std::string method;       ///< "rigid body", "leapfrog" or "implicit"
  std::uint64_t scene = 0;  ///< scene_key() of what it is the motion of
  double dt = 0;            ///< s, a step of the scene
  double step = 0;          ///< s, of the shorter of the two runs
  /// Measures at the start and after every step of the scene.
  struct Row {
    double time = 0;                    ///< s
    glm::dvec3 centre{0}, velocity{0};  ///< m and m/s, of the centre of mass
    double kinetic = 0, potential = 0;  ///< J, as Measurement has them
    double error = 0;                   ///< distance of the two runs (error_to)
  };
  std::vector<Row> rows;
  /// Steps of the scene whose positions are kept, the first and the last among them, and those positions (m,
  /// in the model's order of vertices).
  std::vector<long> kept;
  std::vector<Points> positions;
};

/// Of a state at `time` (s), but for the error.
Motion::Row measured(const Model& model, const Settings& settings, const State& state, double time);
/// Those of the settings; of kinds that are absent, or a material's, infinity.
Compliances reference_compliances(const ReferenceInput& input);
/// Of all that decides the motion: mesh, masses, start, kinds and compliances, world, `dt`. Not of how it is
/// solved.
std::uint64_t scene_key(const ReferenceInput& input);
/// What moves it stands in the settings.
std::uint64_t scene_key(const Model& model, const Settings& settings);

/// The motion over `steps` steps of the scene, by the method named or the one that suits it. `progress` is
/// told each that is done; where `unfinished` names a file, what is done is kept there from time to time, and
/// taken up again. Throws Error for scenes without a right answer (k between 0 and 1, fixed vertices and k =
/// 1, compliance of some kinds only), and Interrupted.
Motion find_motion(const ReferenceInput& input, long steps, const std::string& method = {},
                   const std::filesystem::path& unfinished = {}, const std::function<void(long)>& progress = {});

/// How far a run is from the right motion: RMS distances by mass over the body's size (reference.h,
/// error_to).
struct MotionError {
  double final = 0, rms = 0, peak = 0;  ///< at the last kept instant so far, over all so far, the largest
  double relative = 0;                  ///< final over the RMS displacement from the start
  std::size_t instants = 0;
};
bool is_kept(const Motion& motion, long step);
void add_state(MotionError& error, const Motion& motion, const Model& model, long step, const State& state);

}  // namespace tetpbd
