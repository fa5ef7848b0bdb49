// An OpenGL 4.3 core context without a display, through EGL; what a context offers; whether it is lost.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tetpbd {

/// What the current context offers, as far as the program needs to know beyond GL 4.3's guarantees.
struct Capabilities {
  std::string vendor, renderer, version, shading_language;
  int storage_blocks = 0;          ///< shader storage blocks a compute stage may use (8 guaranteed)
  std::int64_t storage_bytes = 0;  ///< largest storage block
  int work_group_invocations = 0;  ///< 1024 guaranteed
  int shared_bytes = 0;            ///< shared memory of a work-group
  int samples = 0;                 ///< largest MSAA sample count
  bool software = false;           ///< a CPU acts as the GPU (llvmpipe, softpipe, swrast)
};
Capabilities capabilities();
inline bool is_software_renderer() { return capabilities().software; }

/// Loads GL functions for the current context and checks for GL 4.3. Throws Error with the version found.
Capabilities load_gl();
using GlErrorReport = void (*)(const char* text);
/// Counts messages of type ERROR from now on and passes their text to `report`, if the current context is a debug
/// context.
void count_gl_errors(GlErrorReport report = nullptr);
/// Number of such messages since the start, in all contexts together.
int gl_error_count();

/// The most work-groups that a dispatch may have in its first dimension; 65535 guaranteed.
std::size_t most_work_groups_in_row();
/// Number of work-groups of `size` invocations that cover `count`.
inline std::size_t work_groups(std::size_t count, unsigned size) { return (count + size - 1) / size; }

/// Throws ContextLost if the GPU was reset. Cheap enough for once a frame, not for once a dispatch.
void check_context();

/// Names of the EGL devices, in the order of `--gpu N`.
std::vector<std::string> list_devices();

/// A context that is current for the calling thread until destroyed. It draws to framebuffer objects only.
class HeadlessContext {
 public:
  /// `device`: index of an EGL device, or -1 for the first that offers GL 4.3, GPUs before software. With `debug`, GL
  /// errors are counted.
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
