#include "sim/finite_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/layout.h"

namespace tetpbd {

Error error_of(const NonFinite& found, const std::string& where) {
  return Error(
      "the state is not finite",
      fmt::format("{}{}at step {}, vertex {}", where, where.empty() ? "" : ", ", found.step, found.vertex),
      "use a smaller dt, more substeps or a lower stiffness", 1);
}

std::optional<std::uint32_t> first_non_finite(const State& state) {
  const auto finite = [](const glm::dvec3& v) {
    return std::isfinite(float(v.x)) && std::isfinite(float(v.y)) && std::isfinite(float(v.z));
  };
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    if (!finite(state.positions[i]) || !finite(state.velocities[i])) return std::uint32_t(i);
  return std::nullopt;
}

FiniteCheck make_finite_check(std::size_t position_bytes, std::size_t velocity_bytes) {
  FiniteCheck check;
  check.words = Buffer("check", 8);
  check.read_back = Buffer("check read-back", 8, nullptr, GL_STREAM_READ);
  check.copy = Program::compute("checkpoint.comp");
  if (position_bytes == 0) return check;
  check.positions = Buffer("checkpoint positions", position_bytes);
  check.velocities = Buffer("checkpoint velocities", velocity_bytes);
  return check;
}

void restart(FiniteCheck& check, long step) {
  check.asked = {};
  check.found.reset();
  check.has_checkpoint = false;
  check.first = check.known = check.asked_step = step;
  const std::uint32_t none[2] = {~0u, ~0u};
  check.words.write(0, sizeof none, none);
}

void save_checkpoint(FiniteCheck& check, const Buffer& positions, const Buffer& velocities) {
  check.copy.use();
  check.words.bind_storage(BIND_CHECK);
  for (const auto& [from, to] :
       {std::pair(&positions, &check.positions), std::pair(&velocities, &check.velocities)}) {
    const std::size_t words = from->bytes() / 4;
    check.copy.set("count", unsigned(words));
    from->bind_storage(BIND_CHECKPOINT_FROM);
    to->bind_storage(BIND_CHECKPOINT_TO);
    glDispatchCompute(GLuint(std::min<std::size_t>(work_groups(words, 256), 1024)), 1, 1);
  }
  // The next step overwrites what was read; restoring reads what was written.
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  check.has_checkpoint = true;
}

long checkpoint_step(const FiniteCheck& check) {
  const long every = FiniteCheck::checkpoint_every;
  return std::max(check.first, (check.found->step - 1) / every * every);
}

void ask(FiniteCheck& check, long step, bool wait) {
  const auto take = [&](bool wait_for_it) {
    if (!check.asked.sync() ||
        !reached(check.asked.sync(), wait_for_it, "checking for numbers that are not finite"))
      return;
    check.asked = {};
    const auto words = check.read_back.read_all<std::uint32_t>();  // its step, its vertex
    if (words[0] != ~0u) check.found = {long(words[0]), words[1]};
    check.known = check.asked_step;
  };
  take(wait);
  if (check.found || check.asked.sync() || check.known >= step) return;
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);  // kernels wrote what is copied
  glBindBuffer(GL_COPY_READ_BUFFER, check.words.id());
  glBindBuffer(GL_COPY_WRITE_BUFFER, check.read_back.id());
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, GLsizeiptr(check.words.bytes()));
  check.asked = Fence::here();
  check.asked_step = step;
  if (wait) take(true);
}

}  // namespace tetpbd
