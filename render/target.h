// GL objects of pictures; an image to draw to without a window, and its way back to the CPU.
#pragma once

#include <cstdint>
#include <deque>
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
struct Named : Owned<GLuint, delete_named<kind>> {
  Named() = default;
  /// A texture of another target.
  Named(const std::string& label, GLenum target) requires(kind == GL_TEXTURE) : Named::Owned(make(target)) {
    label_object(kind, this->id(), label);
  }
  explicit Named(const std::string& label) : Named::Owned(make()) { label_object(kind, this->id(), label); }
  static GLuint make(GLenum target = GL_TEXTURE_2D) {
    GLuint id = 0;
    if constexpr (kind == GL_VERTEX_ARRAY) glGenVertexArrays(1, &id), glBindVertexArray(id);
    if constexpr (kind == GL_TEXTURE) glGenTextures(1, &id), glBindTexture(target, id);
    if constexpr (kind == GL_RENDERBUFFER)
      glGenRenderbuffers(1, &id), glBindRenderbuffer(GL_RENDERBUFFER, id);
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

/// 8-bit sRGB with alpha, top row first.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};

/// Colour (sRGB8_ALPHA8) and depth (32F); with samples also the single-sample image they resolve to.
struct Target {
  int width = 0, height = 0, samples = 0;
  Renderbuffer colour, depth, resolved_colour;
  Framebuffer framebuffer, resolved;
};

/// Samples 0, 2, 4, 8, lowered to what the driver can do. Throws Error for sizes it cannot do.
Target make_target(int width, int height, int samples = 0);
/// Waits for the GPU.
Image read_rgba(const Target& target);
/// Copies the image to a corner of another framebuffer (0: the window) as it is; that needs no sRGB format.
void present(const Target& target, GLuint framebuffer, int x, int y);

/// Frames on their way to the CPU, in order. None of it waits until asked to.
class ReadBack {
 public:
  /// Starts copying the image, into a buffer more for each frame: poll(true) from a few frames on.
  void push(const Target& target);
  /// The oldest frame if it has arrived; with `wait`, once it has.
  std::optional<Image> poll(bool wait = false);
  std::size_t pending() const { return pending_.size(); }

 private:
  struct Slot {
    int width, height;
    Buffer pixels;
    Fence fence;
  };
  std::deque<Slot> pending_;
};

}  // namespace tetpbd
