// Images to draw to without a window, and their readback.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

/// An image of 8-bit sRGB with alpha, top row first.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};

/// Colour (sRGB8_ALPHA8) and depth (32F), and with samples also the single-sample image to which they resolve.
struct Target {
  int width = 0, height = 0, samples = 0;
  Renderbuffer colour, depth, resolved_colour;
  Framebuffer framebuffer, resolved;
};

/// Makes a target with 0, 2, 4 or 8 samples, or fewer if the driver cannot. Throws Error for sizes it cannot make.
Target make_target(int width, int height, int samples = 0);
/// Reads the image. Waits for the GPU.
Image read_rgba(const Target& target);
/// Copies the image unchanged to a place in another framebuffer (0: the window), which needs no sRGB format.
void present(const Target& target, GLuint framebuffer, int x, int y);

/// A queue of images on their way to the CPU.
class ReadBack {
 public:
  /// Starts to copy the image into a buffer of its own. Callers bound the number of buffers by poll(true).
  void push(const Target& target);
  /// The oldest image if it has arrived; with `wait`, waits for it.
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
