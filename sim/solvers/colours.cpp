#include "sim/solvers/colours.h"

#include <algorithm>
#include <numeric>

#include "sim/parallel.h"

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

VertexColours colour_vertices(const ConstraintSystem& system, std::size_t vertices) {
  std::vector<std::span<const std::uint32_t>> constraints;
  for (const ConstraintList& list : system.lists)
    for (std::size_t c = 0; c < list.count(); ++c) constraints.push_back(list.ends(c));
  const Grouped at_vertex = group_by_key(constraints.size(), vertices, [&](std::size_t c, auto&& emit) {
    for (const std::uint32_t v : constraints[c]) emit(v, std::uint32_t(c));
  });
  constexpr std::uint32_t none = ~0u;
  std::vector<std::uint32_t> colour_of(vertices, none);
  std::vector<std::uint32_t> taken_by;  // by colour, the last vertex that could not have it
  const auto each_neighbour = [&](std::uint32_t v, auto&& visit) {
    for (std::uint32_t k = at_vertex.first[v]; k < at_vertex.first[v + 1]; ++k)
      for (const std::uint32_t u : constraints[at_vertex.values[k]]) visit(u);
  };
  for (std::uint32_t v = 0; v < vertices; ++v) {
    each_neighbour(v, [&](std::uint32_t u) {
      if (colour_of[u] != none) taken_by[colour_of[u]] = v;
    });
    const auto free = std::ranges::find_if(taken_by, [&](std::uint32_t by) { return by != v; });
    colour_of[v] = std::uint32_t(free - taken_by.begin());
    if (free == taken_by.end()) taken_by.push_back(none);
  }
  const Grouped members = group_by_key(vertices, taken_by.size(),
                                       [&](std::size_t v, auto&& emit) { emit(colour_of[v], std::uint32_t(v)); });
  return {members.values, {members.first.begin(), members.first.end()}};
}

}  // namespace tetpbd
