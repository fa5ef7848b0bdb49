// An OpenGL 4.3 core context without a display, through EGL; what a context offers; whether it is lost.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tetpbd {

/// What the current context offers: all that the program asks a driver beyond GL 4.3's guarantees.
struct Capabilities {
  std::string vendor, renderer, version, shading_language;
  int storage_blocks = 0;          ///< shader storage blocks a compute stage may use (8 guaranteed)
  std::int64_t storage_bytes = 0;  ///< largest storage block
  int work_group_invocations = 0;  ///< 1024 guaranteed
  int shared_bytes = 0;            ///< shared memory of a work-group
  int samples = 0;                 ///< largest MSAA sample count
  bool software = false;           ///< a CPU pretends to be a GPU (llvmpipe, softpipe, swrast)
};
Capabilities capabilities();
inline bool is_software_renderer() { return capabilities().software; }

/// Loads GL functions for the current context and checks for GL 4.3. Throws Error with the version found.
Capabilities load_gl();
using GlErrorReport = void (*)(const char* text);
/// Puts a debug callback into the current context if it is a debug context: messages of type ERROR are
/// counted from now on, and their text goes to `report`, if there is one.
void count_gl_errors(GlErrorReport report = nullptr);
/// Number of messages since the start, of all contexts that are counted.
int gl_error_count();

/// That a dispatch may have in its first dimension; 65535 guaranteed.
std::size_t most_work_groups_in_row();
/// Number of work-groups of `size` invocations that cover `count`.
inline std::size_t work_groups(std::size_t count, unsigned size) { return (count + size - 1) / size; }

/// Throws ContextLost if the GPU was reset. Cheap, but not free: once a frame, not once a dispatch.
void check_context();

/// Names of the EGL devices, in the order of `--gpu N`.
std::vector<std::string> list_devices();

/// Makes a context current for the calling thread until destroyed. It draws to framebuffer objects only.
class HeadlessContext {
 public:
  /// `device`: index of an EGL device, or -1 for the first that gives GL 4.3, GPUs before software. With
  /// `debug`, GL errors are counted.
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
