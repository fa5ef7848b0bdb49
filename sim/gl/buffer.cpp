#include "sim/gl/buffer.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>

#include "sim/error.h"

namespace tetpbd {

namespace {

std::atomic<long> live_objects = 0;
std::atomic<std::int64_t> live_buffer_bytes = 0;

}  // namespace

GlLive gl_live() { return {live_objects, live_buffer_bytes}; }

void count_gl_objects(long change, std::int64_t buffer_bytes) {
  live_objects += change;
  live_buffer_bytes += buffer_bytes;
}

void check_memory(const std::string& what, std::size_t bytes, bool fits) {
  // Drivers call an absurd size by other names than GL_OUT_OF_MEMORY.
  if (glGetError() != GL_NO_ERROR || !fits)
    throw Error("out of GPU memory", fmt::format("{} of {} bytes", what, bytes),
                "use a smaller mesh, a smaller image or fewer samples", 1);
}

void clear_errors() {
  // A lost context answers an error for ever.
  for (int i = 0; i < 100 && glGetError() != GL_NO_ERROR; ++i) {
  }
}

Buffer::Buffer(std::string label, std::size_t bytes, const void* data, GLenum usage)
    : label_(std::move(label)), whole_at_once_(usage == GL_STREAM_DRAW) {
  clear_errors();
  GLuint id = 0;
  glGenBuffers(1, &id);
  object_ = Owned<GLuint, delete_buffer>(id, std::int64_t(bytes));
  glBindBuffer(GL_COPY_WRITE_BUFFER, id);
  glBufferData(GL_COPY_WRITE_BUFFER, GLsizeiptr(std::max<std::size_t>(bytes, 4)), data, usage);
  GLint64 made = 0;  // some drivers say nothing of what does not fit
  glGetBufferParameteri64v(GL_COPY_WRITE_BUFFER, GL_BUFFER_SIZE, &made);
  check_memory(fmt::format("buffer '{}'", label_), bytes, std::size_t(made) >= bytes);
  label_object(GL_BUFFER, id, label_);
}

// Kernels queued before may still read or write the buffer: the barrier here is why pins, uploads, resets and
// read-backs need none of their own. What no kernel wrote, GL orders by itself.
void Buffer::write(std::size_t offset, std::size_t bytes, const void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  if (whole_at_once_ && offset == 0 && bytes == this->bytes()) {
    glBindBuffer(GL_COPY_WRITE_BUFFER, id());
    glBufferData(GL_COPY_WRITE_BUFFER, GLsizeiptr(bytes), data, GL_STREAM_DRAW);
    return;
  }
  // Through a buffer of its own: NVIDIA's 580 driver lets a kernel that follows glBufferSubData see the old
  // bytes, whatever barriers stand between, unless something flushes (docs/decisions.md).
  GLuint staging = 0;
  glGenBuffers(1, &staging);
  glBindBuffer(GL_COPY_READ_BUFFER, staging);
  glBufferData(GL_COPY_READ_BUFFER, GLsizeiptr(bytes), data, GL_STREAM_DRAW);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, GLintptr(offset), GLsizeiptr(bytes));
  glDeleteBuffers(1, &staging);
}

void Buffer::read(std::size_t offset, std::size_t bytes, void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, id());
  glGetBufferSubData(GL_COPY_READ_BUFFER, GLintptr(offset), GLsizeiptr(bytes), data);
}

void Buffer::clear() const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  glClearBufferData(GL_COPY_WRITE_BUFFER, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

}  // namespace tetpbd
