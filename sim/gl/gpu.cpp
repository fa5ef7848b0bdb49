#include "sim/gl/gpu.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "sim/error.h"

namespace tetpbd {

static const char* const smaller = "use a smaller mesh, a smaller image or fewer samples";

void check_memory(const std::string& what, std::size_t bytes, bool fits) {
  // For an absurd size, drivers report other errors than GL_OUT_OF_MEMORY.
  if (glGetError() != GL_NO_ERROR || !fits)
    throw Error("out of GPU memory", fmt::format("{} of {} bytes", what, bytes), smaller, 1);
}

void clear_errors() {
  for (int i = 0; i < 100 && glGetError() != GL_NO_ERROR;) ++i;  // a lost context reports errors for ever
}

namespace {

GLuint new_buffer() {
  GLuint id = 0;
  glGenBuffers(1, &id);
  return id;
}

// Bytes available for another buffer beside `held` bytes of others, where the driver says it.
std::optional<std::int64_t> available_bytes(std::int64_t held) {
  if (const std::int64_t most = gl_counts().most_bytes) return most - held;
  GLint kib[4] = {};
  if (GLEW_ATI_meminfo) {
    glGetIntegerv(GL_VBO_FREE_MEMORY_ATI, kib);
    return (std::int64_t(kib[0]) + kib[2]) << 10;  // the GPU's own memory, and the computer's that it may use
  }
  if (!GLEW_NVX_gpu_memory_info) return std::nullopt;
  glGetIntegerv(GL_GPU_MEMORY_INFO_CURRENT_AVAILABLE_VIDMEM_NVX, &kib[0]);
  glGetIntegerv(GL_GPU_MEMORY_INFO_TOTAL_AVAILABLE_MEMORY_NVX, &kib[1]);
  // NVIDIA's driver takes a buffer's memory at its first use, so what is free now may be promised already.
  return std::min(std::int64_t(kib[0]) << 10, (std::int64_t(kib[1]) << 10) - held);
}

// Bytes from which on a buffer's size is checked: some drivers stop their threads to report memory.
constexpr std::size_t large = 1 << 20;

void check_available(const std::string& label, std::size_t bytes) {
  if (bytes < large && gl_counts().most_bytes == 0) return;
  const std::int64_t held = gl_live().buffer_bytes - std::int64_t(bytes);
  const auto available = available_bytes(held);
  if (available && std::int64_t(bytes) > *available)
    throw Error("out of GPU memory",
                fmt::format("buffer '{}' of {} bytes beside {} of others, {} are available", label, bytes, held,
                            std::max<std::int64_t>(*available, 0)),
                smaller, 1);
}

// Takes new memory for the buffer that is bound to `target`.
void allocate(GLenum target, const std::string& label, std::size_t bytes, const void* data, GLenum usage, bool check) {
  if (check) clear_errors();
  glBufferData(target, GLsizeiptr(bytes), data, usage);
  if (!check) return;
  GLint64 made = 0;  // some drivers report no error where it does not fit
  glGetBufferParameteri64v(target, GL_BUFFER_SIZE, &made);
  check_memory(fmt::format("buffer '{}'", label), bytes, std::size_t(made) >= bytes);
}

}  // namespace

Buffer::Buffer(std::string label, std::size_t bytes, const void* data, GLenum usage)
    : Owned(new_buffer(), std::int64_t(bytes)), label_(std::move(label)), whole_at_once_(usage == GL_STREAM_DRAW) {
  check_available(label_, bytes);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  allocate(GL_COPY_WRITE_BUFFER, label_, std::max<std::size_t>(bytes, 4), data, usage, true);
  label_object(GL_BUFFER, id(), label_);
}

// Kernels queued before may still read or write the buffer. The barriers here are why pins, uploads, resets and
// readbacks need none of their own.
void Buffer::write(std::size_t offset, std::size_t bytes, const void* data) const {
  if (whole_at_once_ && offset == 0 && bytes == this->bytes()) {
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glBindBuffer(GL_COPY_WRITE_BUFFER, id());
    allocate(GL_COPY_WRITE_BUFFER, label_, bytes, data, GL_STREAM_DRAW, bytes >= large);
    return;
  }
  write_each({offset}, bytes, data);
}

// Copies from a buffer of its own, because with NVIDIA's 580 driver a kernel that follows glBufferSubData may see the
// old bytes, whatever barriers stand between, unless something flushes (docs/decisions.md).
void Buffer::write_each(const std::vector<std::size_t>& offsets, std::size_t bytes, const void* data) const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  const Owned<GLuint, delete_buffer> staging(new_buffer());
  const std::size_t all = offsets.size() * bytes;
  glBindBuffer(GL_COPY_READ_BUFFER, staging.id());
  allocate(GL_COPY_READ_BUFFER, label_ + ", new contents", all, data, GL_STREAM_DRAW, all >= large);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  for (std::size_t i = 0; i < offsets.size(); ++i)
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, GLintptr(i * bytes), GLintptr(offsets[i]),
                        GLsizeiptr(bytes));
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
  glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, GLintptr(offset), GLintptr(at), GLsizeiptr(bytes));
}

void Buffer::clear() const {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_WRITE_BUFFER, id());
  glClearBufferData(GL_COPY_WRITE_BUFFER, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
}

bool reached(GLsync fence, bool wait, const char* what) {
  constexpr GLuint64 slice = 1'000'000'000u;  // ns; a step may take longer, but a lost GPU is noticed
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

std::pair<Buffer, Texture> make_texels(const char* label, const std::vector<float>& values, const char* remedy) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most);
  if (values.size() > std::size_t(most))
    throw Error(fmt::format("too many values for the {}", label),
                fmt::format("{} of them, the driver allows {}", values.size(), most), remedy, 1);
  std::pair<Buffer, Texture> made{Buffer(label, values), Texture(label, GL_TEXTURE_BUFFER)};
  glTexBuffer(GL_TEXTURE_BUFFER, GL_R32F, made.first.id());
  glBindTexture(GL_TEXTURE_BUFFER, 0);
  return made;
}
Texture make_texel_view(const Buffer& buffer) {
  Texture texture(buffer.label(), GL_TEXTURE_BUFFER);
  glTexBuffer(GL_TEXTURE_BUFFER, GL_RGBA32F, buffer.id());
  glBindTexture(GL_TEXTURE_BUFFER, 0);
  return texture;
}
void bind_texels(int unit, const Texture& texture) {
  glActiveTexture(GL_TEXTURE0 + GLenum(unit));
  glBindTexture(GL_TEXTURE_BUFFER, texture.id());
  glActiveTexture(GL_TEXTURE0);
}

}  // namespace tetpbd
