// The reference motion of a scene, with which runs are compared. For k = 1 it is that of rigid bodies (rigid.h), with
// compliance that of leapfrog.h or implicit.h. It is found twice, the second time in steps half as long; the distance
// between the two is its own error.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sim/reference/reference.h"

namespace tetpbd {

struct Motion {
  std::string method;       ///< "rigid body", "leapfrog", "implicit" or "ten-node"
  std::uint64_t scene = 0;  ///< scene_key() of its scene
  double dt = 0;            ///< s, a step of the scene
  double step = 0;          ///< s, a step of the finer run
  /// Measures at the start and after every step of the scene.
  struct Row {
    double time = 0;                    ///< s
    glm::dvec3 centre{0}, velocity{0};  ///< m and m/s, of the centre of mass
    double kinetic = 0, potential = 0;  ///< J, as Measurement has them
    double error = 0;                   ///< distance of the two runs over the size (error_to)
  };
  std::vector<Row> rows;
  /// Steps of the scene whose positions are stored, the first and the last among them, and those positions (m).
  std::vector<long> kept;
  std::vector<Points> positions;
};

/// The measures of a state at `time` (s), without the error.
Motion::Row measure_motion(const Model& model, const Settings& settings, const State& state, double time);
/// The settings' compliances; infinity for kinds that are absent or a material's.
Compliances reference_compliances(const ReferenceInput& input);
/// A hash of all that decides the motion (mesh, masses, start, kinds, compliances, world, `dt`), not of the solver.
std::uint64_t scene_key(const ReferenceInput& input);
/// The same with the model's own inverse masses.
std::uint64_t scene_key(const Model& model, const Settings& settings);

/// That of the motion that `method` finds: of ten-node tets it is another one.
std::uint64_t motion_key(const Model& model, const Settings& settings, const std::string& method);

/// The motion over `steps` steps of the scene, by the named method or the one that suits it, or of ten-node tets in the
/// place of the scene's (ten_node.h), of which it has the corners; `progress` is called after each step. The file
/// `unfinished`, if named, saves it from time to time, and an interrupted one continues. Throws Error for scenes
/// without a reference (0 < k < 1, bodies free to turn about fixed vertices, some compliances 0), or Interrupted.
Motion find_motion(const ReferenceInput& input, long steps, const std::string& method = {},
                   const std::filesystem::path& unfinished = {}, const std::function<void(long)>& progress = {});

/// The error of a run against the reference motion, in RMS distances over the size (error_to).
struct MotionError {
  double final = 0, rms = 0, peak = 0;  ///< at the last stored instant so far, the RMS of all, the largest
  double relative = 0;                  ///< final over the RMS displacement from the start
  std::size_t instants = 0;
};
/// Whether the positions of that step are stored.
bool is_kept(const Motion& motion, long step);
/// Adds the error of a state; nothing where its step is not stored.
void add_state(MotionError& error, const Motion& motion, const Model& model, long step, const State& state);

}  // namespace tetpbd
