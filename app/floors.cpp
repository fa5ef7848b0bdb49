#include "app/floors.h"

#include <algorithm>
#include <chrono>

#include "sim/gl/gpu.h"

namespace tetpbd {

Floors measure_floors(bool software) {
  const std::size_t bytes = std::size_t(software ? 16 : 512) << 20, invocations = bytes / 16 / 8;
  const Buffer from("probe, from", bytes), to("probe, to", bytes);
  from.clear();
  from.bind_storage(0);
  to.bind_storage(1);
  const auto seconds_each = [&](const char* copy, std::size_t groups, int times) {
    const Program program = Program::compute("probe.comp", {{{"COPY", copy}}, {}});
    program.use();
    const auto run = [&](int count) {
      for (int k = 0; k < count; ++k) {
        const std::size_t row = std::min<std::size_t>(groups, 32768);
        glDispatchCompute(unsigned(row), unsigned(groups / row), 1);
        glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
      }
      glFinish();
    };
    run(times);
    const auto begin = std::chrono::steady_clock::now();
    run(times);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / times;
  };
  return {seconds_each("0", 256, software ? 20 : 5000) * 1e6,
          2 * double(bytes) / seconds_each("1", invocations / 256, software ? 2 : 50) * 1e-9};
}

}  // namespace tetpbd
