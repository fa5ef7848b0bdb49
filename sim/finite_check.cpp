#include "sim/finite_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/gl/keep_bindings.h"
#include "sim/snapshot.h"

namespace tetpbd {

Error error_of(const NonFinite& found, const std::string& where) {
  return Error("the state is not finite",
               fmt::format("{}{}at step {}, vertex {}", where, where.empty() ? "" : ", ", found.step, found.vertex),
               "use a smaller dt, more substeps or a lower stiffness", 1);
}

void copy_ranges(FiniteCheck& check, const std::vector<CarriedRange>& ranges, const Buffer& to, std::size_t at,
                 bool good_only) {
  Recorder& recorder = check.recorder;
  recorder.begin();
  recorder.give("Check", check.words);
  // Only the range is bound, because a whole buffer may be larger than a block may be. GL lets every block begin at
  // multiples of 256 bytes.
  const auto give = [&](const char* block, const Buffer& buffer, std::size_t first, std::size_t bytes) {
    const std::size_t before = first % 256;
    recorder.give(block, buffer.id(), first - before, before + bytes);
    return unsigned(before / 4);
  };
  for (const auto& [from, first, bytes] : ranges) {
    const unsigned words = unsigned(bytes / 4);
    const unsigned from_at = give("From", *from, first, bytes), to_at = give("To", to, at, bytes);
    check.copy.work_groups = std::min<std::size_t>(work_groups(words, 256), 1024);
    recorder.run(check.copy,
                 {{"count", words}, {"from_at", from_at}, {"to_at", to_at}, {"good_only", unsigned(good_only)}});
    at += bytes;
  }
  recorder.barrier(GL_BUFFER_UPDATE_BARRIER_BIT);  // restoring reads what was written
}

namespace {

// Values are tested as floats, because the GPU and files get those.
std::optional<NonFinite> non_finite(const State& state, long step) {
  const auto finite = [](const glm::dvec3& v) {
    return std::isfinite(float(v.x)) && std::isfinite(float(v.y)) && std::isfinite(float(v.z));
  };
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    if (!finite(state.positions[i]) || !finite(state.velocities[i])) return NonFinite{step, std::uint32_t(i)};
  return std::nullopt;
}

// The GPU drops the copy if it has seen a vertex that was not finite.
void keep_checkpoint(Sim& sim) {
  FiniteCheck& check = sim.check;
  const std::size_t bytes = snapshot_bytes(sim);
  if (check.checkpoint.bytes() != bytes) check.checkpoint = Buffer("checkpoint", bytes);
  check.kept.push_back(take_snapshot(sim, check.checkpoint, 0, true));
  // The CPU is at most two requests ahead of what it knows.
  constexpr std::size_t most = 2 + 2 * FiniteCheck::request_every / FiniteCheck::checkpoint_every;
  if (check.kept.size() > most) check.kept.pop_front();
}

// Vertices may have been pinned or unpinned since the checkpoint.
void restore_pins(Sim& sim) {
  const auto positions = sim.positions.read_all<Position>();
  VertexList pinned, unpinned;
  for (std::uint32_t i = 0; i < positions.size(); ++i)
    if (is_pinned(sim, i) && sim.model->inverse_masses[i] > 0)
      pinned.push_back(i);
    else if (positions[i].inverse_mass != float(sim.inverse_masses[i]))
      unpinned.push_back(i);
  pin(sim, pinned), unpin(sim, unpinned);
}

void poll_check(FiniteCheck& check, bool wait) {
  const auto values =
      poll_readback<std::uint32_t>(check.requested, check.read_back, "checking for numbers that are not finite", wait);
  if (!values) return;
  if (const std::uint32_t step = (*values)[0]; step != ~0u) check.found = {long(step), (*values)[1]};
  check.known = check.requested_step;
}

// Requests a readback about the steps so far, unless one is under way.
void request_check(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (check.found || check.requested || check.known >= sim.steps) return;
  check.words.copy_to(check.read_back, 0, 0, check.read_back.bytes());
  check.requested = Fence::here();
  check.requested_step = sim.steps;
}

}  // namespace

void start_check(Sim& sim, const State* given) {
  FiniteCheck& check = sim.check;
  check.requested = {};
  check.known = sim.steps;
  check.found = given ? non_finite(*given, sim.steps) : std::nullopt;
  check.kept.clear();
  if (!on_cpu(sim)) check.words.write(0, 8, std::array{~0u, ~0u}.data());
  if (!check.found) keep_checkpoint(sim);
}

void check_step(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (check.found) return;
  if (on_cpu(sim)) {
    check.found = non_finite(sim.host, sim.steps);
  } else if (sim.steps % FiniteCheck::request_every == 0) {
    check_context();
    poll_check(check, true);  // waits, so that the CPU is never more than two requests ahead
    request_check(sim);
  }
  if (!check.found && sim.steps % FiniteCheck::checkpoint_every == 0) keep_checkpoint(sim);
}

const std::optional<NonFinite>& check_finite(Sim& sim, bool wait) {
  FiniteCheck& check = sim.check;
  if (check.found || on_cpu(sim)) return check.found;
  const KeepBindings kept;
  check_context();
  poll_check(check, wait);
  request_check(sim);
  if (wait) poll_check(check, true);
  return check.found;
}

bool restore_checkpoint(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (!check.found) return false;
  const auto after =
      std::ranges::find_if(check.kept, [&](const Snapshot& kept) { return kept.step.steps >= check.found->step; });
  if (after == check.kept.begin()) return false;  // none is older, or none was kept because the start is not finite
  const KeepBindings kept;
  // Copies, because restoring starts the check anew.
  const Snapshot then = *std::prev(after);
  const Buffer from = std::exchange(check.checkpoint, {});
  restore_snapshot(sim, then, from);
  restore_pins(sim);
  return true;
}

}  // namespace tetpbd
