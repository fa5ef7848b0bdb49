#include "sim/gl/timer.h"

#include "sim/error.h"
#include "sim/gl/context.h"

namespace tetpbd {

bool reached(GLsync fence, bool wait, const char* what) {
  constexpr GLuint64 slice = 1'000'000'000u;  // ns; a step takes what it takes, a lost GPU is noticed
  for (;;) {
    const GLenum state = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, wait ? slice : 0u);
    if (state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED) return true;
    if (state == GL_TIMEOUT_EXPIRED && !wait) return false;
    check_context();
    if (state == GL_WAIT_FAILED) break;
  }
  throw Error("the GPU does not answer", what, "use fewer iterations or substeps, or a smaller mesh", 1);
}

Timer::Query Timer::now() {
  GLuint id = 0;
  glGenQueries(1, &id);
  glQueryCounter(id, GL_TIMESTAMP);
  return Query(id);
}

std::optional<double> Timer::poll(bool wait) {
  if (spans_.empty()) return std::nullopt;
  const auto& [first, last] = spans_.front();
  GLint available = wait;
  if (!wait) glGetQueryObjectiv(last.name(), GL_QUERY_RESULT_AVAILABLE, &available);
  if (!available) return std::nullopt;
  GLuint64 begin = 0, end = 0;
  glGetQueryObjectui64v(first.name(), GL_QUERY_RESULT, &begin);
  glGetQueryObjectui64v(last.name(), GL_QUERY_RESULT, &end);
  spans_.pop_front();
  return double(end - begin) * 1e-6;
}

}  // namespace tetpbd
