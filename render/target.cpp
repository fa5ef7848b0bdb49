#include "render/target.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "sim/error.h"

namespace tetpbd {

namespace {

Renderbuffer storage(const char* label, int width, int height, int samples, GLenum format) {
  Renderbuffer buffer = Renderbuffer::make(label);
  clear_errors();
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, width, height);
  check_memory(fmt::format("image '{}', {}x{} with {} samples,", label, width, height, samples),
               std::size_t(width) * std::size_t(height) * std::size_t(std::max(samples, 1)) * 4);
  return buffer;
}

void check_complete(int width, int height) {
  if (const GLenum status = glCheckFramebufferStatus(GL_FRAMEBUFFER); status != GL_FRAMEBUFFER_COMPLETE)
    throw Error("the driver cannot draw to an image",
                fmt::format("{}x{}, status {:#x}", width, height, status),
                "use a smaller image or fewer samples", 1);
}

// Rows come bottom first.
Image flipped(int width, int height, const std::uint8_t* rows) {
  Image image{width, height, std::vector<std::uint8_t>(std::size_t(width) * std::size_t(height) * 4)};
  const std::size_t row = std::size_t(width) * 4;
  for (std::size_t y = 0; y < std::size_t(height); ++y)
    std::memcpy(image.rgba.data() + y * row, rows + (std::size_t(height) - 1 - y) * row, row);
  return image;
}

}  // namespace

Target make_target(int width, int height, int samples) {
  GLint largest = 0, most = 0, viewport[2] = {0, 0};
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &largest);
  glGetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport);
  largest = std::min({largest, viewport[0], viewport[1]});
  glGetIntegerv(GL_MAX_SAMPLES, &most);
  if (width < 1 || height < 1 || width > largest || height > largest)
    throw Error("bad image size", fmt::format("{}x{}", width, height),
                fmt::format("use 1 to {} pixels a side", largest));
  Target target;
  target.width = width;
  target.height = height;
  samples = std::min(samples, int(most));
  target.samples = samples < 2 ? 0 : samples < 4 ? 2 : samples < 8 ? 4 : 8;
  target.colour = storage("target colour", width, height, target.samples, GL_SRGB8_ALPHA8);
  target.depth = storage("target depth", width, height, target.samples, GL_DEPTH_COMPONENT32F);
  target.framebuffer = Framebuffer::make("target");
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, target.colour.id());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, target.depth.id());
  check_complete(width, height);
  if (target.samples) {
    target.resolved_colour = storage("target resolved colour", width, height, 0, GL_SRGB8_ALPHA8);
    target.resolved = Framebuffer::make("target resolved");
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
                              target.resolved_colour.id());
    check_complete(width, height);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  return target;
}

GLuint resolve(const Target& target) {
  if (!target.samples) return target.framebuffer.id();
  glBindFramebuffer(GL_READ_FRAMEBUFFER, target.framebuffer.id());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target.resolved.id());
  glEnable(GL_FRAMEBUFFER_SRGB);  // samples are averaged as light, not as codes
  glBlitFramebuffer(0, 0, target.width, target.height, 0, 0, target.width, target.height, GL_COLOR_BUFFER_BIT,
                    GL_NEAREST);
  glDisable(GL_FRAMEBUFFER_SRGB);
  return target.resolved.id();
}

Image read_rgba(const Target& target) {
  ReadBack once;
  once.push(target);
  return *once.poll(true);
}

void present(const Target& target, GLuint framebuffer, int x, int y) {
  const GLuint source = resolve(target);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, source);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, framebuffer);
  glDisable(GL_SCISSOR_TEST);
  glBlitFramebuffer(0, 0, target.width, target.height, x, y, x + target.width, y + target.height,
                    GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
}

void ReadBack::push(const Target& target) {
  const std::size_t bytes = std::size_t(target.width) * std::size_t(target.height) * 4;
  Slot slot;
  if (!free_.empty()) slot = std::move(free_.back()), free_.pop_back();
  if (slot.pixels.bytes() != bytes) slot.pixels = Buffer("frame read-back", bytes, nullptr, GL_STREAM_READ);
  slot.width = target.width;
  slot.height = target.height;
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolve(target));
  glPixelStorei(GL_PACK_ALIGNMENT, 4);
  glBindBuffer(GL_PIXEL_PACK_BUFFER, slot.pixels.id());
  glReadPixels(0, 0, target.width, target.height, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  slot.fence = Fence::here();
  glFlush();  // else the fence may never be reached while nobody waits
  pending_.push_back(std::move(slot));
}

std::optional<Image> ReadBack::poll(bool wait) {
  if (pending_.empty()) return std::nullopt;
  Slot& slot = pending_.front();
  if (!reached(slot.fence.sync(), wait, "reading a frame back")) return std::nullopt;
  const Image image = flipped(slot.width, slot.height, slot.pixels.read_all<std::uint8_t>().data());
  free_.push_back(std::move(slot));
  pending_.pop_front();
  return image;
}

}  // namespace tetpbd
