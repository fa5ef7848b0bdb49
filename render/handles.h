// Move-only GL names that have no size of their own: vertex arrays, textures, renderbuffers, framebuffers,
// samplers.
#pragma once

#include <string>
#include <utility>

#include "sim/gl/gpu.h"

namespace tetpbd {

enum class Named { vertex_array, texture, renderbuffer, framebuffer, sampler };

/// Made by `make`, which leaves the object bound (a name is an object only once it was bound, and only then
/// has a label).
template <Named kind>
class Handle {
 public:
  Handle() = default;
  static Handle make(const std::string& label) {
    Handle handle;
    GLuint& id = handle.id_;
    GLenum space = GL_TEXTURE;
    if constexpr (kind == Named::vertex_array)
      glGenVertexArrays(1, &id), glBindVertexArray(id), space = GL_VERTEX_ARRAY;
    if constexpr (kind == Named::texture) glGenTextures(1, &id), glBindTexture(GL_TEXTURE_2D, id);
    if constexpr (kind == Named::renderbuffer)
      glGenRenderbuffers(1, &id), glBindRenderbuffer(GL_RENDERBUFFER, id), space = GL_RENDERBUFFER;
    if constexpr (kind == Named::framebuffer)
      glGenFramebuffers(1, &id), glBindFramebuffer(GL_FRAMEBUFFER, id), space = GL_FRAMEBUFFER;
    if constexpr (kind == Named::sampler)
      glGenSamplers(1, &id), glBindSampler(0, id), glBindSampler(0, 0), space = GL_SAMPLER;
    glObjectLabel(space, id, GLsizei(label.size()), label.data());
    count_gl_objects(1);
    return handle;
  }
  Handle(Handle&& other) noexcept { std::swap(id_, other.id_); }
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~Handle() {
    if (!id_) return;
    count_gl_objects(-1);
    if constexpr (kind == Named::vertex_array) glDeleteVertexArrays(1, &id_);
    if constexpr (kind == Named::texture) glDeleteTextures(1, &id_);
    if constexpr (kind == Named::renderbuffer) glDeleteRenderbuffers(1, &id_);
    if constexpr (kind == Named::framebuffer) glDeleteFramebuffers(1, &id_);
    if constexpr (kind == Named::sampler) glDeleteSamplers(1, &id_);
  }
  GLuint id() const { return id_; }
  explicit operator bool() const { return id_ != 0; }

 private:
  GLuint id_ = 0;
};

using VertexArray = Handle<Named::vertex_array>;
using Texture = Handle<Named::texture>;
using Renderbuffer = Handle<Named::renderbuffer>;
using Framebuffer = Handle<Named::framebuffer>;
using Sampler = Handle<Named::sampler>;

}  // namespace tetpbd
