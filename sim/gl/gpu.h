// The part of OpenGL 4.3 core that this program needs: a context (context.h), buffers, programs with includes, fences
// and timers, all labelled and counted. Of vendors' extensions only those are used that say how much memory is free.
// Nothing here knows of meshes or solvers.
#pragma once

#include <GL/glew.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim/gl/context.h"

namespace tetpbd {

/// What the program has of GL at present, in all contexts and threads together; images' bytes are not counted.
struct GlCounts {
  std::atomic<long> objects = 0;
  std::atomic<std::int64_t> buffer_bytes = 0;
  std::atomic<std::int64_t> most_bytes = 0;  ///< in tests, a limit for all buffers together; 0: the GPU's own
};
inline GlCounts& gl_counts() {
  static GlCounts counts;
  return counts;
}
struct GlLive {
  long objects = gl_counts().objects;
  std::int64_t buffer_bytes = gl_counts().buffer_bytes;
};
inline GlLive gl_live() { return {}; }

/// A lock that goes to who has waited longest.
class Turn {
 public:
  void lock() {
    const std::lock_guard in_line(line_);
    held_.lock();
  }
  void unlock() { held_.unlock(); }

 private:
  std::mutex line_, held_;
};
/// For a thread that must not call GL while another does, because the driver cannot take that: held while it may. None:
/// any time will do.
inline thread_local Turn* gl_turn = nullptr;
/// Lets another thread that waits for its turn have it.
inline void give_turn() {
  if (gl_turn) gl_turn->unlock(), gl_turn->lock();
}
/// Work without GL, during which others may call it.
struct WithoutGl {
  WithoutGl() { gl_turn ? gl_turn->unlock() : void(); }
  ~WithoutGl() { gl_turn ? gl_turn->lock() : void(); }
};

inline void label_object(GLenum kind, GLuint id, const std::string& label) {
  glObjectLabel(kind, id, GLsizei(label.size()), label.data());
}

/// A GL object that is deleted with its owner. `Name` is GLuint or GLsync, where 0 means none.
template <class Name, void (*destroy)(Name)>
class Owned {
 public:
  Owned() = default;
  explicit Owned(Name name, std::int64_t bytes = 0) : name_(name), bytes_(bytes) { count(1); }
  Owned(Owned&& other) noexcept { swap(other); }
  Owned& operator=(Owned&& other) noexcept { return swap(other), *this; }
  ~Owned() {
    if (name_) destroy(name_), count(-1);
  }
  Name id() const { return name_; }
  std::size_t bytes() const { return std::size_t(bytes_); }
  explicit operator bool() const { return name_ != Name{}; }

 private:
  void count(int change) const {
    gl_counts().objects += change;
    gl_counts().buffer_bytes += change * bytes_;
  }
  void swap(Owned& other) { std::swap(name_, other.name_), std::swap(bytes_, other.bytes_); }
  Name name_{};
  std::int64_t bytes_ = 0;
};

inline void delete_buffer(GLuint id) { glDeleteBuffers(1, &id); }
inline void delete_program(GLuint id) { glDeleteProgram(id); }
inline void delete_query(GLuint id) { glDeleteQueries(1, &id); }
inline void delete_fence(GLsync sync) { glDeleteSync(sync); }

template <GLenum kind>
void delete_named(GLuint id) {
  if constexpr (kind == GL_VERTEX_ARRAY) glDeleteVertexArrays(1, &id);
  if constexpr (kind == GL_TEXTURE) glDeleteTextures(1, &id);
  if constexpr (kind == GL_RENDERBUFFER) glDeleteRenderbuffers(1, &id);
  if constexpr (kind == GL_FRAMEBUFFER) glDeleteFramebuffers(1, &id);
  if constexpr (kind == GL_SAMPLER) glDeleteSamplers(1, &id);
}
/// Construction leaves the object bound, because only a name that was bound is an object and can have a label.
template <GLenum kind>
struct Named : Owned<GLuint, delete_named<kind>> {
  Named() = default;
  /// `target` is that of a texture.
  explicit Named(const std::string& label, [[maybe_unused]] GLenum target = GL_TEXTURE_2D)
      : Named::Owned(make(target)) {
    label_object(kind, this->id(), label);
  }
  static GLuint make([[maybe_unused]] GLenum target) {
    GLuint id = 0;
    if constexpr (kind == GL_VERTEX_ARRAY) glGenVertexArrays(1, &id), glBindVertexArray(id);
    if constexpr (kind == GL_TEXTURE) glGenTextures(1, &id), glBindTexture(target, id);
    if constexpr (kind == GL_RENDERBUFFER) glGenRenderbuffers(1, &id), glBindRenderbuffer(GL_RENDERBUFFER, id);
    if constexpr (kind == GL_FRAMEBUFFER) glGenFramebuffers(1, &id), glBindFramebuffer(GL_FRAMEBUFFER, id);
    if constexpr (kind == GL_SAMPLER) glGenSamplers(1, &id), glBindSampler(0, id), glBindSampler(0, 0);
    return id;
  }
};
using VertexArray = Named<GL_VERTEX_ARRAY>;
using Texture = Named<GL_TEXTURE>;
using Renderbuffer = Named<GL_RENDERBUFFER>;
using Framebuffer = Named<GL_FRAMEBUFFER>;
using Sampler = Named<GL_SAMPLER>;

/// Throws Error naming `what` if it does not fit or an earlier GL call failed.
void check_memory(const std::string& what, std::size_t bytes, bool fits = true);
/// Forgets GL errors of earlier calls, so that check_memory() finds those of the next alone.
void clear_errors();

/// Reads a buffer known by its GL name. Waits for the GPU.
void read_buffer(GLuint from, std::size_t offset, std::size_t bytes, void* data);
/// Copies what kernels wrote. Queued: done when the GPU reaches the next fence.
void copy_buffer(GLuint from, std::size_t offset, GLuint to, std::size_t at, std::size_t bytes);

/// A buffer of fixed size.
class Buffer : public Owned<GLuint, delete_buffer> {
 public:
  Buffer() = default;
  Buffer(std::string label, std::size_t bytes, const void* data = nullptr, GLenum usage = GL_DYNAMIC_COPY);
  template <class T>
  Buffer(std::string label, const std::vector<T>& data, GLenum usage = GL_STATIC_DRAW)
      : Buffer(std::move(label), data.size() * sizeof(T), data.data(), usage) {}

  const std::string& label() const { return label_; }
  void write(std::size_t offset, std::size_t bytes, const void* data) const;
  /// Writes items of `bytes` each, one after the other in `data`, to an offset of its own each.
  void write_each(const std::vector<std::size_t>& offsets, std::size_t bytes, const void* data) const;
  void read(std::size_t offset, std::size_t bytes, void* data) const { read_buffer(id(), offset, bytes, data); }
  void copy_to(const Buffer& to, std::size_t at, std::size_t offset, std::size_t bytes) const {
    copy_buffer(id(), offset, to.id(), at, bytes);
  }
  void clear() const;  ///< to zero bytes
  void bind_uniform(int binding) const { glBindBufferBase(GL_UNIFORM_BUFFER, GLuint(binding), id()); }

  template <class T>
  std::vector<T> read_all() const {
    std::vector<T> data(bytes() / sizeof(T));
    read(0, data.size() * sizeof(T), data.data());
    return data;
  }

 private:
  std::string label_;
  bool whole_at_once_ = false;  ///< GL_STREAM_DRAW: writing all of it takes new memory, so nothing waits
};

/// A place in the GPU's queue.
struct Fence : Owned<GLsync, delete_fence> {
  using Owned::Owned;
  static Fence here() { return Fence(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)); }
  GLsync sync() const { return id(); }
};
/// Whether the GPU has reached the fence; with `wait`, waits until it has. Throws ContextLost, or Error with `what`.
bool reached(GLsync fence, bool wait, const char* what);
/// The contents of a readback buffer once the GPU has reached `fence`, which is then reset; nothing before that (with
/// `wait`, waits) or without a fence.
template <class T>
std::optional<std::vector<T>> poll_readback(Fence& fence, const Buffer& buffer, const char* what, bool wait = false) {
  if (!fence || !reached(fence.id(), wait, what)) return std::nullopt;
  fence = Fence();
  return buffer.read_all<T>();
}

/// GPU time between begin() and end(), by pairs of timestamps that are read back when ready.
class Timer {
 public:
  void begin() { begun_ = now(); }
  void end() { spans_.emplace_back(std::move(begun_), now()); }
  /// Milliseconds of the oldest span if it is ready; with `wait`, waits for it.
  std::optional<double> poll(bool wait = false);

 private:
  using Query = Owned<GLuint, delete_query>;
  static Query now();
  Query begun_;
  std::deque<std::pair<Query, Query>> spans_;
};

/// Values of `$NAME` in a shader's text: {"KIND", "stretch"} makes gather_$KIND gather_stretch.
using Substitutions = std::map<std::string, std::string>;
/// `words` apply to the whole text. A line with #foreach is repeated for every entry of `each`, with its words.
struct ShaderWords {
  Substitutions words;
  std::vector<Substitutions> each;
};

/// The folder that shaders are read from, TETPBD_SHADERS at first; empty: those inside the program.
void set_shader_folder(const std::string& folder);
const std::string& shader_folder();
/// From now on each program writes the text that the compiler gets into this folder, a file for each stage, named after
/// the program's label, with a number where another text has that name. Empty: no longer.
void set_shader_dump(const std::string& folder);
void dump_shader(const std::string& label, const std::string& stage, const std::string& text);
/// Changes when a file of the folder changes; 0 without a folder.
std::int64_t shader_folder_version();

/// The text of shaders/`name` with #include, #foreach and `$NAME` expanded. `files` gets the files it is made of: line
/// N of files[I] follows a line "#line N I", because GLSL has numbers where C has names.
std::string shader_text(const std::string& name, const ShaderWords& words, std::vector<std::string>& files);

/// A linked program. Errors name the shader file and line.
class Program : public Owned<GLuint, delete_program> {
 public:
  Program() = default;
  /// Compiles each file as the stage that its ending names, after `#version 430 core` and `#define`s. Throws Error
  /// where it uses more storage blocks than `most_blocks`; GL 4.3 guarantees 8 for a kernel.
  Program(std::string label, const std::vector<std::string>& stages, const ShaderWords& words = {},
          const std::vector<std::string>& defines = {}, std::size_t most_blocks = 8);
  static Program compute(const std::string& file, const ShaderWords& words = {},
                         const std::vector<std::string>& defines = {}, std::size_t most_blocks = 8);

  const std::string& label() const { return label_; }
  /// Names of the storage blocks that the program uses; the k-th has binding point k.
  const std::vector<std::string>& storage_blocks() const { return storage_blocks_; }
  void use() const { glUseProgram(id()); }
  /// Set a uniform of the program in use. One that the linker dropped is ignored; one not declared throws Error.
  void set(const char* name, int value) const { glUniform1i(location(name), value); }
  void set(const char* name, unsigned value) const { glUniform1ui(location(name), value); }
  void set(const char* name, float value) const { glUniform1f(location(name), value); }
  /// For each dispatch: does nothing where the value is the same again or the kernel does not have the uniform.
  void set_changed(const char* name, unsigned value) const;
  void set(const char* name, const glm::uvec2& value) const { glUniform2uiv(location(name), 1, &value.x); }
  void set(const char* name, const glm::vec3& value) const { glUniform3fv(location(name), 1, &value.x); }
  void set(const char* name, const glm::vec4& value) const { glUniform4fv(location(name), 1, &value.x); }

 private:
  GLint location(const char* name) const;
  void number_storage_blocks(std::size_t most);
  std::string label_, text_;
  std::vector<std::string> storage_blocks_;
  mutable std::map<std::string, GLint, std::less<>> locations_;
  mutable std::map<std::string, std::pair<GLint, unsigned>, std::less<>> last_;  // location, value
};

/// A buffer that shaders read as a samplerBuffer of floats. Throws Error with this remedy where it is too long.
std::pair<Buffer, Texture> make_texels(const char* label, const std::vector<float>& values, const char* remedy);
/// Four floats a texel of a buffer that kernels write.
Texture make_texel_view(const Buffer& buffer);
void bind_texels(int unit, const Texture& texture);

}  // namespace tetpbd
