// Where the members of a storage block lie (std430), for blocks whose arrays have sizes that are known when their
// kernels are compiled. Members are added in the order of the block's declaration in GLSL; a test asks GL.
#pragma once

#include <algorithm>
#include <cstring>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "sim/gl/gpu.h"

namespace tetpbd {

/// Bytes. A struct has the alignment of its largest member, so structs with vectors specialise this.
template <class T>
inline constexpr std::size_t std430_alignment = 4;
template <glm::length_t N, class T>
inline constexpr std::size_t std430_alignment<glm::vec<N, T>> = N == 3 ? 16 : 4 * std::size_t(N);

/// `count` elements from byte `at` of a buffer.
template <class T>
struct Range {
  std::size_t at = 0, count = 0;
  std::size_t bytes() const { return count * sizeof(T); }
};

struct BufferLayout {
  struct Member {
    std::string name;
    std::size_t at, bytes;
  };
  std::vector<Member> members;
  std::size_t bytes = 0;  ///< a multiple of 16, the largest alignment
  /// Adds the next member: an array of `count`, or a single value.
  template <class T>
  Range<T> add(const std::string& name, std::size_t count = 1) {
    constexpr std::size_t alignment = std430_alignment<T>;
    static_assert(sizeof(T) % alignment == 0);
    const std::size_t end = members.empty() ? 0 : members.back().at + members.back().bytes;
    const std::size_t at = (end + alignment - 1) / alignment * alignment;
    members.push_back({name, at, std::max<std::size_t>(count, 1) * sizeof(T)});  // GLSL has no empty arrays
    bytes = (at + members.back().bytes + 15) / 16 * 16;
    return {at, count};
  }
};

/// Write `values` to a range of a buffer's contents or of a buffer; `get` reads a range of contents.
template <class T, class Value>
void put(std::span<std::byte> contents, Range<T> range, const std::vector<Value>& values) {
  if (!values.empty()) std::memcpy(&contents[range.at], values.data(), values.size() * sizeof(Value));
}
template <class T>
std::vector<T> get(std::span<const std::byte> contents, Range<T> range) {
  std::vector<T> values(range.count);
  if (!values.empty()) std::memcpy(values.data(), &contents[range.at], range.bytes());
  return values;
}
template <class T, class Value>
void write(const Buffer& buffer, Range<T> range, const std::vector<Value>& values) {
  if (!values.empty()) buffer.write(range.at, values.size() * sizeof(Value), values.data());
}
inline std::vector<float> to_floats(const std::vector<double>& values) { return {values.begin(), values.end()}; }

}  // namespace tetpbd
