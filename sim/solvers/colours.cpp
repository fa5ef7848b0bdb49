#include "sim/solvers/colours.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace tetpbd {

Coloured coloured(const ConstraintList& list, std::size_t vertices) {
  const std::size_t arity = std::size_t(list.arity);
  const auto ends = [&](std::size_t c) { return std::span(list.vertices).subspan(c * arity, arity); };
  std::vector<std::size_t> order(list.count());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::ranges::min(ends(a)) < std::ranges::min(ends(b));
  });
  std::vector<std::vector<std::uint64_t>> taken(vertices);  // colours at a vertex, as bits
  std::vector<std::vector<std::size_t>> members;            // by colour
  for (const std::size_t c : order) {
    std::size_t word = 0;
    std::uint64_t bits = 0;
    for (;; ++word) {
      bits = 0;
      for (const std::uint32_t v : ends(c))
        if (word < taken[v].size()) bits |= taken[v][word];
      if (~bits) break;
    }
    const int bit = std::countr_one(bits);
    for (const std::uint32_t v : ends(c)) {
      if (taken[v].size() <= word) taken[v].resize(word + 1);
      taken[v][word] |= std::uint64_t(1) << bit;
    }
    const std::size_t colour = 64 * word + std::size_t(bit);
    if (members.size() <= colour) members.resize(colour + 1);
    members[colour].push_back(c);
  }
  Coloured result;
  result.list.arity = list.arity;
  for (const auto& of_colour : members) {
    result.first.push_back(result.list.count());
    for (const std::size_t c : of_colour) result.list.add(ends(c), list.rest[c]);
  }
  result.first.push_back(result.list.count());
  return result;
}

}  // namespace tetpbd
