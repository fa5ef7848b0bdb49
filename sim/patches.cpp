#include "sim/patches.h"

#include <algorithm>
#include <bit>

#include "sim/hilbert.h"

namespace tetpbd {

namespace {

struct Item {
  std::uint64_t key;
  std::uint32_t kind, constraint;
};

// Along a Hilbert curve through the rest shape, by the middle of each constraint.
std::vector<Item> ordered(const Model& model, const ConstraintSystem& system) {
  const Bounds box = bounds(model.rest.positions);
  std::vector<Item> items;
  items.reserve(system.count());
  for (std::uint32_t k = 0; k < system.lists.size(); ++k) {
    const ConstraintList& list = system.lists[k];
    if (!system.present[k]) continue;
    for (std::uint32_t c = 0; c < list.count(); ++c) {
      glm::dvec3 middle(0);
      for (int j = 0; j < list.arity; ++j)
        middle +=
            model.rest.positions[list.vertices[std::size_t(c) * std::size_t(list.arity) + std::size_t(j)]];
      items.push_back({hilbert_key(middle / double(list.arity), box), k, c});
    }
  }
  std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) {
    return std::tie(a.key, a.kind, a.constraint) < std::tie(b.key, b.kind, b.constraint);
  });
  return items;
}

}  // namespace

Patches make_patches(const Model& model, const ConstraintSystem& system, std::size_t most) {
  Patches patches;
  const std::vector<Item> items = ordered(model, system);
  constexpr std::uint32_t none = ~0u;
  std::vector<std::uint32_t> slot(model.rest.positions.size(),
                                  none);  // of a vertex in the patch being filled
  std::vector<std::vector<std::array<std::uint32_t, 2>>> kinds(system.lists.size());
  std::size_t first_vertex = 0, filled = 0;
  const auto close = [&] {
    patches.rows.push_back(std::uint32_t(first_vertex));
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      if (!system.present[k]) continue;
      patches.rows.push_back(std::uint32_t(patches.records.size()));
      // Consecutive threads take constraints far apart, which seldom meet at a vertex: their additions to its
      // sum would wait for each other.
      const std::size_t n = kinds[k].size(), stride = (n + 31) / 32;
      for (std::size_t start = 0; start < stride; ++start)
        for (std::size_t r = start; r < n; r += stride) patches.records.push_back(kinds[k][r]);
      kinds[k].clear();
    }
    patches.rows.push_back(std::uint32_t(patches.records.size()));
    for (std::size_t v = first_vertex; v < patches.vertices.size(); ++v) slot[patches.vertices[v][0]] = none;
    first_vertex = patches.vertices.size();
    filled = 0;
    ++patches.count;
  };
  for (const Item& item : items) {
    const ConstraintList& list = system.lists[item.kind];
    const std::size_t arity = std::size_t(list.arity);
    const std::uint32_t* vertices = list.vertices.data() + std::size_t(item.constraint) * arity;
    std::size_t added = 0;
    for (std::size_t j = 0; j < arity; ++j) added += slot[vertices[j]] == none;
    if (filled == most || patches.vertices.size() - first_vertex + added > Patches::most_vertices) close();
    std::array<std::uint32_t, 2> record = {0,
                                           std::bit_cast<std::uint32_t>(float(list.rest[item.constraint]))};
    for (std::size_t j = 0; j < arity; ++j) {
      std::uint32_t& place = slot[vertices[j]];
      if (place == none) {
        place = std::uint32_t(patches.vertices.size() - first_vertex);
        patches.vertices.push_back(
            {vertices[j], std::bit_cast<std::uint32_t>(float(system.at_vertex[vertices[j]]))});
      }
      record[0] |= place << (8 * j);
    }
    kinds[item.kind].push_back(record);
    ++filled;
  }
  if (filled > 0) close();
  patches.rows.push_back(std::uint32_t(patches.vertices.size()));
  return patches;
}

}  // namespace tetpbd
