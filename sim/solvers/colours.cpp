#include "sim/solvers/colours.h"

#include <algorithm>
#include <numeric>

namespace tetpbd {

Coloured coloured(const ConstraintList& list, std::size_t vertices) {
  std::vector<std::size_t> order(list.count());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](std::size_t c) { return std::ranges::min(list.ends(c)); });
  struct Colour {
    std::vector<bool> has;  // by vertex
    std::vector<std::size_t> members;
  };
  std::vector<Colour> colours;
  for (const std::size_t c : order) {
    const auto is_free = [&](const Colour& colour) {
      return std::ranges::none_of(list.ends(c), [&](std::uint32_t v) { return colour.has[v]; });
    };
    auto colour = std::ranges::find_if(colours, is_free);
    if (colour == colours.end()) colour = colours.insert(colour, {std::vector<bool>(vertices), {}});
    for (const std::uint32_t v : list.ends(c)) colour->has[v] = true;
    colour->members.push_back(c);
  }
  Coloured result;
  result.list.arity = list.arity;
  for (const Colour& colour : colours) {
    result.first.push_back(result.list.count());
    for (const std::size_t c : colour.members) result.list.add(list, c);
  }
  result.first.push_back(result.list.count());
  return result;
}

}  // namespace tetpbd
