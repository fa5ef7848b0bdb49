#include "render/target.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "sim/error.h"

namespace tetpbd {

namespace {

std::size_t image_bytes(int width, int height) { return std::size_t(width) * std::size_t(height) * 4; }

Renderbuffer make_storage(const char* label, const Target& target, int samples, GLenum format) {
  Renderbuffer buffer(label);
  clear_errors();
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, format, target.width, target.height);
  check_memory(fmt::format("image '{}', {}x{} with {} samples,", label, target.width, target.height, samples),
               image_bytes(target.width, target.height) * std::size_t(std::max(samples, 1)));
  return buffer;
}

Framebuffer make_framebuffer(const char* label, const Target& target, const Renderbuffer& colour,
                             const Renderbuffer& depth) {
  Framebuffer framebuffer(label);
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour.id());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth.id());
  if (const GLenum status = glCheckFramebufferStatus(GL_FRAMEBUFFER); status != GL_FRAMEBUFFER_COMPLETE)
    throw Error("the driver cannot draw to an image",
                fmt::format("{}x{}, status {:#x}", target.width, target.height, status),
                "use a smaller image or fewer samples", 1);
  return framebuffer;
}

// Resolves samples, if there are any, and returns the framebuffer to read from.
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
  target.width = width, target.height = height;
  samples = std::min({samples, int(most), 8});
  target.samples = samples < 2 ? 0 : int(std::bit_floor(unsigned(samples)));
  target.colour = make_storage("target colour", target, target.samples, GL_SRGB8_ALPHA8);
  target.depth = make_storage("target depth", target, target.samples, GL_DEPTH_COMPONENT32F);
  target.framebuffer = make_framebuffer("target", target, target.colour, target.depth);
  if (target.samples) {
    target.resolved_colour = make_storage("target resolved colour", target, 0, GL_SRGB8_ALPHA8);
    target.resolved = make_framebuffer("target resolved", target, target.resolved_colour, {});
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  return target;
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
  glBlitFramebuffer(0, 0, target.width, target.height, x, y, x + target.width, y + target.height, GL_COLOR_BUFFER_BIT,
                    GL_NEAREST);
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
}

void ReadBack::push(const Target& target) {
  Buffer pixels("frame read-back", image_bytes(target.width, target.height), nullptr, GL_STREAM_READ);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolve(target));
  glBindBuffer(GL_PIXEL_PACK_BUFFER, pixels.id());
  glReadPixels(0, 0, target.width, target.height, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  pending_.push_back({target.width, target.height, std::move(pixels), Fence::here()});
}

std::optional<Image> ReadBack::poll(bool wait) {
  if (pending_.empty()) return std::nullopt;
  auto& [width, height, pixels, fence] = pending_.front();
  auto rows = poll_readback<std::uint8_t>(fence, pixels, "reading a frame back", wait);
  if (!rows) return std::nullopt;
  Image image{width, height, std::move(*rows)};
  const auto row = [&](int y) { return image.rgba.begin() + std::ptrdiff_t(image_bytes(image.width, y)); };
  for (int y = 0; y < image.height / 2; ++y)  // GL gives the bottom row first
    std::swap_ranges(row(y), row(y + 1), row(image.height - 1 - y));
  pending_.pop_front();
  return image;
}

}  // namespace tetpbd
