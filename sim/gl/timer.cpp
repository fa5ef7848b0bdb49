#include "sim/gl/timer.h"

#include "sim/error.h"
#include "sim/gl/context.h"

namespace tetpbd {

bool reached(GLsync fence, bool wait, const char* what) {
  constexpr GLuint64 slice =
      1'000'000'000u;  // ns; a step may take as long as it likes, a lost GPU is noticed
  for (;;) {
    const GLenum state = glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, wait ? slice : 0u);
    if (state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED) return true;
    if (state == GL_TIMEOUT_EXPIRED && !wait) return false;
    check_context();
    if (state == GL_WAIT_FAILED) break;
  }
  throw Error("the GPU does not answer", what, "use fewer iterations or substeps, or a smaller mesh", 1);
}

void Timer::begin() {
  if (free_.empty()) {
    GLuint ids[2];
    glGenQueries(2, ids);
    free_.push_back({Query(ids[0]), Query(ids[1])});
  }
  pending_.push_back(std::move(free_.back()));
  free_.pop_back();
  pending_.back().ended = false;
  glQueryCounter(pending_.back().begin.name(), GL_TIMESTAMP);
}

void Timer::end() {
  glQueryCounter(pending_.back().end.name(), GL_TIMESTAMP);
  pending_.back().ended = true;
}

std::optional<double> Timer::poll(bool wait) {
  if (pending_.empty() || !pending_.front().ended) return std::nullopt;
  Span& span = pending_.front();
  GLint available = 0;
  if (!wait) glGetQueryObjectiv(span.end.name(), GL_QUERY_RESULT_AVAILABLE, &available);
  if (!wait && !available) return std::nullopt;
  GLuint64 begin = 0, end = 0;
  glGetQueryObjectui64v(span.begin.name(), GL_QUERY_RESULT, &begin);
  glGetQueryObjectui64v(span.end.name(), GL_QUERY_RESULT, &end);
  free_.push_back(std::move(span));
  pending_.pop_front();
  return double(end - begin) * 1e-6;
}

}  // namespace tetpbd
