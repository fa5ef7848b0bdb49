#include "sim/gl/gpu.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/error.h"

namespace tetpbd {

void check_memory(const std::string& what, std::size_t bytes, bool fits) {
  // Drivers call an absurd size by other names than GL_OUT_OF_MEMORY.
  if (glGetError() != GL_NO_ERROR || !fits)
    throw Error("out of GPU memory", fmt::format("{} of {} bytes", what, bytes),
                "use a smaller mesh, a smaller image or fewer samples", 1);
}

void clear_errors() {
  for (int i = 0; i < 100 && glGetError() != GL_NO_ERROR;) ++i;  // a lost context answers an error for ever
}

namespace {
GLuint new_buffer() {
  GLuint id = 0;
  glGenBuffers(1, &id);
  return id;
}
}  // namespace

Buffer::Buffer(std::string label, std::size_t bytes, const void* data, GLenum usage)
    : Owned(new_buffer(), std::int64_t(bytes)),
      label_(std::move(label)),
      whole_at_once_(usage == GL_STREAM_DRAW) {
  clear_errors();
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  glBufferData(GL_COPY_WRITE_BUFFER, GLsizeiptr(std::max<std::size_t>(bytes, 4)), data, usage);
  GLint64 made = 0;  // some drivers say nothing of what does not fit
  glGetBufferParameteri64v(GL_COPY_WRITE_BUFFER, GL_BUFFER_SIZE, &made);
  check_memory(fmt::format("buffer '{}'", label_), bytes, std::size_t(made) >= bytes);
  label_object(GL_BUFFER, id(), label_);
}

// Kernels queued before may still read or write the buffer: the barrier here is why pins, uploads, resets and
// read-backs need none of their own. What no kernel wrote, GL orders by itself.
void Buffer::write(std::size_t offset, std::size_t bytes, const void* data) const {
  if (whole_at_once_ && offset == 0 && bytes == this->bytes()) {
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glBindBuffer(GL_COPY_WRITE_BUFFER, id());
    glBufferData(GL_COPY_WRITE_BUFFER, GLsizeiptr(bytes), data, GL_STREAM_DRAW);
    return;
  }
  write_each({offset}, bytes, data);
}

// Through a buffer of its own: NVIDIA's 580 driver lets a kernel that follows glBufferSubData see the old
// bytes, whatever barriers stand between, unless something flushes (docs/decisions.md).
void Buffer::write_each(const std::vector<std::size_t>& offsets, std::size_t bytes, const void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  const GLuint staging = new_buffer();
  glBindBuffer(GL_COPY_READ_BUFFER, staging);
  glBufferData(GL_COPY_READ_BUFFER, GLsizeiptr(offsets.size() * bytes), data, GL_STREAM_DRAW);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  for (std::size_t i = 0; i < offsets.size(); ++i)
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, GLintptr(i * bytes), GLintptr(offsets[i]),
                        GLsizeiptr(bytes));
  delete_buffer(staging);
}

void read_buffer(GLuint from, std::size_t offset, std::size_t bytes, void* data) {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, from);
  glGetBufferSubData(GL_COPY_READ_BUFFER, GLintptr(offset), GLsizeiptr(bytes), data);
}

void copy_buffer(GLuint from, std::size_t offset, GLuint to, std::size_t at, std::size_t bytes) {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, from);
  glBindBuffer(GL_COPY_WRITE_BUFFER, to);
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, GLintptr(offset), GLintptr(at),
                      GLsizeiptr(bytes));
}

void Buffer::clear() const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  glClearBufferData(GL_COPY_WRITE_BUFFER, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

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
  if (!wait) glGetQueryObjectiv(last.id(), GL_QUERY_RESULT_AVAILABLE, &available);
  if (!available) return std::nullopt;
  GLuint64 begin = 0, end = 0;
  glGetQueryObjectui64v(first.id(), GL_QUERY_RESULT, &begin);
  glGetQueryObjectui64v(last.id(), GL_QUERY_RESULT, &end);
  spans_.pop_front();
  return double(end - begin) * 1e-6;
}

}  // namespace tetpbd
