#include "sim/finite_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/sim.h"

namespace tetpbd {

Error error_of(const NonFinite& found, const std::string& where) {
  return Error(
      "the state is not finite",
      fmt::format("{}{}at step {}, vertex {}", where, where.empty() ? "" : ", ", found.step, found.vertex),
      "use a smaller dt, more substeps or a lower stiffness", 1);
}

void copy_parts(const FiniteCheck& check, const std::vector<CopiedPart>& parts, bool good_only) {
  check.copy.use();
  check.copy.set("good_only", unsigned(good_only));
  check.words.bind_storage(BIND_CHECK);
  for (const auto& [from, first, to, at, bytes] : parts) {
    const std::size_t words = bytes / 4;
    check.copy.set("count", unsigned(words));
    check.copy.set("from_at", unsigned(first / 4));
    check.copy.set("to_at", unsigned(at / 4));
    from->bind_storage(BIND_CHECKPOINT_FROM);
    to->bind_storage(BIND_CHECKPOINT_TO);
    glDispatchCompute(GLuint(std::min<std::size_t>(work_groups(words, 256), 1024)), 1, 1);
  }
  // The next step overwrites what was read; restoring reads what was written.
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

namespace {

// As floats, which is what the GPU and all files get.
std::optional<NonFinite> non_finite(const State& state, long step) {
  const auto finite = [](const glm::dvec3& v) {
    return std::isfinite(float(v.x)) && std::isfinite(float(v.y)) && std::isfinite(float(v.z));
  };
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    if (!finite(state.positions[i]) || !finite(state.velocities[i])) return NonFinite{step, std::uint32_t(i)};
  return std::nullopt;
}

// On the GPU unless it has seen a vertex that was not finite.
void keep_checkpoint(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (on_cpu(sim)) {
    check.host = sim.host;
    return;
  }
  const Buffer &x = sim.positions, &v = sim.velocities;
  copy_parts(check, {{&x, 0, &check.positions, 0, x.bytes()}, {&v, 0, &check.velocities, 0, v.bytes()}},
             true);
}

void take_answer(FiniteCheck& check, bool wait) {
  const auto answer =
      take<std::uint32_t>(check.asked, check.read_back, "checking for numbers that are not finite", wait);
  if (!answer) return;
  const std::uint32_t step = (*answer)[0], vertex = (*answer)[1];
  if (step != ~0u) check.found = {long(step), vertex};
  check.known = check.asked_step;
}

// Asks the GPU about the steps so far, unless a question is under way.
void ask(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (check.found || check.asked || check.known >= sim.steps) return;
  check.words.copy_to(check.read_back, 0, 0, check.read_back.bytes());
  check.asked = Fence::here();
  check.asked_step = sim.steps;
}

}  // namespace

void start_check(Sim& sim, const State* given) {
  FiniteCheck& check = sim.check;
  check.asked = {};
  check.first = check.known = sim.steps;
  check.found = given ? non_finite(*given, sim.steps) : std::nullopt;
  if (!on_cpu(sim)) check.words.write(0, 8, std::array{~0u, ~0u}.data());
  if (!check.found) keep_checkpoint(sim);
}

void check_step(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (check.found) return;
  if (on_cpu(sim)) {
    check.found = non_finite(sim.host, sim.steps);
  } else if (sim.steps % FiniteCheck::ask_every == 0) {
    check_context();
    take_answer(check, true);  // the CPU is never further ahead than two questions
    ask(sim);
  }
  if (!check.found && sim.steps % FiniteCheck::checkpoint_every == 0) keep_checkpoint(sim);
}

const std::optional<NonFinite>& check_finite(Sim& sim, bool wait) {
  FiniteCheck& check = sim.check;
  if (check.found || on_cpu(sim)) return check.found;
  check_context();
  take_answer(check, wait);
  ask(sim);
  if (wait) take_answer(check, true);
  return check.found;
}

bool restore_checkpoint(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (!check.found || check.found->step == check.first) return false;
  constexpr long every = FiniteCheck::checkpoint_every;
  sim.steps = std::max(check.first, (check.found->step - 1) / every * every);
  if (on_cpu(sim)) {
    write_state(sim, State(check.host));
    return true;
  }
  // Not through State: a double holds fewer bits than a pair of floats can. Pins may have changed since.
  auto positions = check.positions.read_all<Position>();
  for (std::size_t i = 0; i < positions.size(); ++i) positions[i].inverse_mass = float(sim.inverse_masses[i]);
  const auto velocities = check.velocities.read_all<Velocity>();
  sim.positions.write(0, sim.positions.bytes(), positions.data());
  sim.velocities.write(0, sim.velocities.bytes(), velocities.data());
  sim.needs_predict = true;
  write_shapes(sim);
  forget_answers(sim);
  if (sim.pairs) start_pairs(sim, read_state(sim));
  start_check(sim, nullptr);
  return true;
}

}  // namespace tetpbd
