#include "sim/solvers/colours.h"

#include <algorithm>
#include <numeric>

namespace tetpbd {

Coloured coloured(const ConstraintList& list, std::size_t vertices) {
  const std::size_t arity = std::size_t(list.arity);
  const auto ends = [&](std::size_t c) { return std::span(list.vertices).subspan(c * arity, arity); };
  std::vector<std::size_t> order(list.count());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](std::size_t c) { return std::ranges::min(ends(c)); });
  struct Colour {
    std::vector<bool> has;  // by vertex
    std::vector<std::size_t> members;
  };
  std::vector<Colour> colours;
  for (const std::size_t c : order) {
    const auto is_free = [&](const Colour& colour) {
      return std::ranges::none_of(ends(c), [&](std::uint32_t v) { return colour.has[v]; });
    };
    auto colour = std::ranges::find_if(colours, is_free);
    if (colour == colours.end()) colour = colours.insert(colour, {std::vector<bool>(vertices), {}});
    for (const std::uint32_t v : ends(c)) colour->has[v] = true;
    colour->members.push_back(c);
  }
  Coloured result;
  result.list.arity = list.arity;
  for (const Colour& colour : colours) {
    result.first.push_back(result.list.count());
    for (const std::size_t c : colour.members) result.list.add(ends(c), list.rest[c]);
  }
  result.first.push_back(result.list.count());
  return result;
}

}  // namespace tetpbd
