// An OpenGL 4.3 core context without a window or a display server, through EGL.
#pragma once

#include <string>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

/// Names of the EGL devices, in the order of `--gpu N`.
std::vector<std::string> list_devices();

/// Makes a context current for the calling thread until destroyed. It draws to framebuffer objects only.
class HeadlessContext {
 public:
  /// `device`: index of an EGL device, or -1 for the first that gives GL 4.3 (a GPU before a software
  /// renderer).
  explicit HeadlessContext(int device = -1, bool debug = false);
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;
  const Capabilities& capabilities() const { return capabilities_; }

 private:
  void* display_ = nullptr;
  void* context_ = nullptr;
  Capabilities capabilities_;
};

}  // namespace tetpbd
