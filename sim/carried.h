// The carried state: what a step leaves for the next. Each owner names its ranges of buffers and one plain struct;
// snapshots, checkpoints and the timeline copy what that list names and know of nothing else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sim/gl/gpu.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"

namespace tetpbd {

/// Bytes of a buffer, multiples of four.
struct CarriedRange {
  const Buffer* buffer;
  std::size_t first, bytes;
};

/// Of a GPU mode; a CPU mode carries its State.
struct Carried {
  std::vector<CarriedRange> ranges;                ///< positions and velocities first
  std::vector<std::span<std::byte>> values;        ///< of plain structs
  std::vector<std::pair<Fence*, bool>> readbacks;  ///< into buffers among the ranges; whether one is under way
  /// All of a buffer.
  void add(const Buffer& buffer) { ranges.push_back({&buffer, 0, buffer.bytes()}); }
  template <class Values>
  void add_values(Values& plain) {
    static_assert(std::is_trivially_copyable_v<Values>);
    values.push_back(std::as_writable_bytes(std::span(&plain, 1)));
  }
  void add_readback(Fence& fence) { readbacks.emplace_back(&fence, bool(fence)); }
};

/// A step and when it was; from there on each step takes dt.
struct TimeOrigin {
  long step = 0;
  double time = 0;  ///< s
};

/// The values that a Sim itself carries.
struct StepValues {
  long steps = 0;             ///< since the start
  TimeOrigin origin;          ///< ask simulated_time()
  double quantum = 1;         ///< m, of quantized positions
  bool needs_predict = true;  ///< the quantized positions are not those of the next step
  unsigned read_index = 0;    ///< which of `quantized` is read next
  unsigned rigid_side = 0;    ///< which side of hard bodies' records was written last
};

/// The first state that is not finite: its step, and the lowest of its vertices that are not.
struct NonFinite {
  long step = 0;
  std::uint32_t vertex = 0;
};

/// A copy of the carried state: steps after going back to it give the same bits. The ranges of buffers are copied to
/// a buffer that the owner of the snapshot keeps.
struct Snapshot {
  Settings settings;  ///< as the user gave them
  Plan plan;
  StepValues step;
  std::vector<std::byte> values{};  ///< those of Carried, one after the other
  std::vector<bool> readbacks{};    ///< whether each was under way
  std::optional<NonFinite> found{};
  std::optional<State> host{};  ///< of a CPU mode
  std::vector<char> broken{};   ///< attachments that had let go
  std::size_t at = 0;           ///< first byte in the buffer
};

}  // namespace tetpbd
