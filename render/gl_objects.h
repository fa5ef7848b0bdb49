// Move-only GL names that have no size of their own (vertex arrays, textures, renderbuffers, framebuffers,
// samplers), and how values that the GPU wrote come back without waiting.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

enum class Named { vertex_array, texture, renderbuffer, framebuffer, sampler };

/// Made by `make`, which leaves the object bound (a name is an object only once it was bound, and only then
/// has a label).
template <Named kind>
class GlObject {
 public:
  GlObject() = default;
  static GlObject make(const std::string& label) {
    GlObject object;
    GLuint& id = object.id_;
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
    return object;
  }
  GlObject(GlObject&& other) noexcept { std::swap(id_, other.id_); }
  GlObject& operator=(GlObject&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~GlObject() {
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

using VertexArray = GlObject<Named::vertex_array>;
using Texture = GlObject<Named::texture>;
using Renderbuffer = GlObject<Named::renderbuffer>;
using Framebuffer = GlObject<Named::framebuffer>;
using Sampler = GlObject<Named::sampler>;

/// What a buffer held when the GPU came to `fence`, once: nothing before that (with `wait`, after waiting for
/// it) or without a fence. `what` is for the error.
template <class T>
std::optional<std::vector<T>> take(Fence& fence, const Buffer& buffer, const char* what, bool wait = false) {
  if (!fence.sync() || !reached(fence.sync(), wait, what)) return std::nullopt;
  fence = Fence();
  return buffer.read_all<T>();
}

}  // namespace tetpbd
