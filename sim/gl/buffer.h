// Buffer objects of fixed size.
#pragma once

#include <vector>

#include "sim/gl/object.h"

namespace tetpbd {

/// Throws Error naming what did not fit if it does not, or the last GL call failed.
void check_memory(const std::string& what, std::size_t bytes, bool fits = true);
/// Forgets GL errors of earlier calls, so that check_memory judges the next alone.
void clear_errors();

inline void delete_buffer(GLuint id) { glDeleteBuffers(1, &id); }

class Buffer {
 public:
  Buffer() = default;
  Buffer(std::string label, std::size_t bytes, const void* data = nullptr, GLenum usage = GL_DYNAMIC_COPY);
  template <class T>
  Buffer(std::string label, const std::vector<T>& data, GLenum usage = GL_STATIC_DRAW)
      : Buffer(std::move(label), data.size() * sizeof(T), data.data(), usage) {}

  GLuint id() const { return object_.name(); }
  std::size_t bytes() const { return std::size_t(object_.bytes()); }
  const std::string& label() const { return label_; }
  explicit operator bool() const { return id() != 0; }

  void write(std::size_t offset, std::size_t bytes, const void* data) const;
  void read(std::size_t offset, std::size_t bytes, void* data) const;  ///< waits for the GPU
  void clear() const;                                                  ///< to zero bytes
  void bind_storage(int binding) const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, GLuint(binding), id()); }
  void bind_uniform(int binding) const { glBindBufferBase(GL_UNIFORM_BUFFER, GLuint(binding), id()); }

  template <class T>
  std::vector<T> read_all() const {
    std::vector<T> data(bytes() / sizeof(T));
    read(0, data.size() * sizeof(T), data.data());
    return data;
  }

 private:
  Owned<GLuint, delete_buffer> object_;
  std::string label_;
  /// GL_STREAM_DRAW: a write of all of it gets new memory, which nothing waits for.
  bool whole_at_once_ = false;
};

}  // namespace tetpbd
