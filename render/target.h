// GL objects of pictures; an image to draw to without a window, and its way back to the CPU.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

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
