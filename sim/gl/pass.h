// Dispatches of kernels. A Pass is a kernel and the number of its work-groups; the Recorder alone binds buffers,
// dispatches, sets barriers and times. A buffer is known by the name that its block has in GLSL.
#pragma once

#include <initializer_list>
#include <string>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

struct Pass {
  Program program;
  std::size_t work_groups = 0;  ///< 0: those of `grid`, or if it has none, the recorder's `counts` at byte `counts_at`
  std::size_t bytes = 0;        ///< read and written by all invocations together; caches may serve part of it
  std::string name{};           ///< of a variant; empty: the program's label
  std::size_t counts_at = 0;
  glm::uvec3 grid{0};                 ///< work-groups by dimension
  GLuint records = 0;                 ///< the kernel's own buffer for block Records, if it has one
  std::vector<std::size_t> places{};  ///< of its blocks in the table of `recorder`, once they were looked up
  const void* recorder = nullptr;

  const std::string& label() const { return name.empty() ? program.label() : name; }
  explicit operator bool() const { return bool(program); }
};

/// A uniform of one dispatch.
struct DispatchParameter {
  const char* name;
  unsigned value;
};

/// Dispatches with the same name, while they are counted.
struct DispatchCount {
  std::string name;
  std::size_t work_groups = 0, bytes = 0;  ///< of each
  long dispatches = 0;
  Timer timer{};
};

/// Throws Error where a buffer is larger than a block may be.
void check_block(const std::string& label, std::size_t bytes, std::size_t most);

class Recorder {
 public:
  /// Kernels find the buffer, or `bytes` of it from `first` on, under this name until another is given.
  void give(const std::string& block, GLuint buffer, std::size_t first = 0, std::size_t bytes = 0);
  /// Throws Error where the buffer is larger than a block may be.
  void give(const std::string& block, const Buffer& buffer);
  /// For what reads the buffers after kernels or wrote them before.
  void barrier(GLbitfield bits) { glMemoryBarrier(bits); }
  /// To be called first whenever others may have bound buffers or programs.
  void begin() { program_ = 0, bound_.clear(); }
  /// Puts a program in use, whose uniforms can then be set.
  const Program& use(const Program& program);
  /// Binds the buffers of the kernel's blocks, dispatches, and sets a storage barrier, so that the next dispatch may
  /// read what this one writes and overwrite what it reads. `what` and `bytes` are added to the pass's name and bytes
  /// where dispatches are counted. Throws Error for a block that no buffer was given for.
  void run(Pass& pass, std::initializer_list<DispatchParameter> parameters = {}, const char* what = "",
           std::size_t bytes = 0);

  std::size_t row = 0;      ///< most work-groups in a dispatch's first dimension; 0: what the driver allows
  std::size_t storage = 0;  ///< most bytes of a block; 0: likewise
  GLuint counts = 0;        ///< buffer of numbers of work-groups that kernels write
  bool counting = false, timing = false;
  std::vector<DispatchCount> counted;  ///< while `counting`, in the order in which names came first

 private:
  struct Range {
    GLuint buffer = 0;
    std::size_t first = 0, bytes = 0;
    bool operator==(const Range&) const = default;
  };
  std::size_t place(const std::string& block);
  DispatchCount& count(const Pass& pass, const char* what, std::size_t bytes);
  GLuint program_ = 0;
  std::vector<std::string> names_;  // the table: a range by name
  std::vector<Range> ranges_;
  std::vector<Range> bound_;  // by binding point
};

}  // namespace tetpbd
