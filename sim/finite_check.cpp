#include "sim/finite_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/sim.h"

namespace tetpbd {

namespace {

constexpr std::uint32_t none = 0xffffffffu;
constexpr long ask_every =
    CHECK_STEPS / 2;  // steps; unasked, an answer is waited for only when it is this old
constexpr long keep_every = CHECK_STEPS;

// As floats: that is what the GPU and all files get.
bool is_finite(const glm::dvec3& v) {
  return std::isfinite(float(v.x)) && std::isfinite(float(v.y)) && std::isfinite(float(v.z));
}

std::optional<std::uint32_t> first_bad(const State& state) {
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    if (!is_finite(state.positions[i]) || !is_finite(state.velocities[i])) return std::uint32_t(i);
  return std::nullopt;
}

void copy_unless_bad(const Sim& sim, const Buffer& from, const Buffer& to) {
  const FiniteCheck& check = sim.check;
  const std::size_t words = from.bytes() / 4;
  check.keep.use();
  check.keep.set("count", unsigned(words));
  check.words.bind_storage(BIND_CHECK);
  from.bind_storage(BIND_KEEP_FROM);
  to.bind_storage(BIND_KEEP_TO);
  glDispatchCompute(GLuint(std::min<std::size_t>(work_groups(words, 256), 1024)), 1, 1);
}

void keep_state(Sim& sim) {
  FiniteCheck& check = sim.check;
  check.kept = true;
  if (on_cpu(sim)) {
    check.host = sim.host;
    return;
  }
  copy_unless_bad(sim, sim.current_positions(), check.positions);
  copy_unless_bad(sim, sim.velocities, check.velocities);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

long kept_step(const FiniteCheck& check) {
  return std::max(check.base, (check.found->step - 1) / keep_every * keep_every);
}

State read_kept(const Sim& sim) {
  if (on_cpu(sim)) return sim.check.host;
  return read_state(sim.check.positions, sim.check.velocities);
}

struct Cause {
  std::string cause, mend;
};

// Judged from the settings and the last state that was kept; the surest signs first.
Cause likely_cause(const Sim& sim, long step) {
  const Settings& s = sim.settings;
  const FiniteCheck& check = sim.check;
  const double h = s.dt / s.substeps, size = sim.model->size;
  if (!check.kept) return {"it was given like that", "look at where its numbers come from"};
  if (check.reloaded >= check.base && check.reloaded < step)
    return {fmt::format("the shaders of {}, loaded again at step {}", shader_folder(), check.reloaded),
            "mend them"};
  // Squared areas go with the fourth power of a length, and float ends at 3e38 and at 1e-38.
  if (size > 1e9 || size < 1e-9)
    return {fmt::format("a body of {:.3g} m, whose squared areas float cannot hold", size), "scale the body"};
  const State kept = read_kept(sim);
  double far = 0, fast = 0;
  for (std::size_t i = 0; i < kept.positions.size(); ++i) {
    far = std::max(far, glm::length(kept.positions[i]));
    if (sim.inverse_masses[i] > 0) fast = std::max(fast, glm::length(kept.velocities[i]));
  }
  const double most = std::max(fast, std::abs(s.gravity) * h);
  const char* calmer = "use a smaller dt or more substeps";
  if (far > 1e9 && far > 1e3 * size) return {fmt::format("positions that had reached {:.3g} m", far), calmer};
  if (most * h > size)
    return {fmt::format("{:.3g} m/s, which is {:.3g} body sizes in a substep of {:.3g} s", most,
                        most * h / size, h),
            calmer};
  if (s.omega > 2 && !on_cpu(sim))
    return {fmt::format("omega {:g}, above 2 where corrections can grow", s.omega),
            "use an omega from 1 to 2"};
  if (h > 1.0 / 30) return {fmt::format("a substep of {:.3g} s", h), calmer};
  if (!shader_folder().empty())
    return {"a shader of " + shader_folder(), "run without --shaders and TETPBD_SHADERS to see"};
  return {"unknown, no setting stands out", "use a smaller dt, more substeps or a lower stiffness"};
}

void find(Sim& sim, long step, std::uint32_t vertex) {
  const Cause cause = likely_cause(sim, step);
  sim.check.found = {step, vertex, cause.cause, cause.mend};
}

void ask(Sim& sim) {
  FiniteCheck& check = sim.check;
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, check.words.id());
  glBindBuffer(GL_COPY_WRITE_BUFFER, check.read_back.id());
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, GLsizeiptr(check.words.bytes()));
  check.fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  check.asked = sim.steps;
}

void take_answer(Sim& sim, bool wait) {
  FiniteCheck& check = sim.check;
  if (!check.fence || !reached(check.fence, wait, "checking for numbers that are not finite")) return;
  glDeleteSync(std::exchange(check.fence, nullptr));
  const auto words = check.read_back.read_all<std::uint32_t>();
  for (long step = check.checked + 1; step <= check.asked && !check.found; ++step)
    if (const std::uint32_t vertex = words[1 + check_slot(step)]; vertex != none) find(sim, step, vertex);
  check.checked = check.asked;
}

void forget(FiniteCheck& check, long step) {
  if (check.fence) glDeleteSync(std::exchange(check.fence, nullptr));
  check.found.reset();
  check.base = check.checked = check.asked = step;
  const std::vector<std::uint32_t> clean(1 + CHECK_STEPS, none);
  check.words.write(0, clean.size() * 4, clean.data());
}

}  // namespace

FiniteCheck& FiniteCheck::operator=(FiniteCheck&& other) noexcept {
  words = std::move(other.words), read_back = std::move(other.read_back);
  keep = std::move(other.keep);
  positions = std::move(other.positions), velocities = std::move(other.velocities);
  host = std::move(other.host);
  std::swap(fence, other.fence);
  base = other.base, checked = other.checked, asked = other.asked, reloaded = other.reloaded;
  kept = other.kept;
  found = std::move(other.found);
  return *this;
}

FiniteCheck::~FiniteCheck() {
  if (fence) glDeleteSync(fence);
}

unsigned check_slot(long step) { return unsigned(step % CHECK_STEPS); }

void make_check_words(FiniteCheck& check) {
  check.words = Buffer("check", (1 + CHECK_STEPS) * 4);
  check.read_back = Buffer("check read-back", (1 + CHECK_STEPS) * 4, nullptr, GL_STREAM_READ);
}

void make_kept(Sim& sim) {
  if (on_cpu(sim)) return;
  sim.check.positions = Buffer("kept positions", sim.current_positions().bytes());
  sim.check.velocities = Buffer("kept velocities", sim.velocities.bytes());
}

void start_check(Sim& sim, const State& given) {
  FiniteCheck& check = sim.check;
  forget(check, sim.steps);
  check.kept = false;
  check.reloaded = -1;
  if (const auto vertex = first_bad(given))
    find(sim, sim.steps, *vertex);
  else
    keep_state(sim);
}

void check_step(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (check.found) return;
  if (on_cpu(sim)) {
    if (const auto vertex = first_bad(sim.host)) return find(sim, sim.steps, *vertex);
    check.checked = sim.steps;
  } else if (sim.steps % ask_every == 0) {
    take_answer(sim, true);
    if (check.found) return;
    check_context();
    ask(sim);
  }
  if (sim.steps % keep_every == 0) keep_state(sim);
}

const std::optional<NonFinite>& check_finite(Sim& sim, bool wait) {
  FiniteCheck& check = sim.check;
  if (check.found || on_cpu(sim)) return check.found;
  check_context();
  if (!check.fence && check.checked < sim.steps) ask(sim);
  take_answer(sim, wait);
  if (wait && !check.found && check.checked < sim.steps) {
    ask(sim);
    take_answer(sim, true);
  }
  return check.found;
}

bool return_to_kept(Sim& sim) {
  FiniteCheck& check = sim.check;
  if (!check.found || !check.kept) return false;
  sim.steps = kept_step(check);
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
  sim.stale = true;
  forget(check, sim.steps);
  return true;
}

bool return_to_last_good(Sim& sim) {
  const std::optional<NonFinite> found = check_finite(sim, true);
  if (!found || !return_to_kept(sim)) return false;
  const bool timed = std::exchange(sim.timed, false);
  while (sim.steps < found->step - 1) step(sim);
  sim.timed = timed;
  if (check_finite(sim, true)) return_to_kept(sim);  // a driver whose bits do not repeat
  sim.check.found = found;
  return true;
}

Error error_of(const NonFinite& found, const std::string& where) {
  return Error(
      "the state is not finite",
      fmt::format("{}{}at step {}, vertex {}", where, where.empty() ? "" : ", ", found.step, found.vertex),
      fmt::format("likely cause: {}; {}", found.cause, found.mend), 1);
}

}  // namespace tetpbd
