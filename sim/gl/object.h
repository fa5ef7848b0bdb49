// A GL object that is deleted with its owner.
#pragma once

#include <GL/glew.h>

#include <cstdint>
#include <string>
#include <utility>

namespace tetpbd {

/// What the program holds of GL right now, over all contexts: whatever is Owned, and what render/ makes.
/// Textures' and renderbuffers' bytes are not counted.
struct GlLive {
  long objects = 0;
  std::int64_t buffer_bytes = 0;
};
GlLive gl_live();
void count_gl_objects(long change, std::int64_t buffer_bytes = 0);

inline void label_object(GLenum kind, GLuint id, const std::string& label) {
  glObjectLabel(kind, id, GLsizei(label.size()), label.data());
}

/// `Name`: GLuint or GLsync; 0 is none.
template <class Name, void (*destroy)(Name)>
class Owned {
 public:
  Owned() = default;
  explicit Owned(Name name, std::int64_t bytes = 0) : name_(name), bytes_(bytes) {
    count_gl_objects(1, bytes);
  }
  Owned(Owned&& other) noexcept { swap(other); }
  Owned& operator=(Owned&& other) noexcept { return swap(other), *this; }
  ~Owned() {
    if (name_) destroy(name_), count_gl_objects(-1, -bytes_);
  }
  Name name() const { return name_; }
  std::int64_t bytes() const { return bytes_; }

 private:
  void swap(Owned& other) { std::swap(name_, other.name_), std::swap(bytes_, other.bytes_); }
  Name name_{};
  std::int64_t bytes_ = 0;
};

}  // namespace tetpbd
