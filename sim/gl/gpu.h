// The little OpenGL 4.3 core this program needs: move-only handles, labelled; shader sources with includes;
// timestamps. No direct state access, no buffer storage, no vendor extension.
#pragma once

#include <GL/glew.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <glm/glm.hpp>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tetpbd {

/// What the current context offers; everything the program asks a driver beyond GL 4.3's guarantees is listed
/// here.
struct Capabilities {
  std::string vendor, renderer, version, shading_language;
  int storage_blocks = 0;          ///< shader storage blocks a compute stage may use (8 guaranteed)
  std::int64_t storage_bytes = 0;  ///< largest storage block
  int work_group_invocations = 0;  ///< 1024 guaranteed
  int shared_bytes = 0;            ///< shared memory of a work-group
  int samples = 0;                 ///< largest MSAA sample count
  bool software = false;           ///< a CPU pretends to be a GPU (llvmpipe, softpipe, swrast)
  bool debug = false;              ///< a debug context: every GL error is reported
  bool reset_status = false;       ///< the driver tells when the GPU was reset
};

/// Loads GL functions for the current context and checks for GL 4.3. Throws Error with the version found.
Capabilities load_gl();
/// Whether the current context's GPU is a CPU (llvmpipe, softpipe, swrast).
bool is_software_renderer();
/// Number of GL debug messages of type ERROR since the start (only a debug context counts them).
int gl_error_count();

/// What a driver may refuse; tests make their own.
struct Limits {
  int storage_blocks = 0;
  std::int64_t storage_bytes = 0;
  unsigned work_groups = 0;  ///< of one dispatch (65535 guaranteed)
};
/// The current context's.
Limits gl_limits();
/// Throws Error if a kernel needs more work-groups than one dispatch may have.
void check_work_groups(const std::string& kernel, std::size_t groups, const Limits& limits = gl_limits());

/// Throws ContextLost if the GPU was reset. Cheap, but not free: once a frame, not once a dispatch.
void check_context();
/// Answers check_context() in place of the driver: provokes in tests what no software renderer does. Null:
/// the driver.
void set_reset_status(GLenum (*answer)());
/// Whether the GPU has come to the fence; with `wait`, once it has. Where waiting fails: ContextLost, or an
/// Error that names what was waited for.
bool reached(GLsync fence, bool wait, const char* what);
/// Throws Error naming what did not fit if the last GL call was out of memory.
void check_memory(const std::string& what, std::size_t bytes);
/// Forgets GL errors of earlier calls, so that check_memory judges the next alone.
void clear_errors();
/// What the program holds of GL right now, over all contexts: buffers, programs, queries, fences of
/// measurements, and what render/handles.h makes. Textures' and renderbuffers' bytes are not counted.
struct GlLive {
  long objects = 0;
  std::int64_t buffer_bytes = 0;
};
GlLive gl_live();
void count_gl_objects(long change, std::int64_t buffer_bytes = 0);

/// A buffer object of fixed size in bytes.
class Buffer {
 public:
  Buffer() = default;
  Buffer(std::string label, std::size_t bytes, const void* data = nullptr, GLenum usage = GL_DYNAMIC_COPY);
  template <class T>
  Buffer(std::string label, const std::vector<T>& data, GLenum usage = GL_STATIC_DRAW)
      : Buffer(std::move(label), data.size() * sizeof(T), data.data(), usage) {}
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Buffer();

  GLuint id() const { return id_; }
  std::size_t bytes() const { return bytes_; }
  const std::string& label() const { return label_; }
  explicit operator bool() const { return id_ != 0; }

  void write(std::size_t offset, std::size_t bytes, const void* data) const;
  void read(std::size_t offset, std::size_t bytes, void* data) const;  ///< waits for the GPU
  void clear() const;                                                  ///< to zero bytes
  void bind_storage(int binding) const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, GLuint(binding), id_); }
  void bind_uniform(int binding) const { glBindBufferBase(GL_UNIFORM_BUFFER, GLuint(binding), id_); }

  template <class T>
  std::vector<T> read_all() const {
    std::vector<T> data(bytes_ / sizeof(T));
    read(0, data.size() * sizeof(T), data.data());
    return data;
  }

 private:
  void swap(Buffer& other) noexcept {
    std::swap(id_, other.id_), std::swap(bytes_, other.bytes_), std::swap(label_, other.label_);
    std::swap(whole_at_once_, other.whole_at_once_);
  }
  GLuint id_ = 0;
  std::size_t bytes_ = 0;
  std::string label_;
  bool whole_at_once_ =
      false;  ///< GL_STREAM_DRAW: a write of all of it gets new memory, which nothing waits for
};

/// Values of `$NAME` in a shader's text, put in before it is compiled: {"KIND", "stretch"} makes gather_$KIND
/// gather_stretch.
using Substitutions = std::map<std::string, std::string>;
/// `words` for the whole text; `each`: a line that starts with #foreach is repeated once for every entry,
/// with its words.
struct ShaderWords {
  Substitutions words;
  std::vector<Substitutions> each;
};

/// Reads shaders from this folder instead of the ones inside the program (empty: inside). The variable
/// TETPBD_SHADERS sets it at start.
void set_shader_folder(const std::string& folder);
const std::string& shader_folder();
/// A number that grows when a file below the shader folder changed; always 0 for embedded shaders.
std::int64_t shader_folder_version();

/// Text of shaders/`name` with `#include "..."` (a path relative to shaders/), `#foreach` and `$NAME`
/// expanded.
std::string shader_text(const std::string& name, const ShaderWords& words = {});

/// A linked program. Errors name the shader file and line.
class Program {
 public:
  struct Stage {
    GLenum type;
    std::string file;
  };
  Program() = default;
  /// `#define`s and `#version 430 core` are put before each stage.
  Program(std::string label, const std::vector<Stage>& stages, const ShaderWords& words = {},
          const std::vector<std::string>& defines = {});
  static Program compute(const std::string& file, const ShaderWords& words = {},
                         const std::vector<std::string>& defines = {});
  Program(Program&& other) noexcept { swap(other); }
  Program& operator=(Program&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Program();

  GLuint id() const { return id_; }
  const std::string& label() const { return label_; }
  explicit operator bool() const { return id_ != 0; }
  void use() const { glUseProgram(id_); }
  /// Sets a uniform of the program in use. One that the linker dropped is ignored; one that its text does not
  /// declare throws Error.
  void set(const char* name, int value) const { glUniform1i(location(name), value); }
  void set(const char* name, unsigned value) const { glUniform1ui(location(name), value); }
  void set(const char* name, float value) const { glUniform1f(location(name), value); }
  /// The same by a location that the shader states.
  void set(int location, const glm::uvec2& value) const { glUniform2ui(location, value.x, value.y); }
  void set(const char* name, const glm::vec2& value) const { glUniform2fv(location(name), 1, &value.x); }
  void set(const char* name, const glm::vec3& value) const { glUniform3fv(location(name), 1, &value.x); }
  void set(const char* name, const glm::vec4& value) const { glUniform4fv(location(name), 1, &value.x); }
  void set(const char* name, const glm::mat4& value) const {
    glUniformMatrix4fv(location(name), 1, GL_FALSE, &value[0].x);
  }

 private:
  void swap(Program& other) noexcept {
    std::swap(id_, other.id_), std::swap(label_, other.label_), std::swap(locations_, other.locations_);
    std::swap(declarations_, other.declarations_);
  }
  GLint location(const char* name) const;
  GLuint id_ = 0;
  std::string label_;
  std::string declarations_;  ///< the lines that declare uniforms
  mutable std::map<std::string, GLint, std::less<>> locations_;
};

/// A place in the GPU's queue.
class Fence {
 public:
  Fence() = default;
  static Fence here();
  Fence(Fence&& other) noexcept { std::swap(sync_, other.sync_); }
  Fence& operator=(Fence&& other) noexcept {
    std::swap(sync_, other.sync_);
    return *this;
  }
  ~Fence();
  GLsync sync() const { return sync_; }

 private:
  GLsync sync_ = nullptr;
};

/// Number of work-groups of `size` invocations that cover `count`.
inline std::size_t work_groups(std::size_t count, unsigned size) { return (count + size - 1) / size; }

/// GPU time between begin and end by pairs of timestamps, read back when ready (never waits unless asked).
class Timer {
 public:
  Timer() = default;
  Timer(Timer&&) noexcept = default;
  Timer& operator=(Timer&& other) noexcept {
    std::swap(free_, other.free_), std::swap(pending_, other.pending_);
    return *this;
  }
  ~Timer();
  void begin();
  void end();
  /// Milliseconds of the oldest finished span, if any; with `wait`, of the oldest span begun and ended.
  std::optional<double> poll(bool wait = false);

 private:
  struct Span {
    GLuint begin = 0, end = 0;
    bool ended = false;
  };
  std::vector<Span> free_;
  std::deque<Span> pending_;
};

}  // namespace tetpbd
