// Move-only GL names that have no size of their own, and how values that the GPU wrote come back without
// waiting.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

template <GLenum kind>
void delete_named(GLuint id) {
  if constexpr (kind == GL_VERTEX_ARRAY) glDeleteVertexArrays(1, &id);
  if constexpr (kind == GL_TEXTURE) glDeleteTextures(1, &id);
  if constexpr (kind == GL_RENDERBUFFER) glDeleteRenderbuffers(1, &id);
  if constexpr (kind == GL_FRAMEBUFFER) glDeleteFramebuffers(1, &id);
  if constexpr (kind == GL_SAMPLER) glDeleteSamplers(1, &id);
}

/// Left bound by its making: a name is an object only once it was bound, and only then has a label.
template <GLenum kind>
class Named {
 public:
  Named() = default;
  explicit Named(const std::string& label) {
    GLuint id = 0;
    if constexpr (kind == GL_VERTEX_ARRAY) glGenVertexArrays(1, &id), glBindVertexArray(id);
    if constexpr (kind == GL_TEXTURE) glGenTextures(1, &id), glBindTexture(GL_TEXTURE_2D, id);
    if constexpr (kind == GL_RENDERBUFFER)
      glGenRenderbuffers(1, &id), glBindRenderbuffer(GL_RENDERBUFFER, id);
    if constexpr (kind == GL_FRAMEBUFFER) glGenFramebuffers(1, &id), glBindFramebuffer(GL_FRAMEBUFFER, id);
    if constexpr (kind == GL_SAMPLER) glGenSamplers(1, &id), glBindSampler(0, id), glBindSampler(0, 0);
    label_object(kind, id, label);
    object_ = Owned<GLuint, delete_named<kind>>(id);
  }
  GLuint id() const { return object_.name(); }
  explicit operator bool() const { return id() != 0; }

 private:
  Owned<GLuint, delete_named<kind>> object_;
};

using VertexArray = Named<GL_VERTEX_ARRAY>;
using Texture = Named<GL_TEXTURE>;
using Renderbuffer = Named<GL_RENDERBUFFER>;
using Framebuffer = Named<GL_FRAMEBUFFER>;
using Sampler = Named<GL_SAMPLER>;

/// What a buffer held when the GPU came to `fence`, once: nothing before that (with `wait`, after waiting for
/// it) or without a fence. `what` is for the error.
template <class T>
std::optional<std::vector<T>> take(Fence& fence, const Buffer& buffer, const char* what, bool wait = false) {
  if (!fence.sync() || !reached(fence.sync(), wait, what)) return std::nullopt;
  fence = Fence();
  return buffer.read_all<T>();
}

}  // namespace tetpbd
