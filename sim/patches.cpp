#include "sim/patches.h"

#include <algorithm>
#include <bit>
#include <span>

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

using Record = std::array<std::uint32_t, 2>;

// Consecutive threads take constraints far apart, which seldom meet at a vertex: their additions to its sum
// would wait for each other.
void spread(std::vector<Record>& records) {
  const std::vector<Record> near = std::move(records);
  records.clear();
  const std::size_t stride = (near.size() + 31) / 32;
  for (std::size_t start = 0; start < stride; ++start)
    for (std::size_t r = start; r < near.size(); r += stride) records.push_back(near[r]);
}

// One part of a patch after the other, at the end of `patches`.
class PartWriter {
 public:
  PartWriter(const ConstraintSystem& system, Patches& patches)
      : system_(system),
        patches_(patches),
        local_(system.at_vertex.size(), none),
        records_(system.lists.size()) {
    patches.part_words = 4 + 2 * std::size_t(std::count(system.present.begin(), system.present.end(), true));
  }
  std::size_t vertices() const { return gathered_.size() - first_; }
  /// The vertex's number in the part, which has it from now on.
  std::uint32_t vertex(std::uint32_t v) {
    if (local_[v] == none) {
      local_[v] = std::uint32_t(vertices());
      gathered_.push_back({v, std::bit_cast<std::uint32_t>(float(system_.at_vertex[v]))});
    }
    return local_[v];
  }
  /// False, and nothing done, if it has more vertices than fit.
  bool add(std::size_t kind, std::uint32_t constraint) {
    const ConstraintList& list = system_.lists[kind];
    const std::size_t arity = std::size_t(list.arity);
    const std::span of(list.vertices.data() + std::size_t(constraint) * arity, arity);
    const auto added =
        std::count_if(of.begin(), of.end(), [&](std::uint32_t v) { return local_[v] == none; });
    if (vertices() + std::size_t(added) > Patches::most_vertices) return false;
    std::array<std::uint32_t, 2> record = {0, std::bit_cast<std::uint32_t>(float(list.rest[constraint]))};
    for (std::size_t j = 0; j < arity; ++j) record[0] |= vertex(of[j]) << (8 * j);
    records_[kind].push_back(record);
    return true;
  }
  /// Writes the part's words; `summed`: how many of its first vertices are.
  void close(std::size_t part, std::size_t summed) {
    patches_.parts.resize(std::max(patches_.parts.size(), (part + 1) * patches_.part_words));
    firsts_.resize(patches_.parts.size() / patches_.part_words);
    firsts_[part] = first_;
    std::uint32_t* words = patches_.parts.data() + part * patches_.part_words;
    words[0] = std::uint32_t(vertices());
    words[1] = std::uint32_t(summed);
    words[2] = summed ? gathered_[first_][0] : 0;
    words[3] = 0;
    words += 4;
    for (std::size_t k = 0; k < records_.size(); ++k) {
      if (!system_.present[k]) continue;
      *words++ = std::uint32_t(patches_.records.size());
      *words++ = std::uint32_t(records_[k].size());
      spread(records_[k]);
      patches_.records.insert(patches_.records.end(), records_[k].begin(), records_[k].end());
      records_[k].clear();
    }
    patches_.largest = std::max(patches_.largest, vertices());
    patches_.most_summed = std::max(patches_.most_summed, summed);
    for (std::size_t v = first_; v < gathered_.size(); ++v) local_[gathered_[v][0]] = none;
    first_ = gathered_.size();
  }
  /// When all parts are closed: gives each the same room for its vertices, the rest of it copies of the
  /// first.
  void finish() {
    patches_.vertices.resize(firsts_.size() * patches_.largest);
    for (std::size_t part = 0; part < firsts_.size(); ++part) {
      const std::size_t count = patches_.parts[part * patches_.part_words];
      for (std::size_t v = 0; v < patches_.largest; ++v)
        patches_.vertices[part * patches_.largest + v] = gathered_[firsts_[part] + (v < count ? v : 0)];
    }
  }

 private:
  static constexpr std::uint32_t none = ~0u;
  const ConstraintSystem& system_;
  Patches& patches_;
  std::vector<std::uint32_t> local_;                    // of a vertex, its number in the part being written
  std::vector<std::vector<Record>> records_;            // by kind
  std::vector<std::array<std::uint32_t, 2>> gathered_;  // vertices of parts, as they were closed
  std::vector<std::size_t> firsts_;                     // of each part among them
  std::size_t first_ = 0;                               // of the part being written
};

// The constraints of one kind on each vertex.
struct Incidence {
  std::vector<std::uint32_t> first, constraints;
  Incidence(const ConstraintList& list, std::size_t vertices)
      : first(vertices + 1), constraints(list.vertices.size()) {
    for (std::uint32_t v : list.vertices) ++first[v + 1];
    for (std::size_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    for (std::size_t at = 0; at < list.vertices.size(); ++at)
      constraints[next[list.vertices[at]]++] = std::uint32_t(at / std::size_t(list.arity));
  }
};

// Where patches of at most `own` consecutive vertices begin, and the end: fewer vertices where these and the
// ones that share a constraint with them would not fit a part.
std::vector<std::size_t> starts_of_patches(const ConstraintSystem& system,
                                           const std::vector<Incidence>& incidence, std::size_t own) {
  const std::size_t vertices = system.at_vertex.size();
  std::vector<std::size_t> starts;
  std::vector<std::uint32_t> last(vertices);  // patch that had the vertex last, from 1 on
  std::vector<std::uint32_t> added;
  std::size_t held = 0;
  const auto add = [&](std::size_t v) {
    const auto hold = [&](std::size_t u) {
      if (last[u] != starts.size()) last[u] = std::uint32_t(starts.size()), added.push_back(std::uint32_t(u));
    };
    added.clear();
    hold(v);
    for (std::size_t k = 0; k < system.lists.size(); ++k) {
      const ConstraintList& list = system.lists[k];
      const std::size_t arity = std::size_t(list.arity);
      for (std::size_t at = incidence[k].first[v]; at < incidence[k].first[v + 1]; ++at)
        for (std::size_t j = 0; j < arity; ++j) hold(list.vertices[incidence[k].constraints[at] * arity + j]);
    }
    held += added.size();
  };
  for (std::size_t v = 0; v < vertices; ++v) {
    if (!starts.empty() && v - starts.back() < own) add(v);
    if (starts.empty() || v - starts.back() == own || held > Patches::most_vertices) {
      starts.push_back(v);
      held = 0;
      add(v);
    }
  }
  starts.push_back(vertices);
  return starts;
}

}  // namespace

Patches constraint_patches(const Model& model, const ConstraintSystem& system, std::size_t most) {
  Patches patches;
  PartWriter writer(system, patches);
  std::size_t filled = 0;
  const auto close = [&] {
    writer.close(patches.count++, writer.vertices());
    filled = 0;
  };
  for (const Item& item : ordered(model, system)) {
    if (filled == most || !writer.add(item.kind, item.constraint)) {
      close();
      writer.add(item.kind, item.constraint);
    }
    ++filled;
  }
  if (filled > 0) close();
  writer.finish();
  return patches;
}

Patches vertex_patches(const ConstraintSystem& system, std::size_t own, int groups,
                       const std::vector<std::vector<std::uint8_t>>& members) {
  const std::size_t vertices = system.at_vertex.size();
  Patches patches;
  PartWriter writer(system, patches);
  std::vector<Incidence> incidence;
  for (const ConstraintList& list : system.lists) incidence.emplace_back(list, vertices);
  const std::vector<std::size_t> starts = starts_of_patches(system, incidence, own);
  patches.count = starts.size() - 1;
  patches.parts.resize(patches.count * std::size_t(groups) * patches.part_words);
  std::vector<std::uint32_t> found;
  for (std::size_t g = 0; g < std::size_t(groups); ++g)
    for (std::size_t p = 0; p < patches.count; ++p) {
      const std::size_t first = starts[p], end = starts[p + 1];
      std::size_t part = g * patches.count + p;
      const auto begin_part = [&] {
        for (std::size_t v = first; v < end; ++v) writer.vertex(std::uint32_t(v));
      };
      begin_part();
      for (std::size_t k = 0; k < system.lists.size(); ++k) {
        found.assign(incidence[k].constraints.begin() + incidence[k].first[first],
                     incidence[k].constraints.begin() + incidence[k].first[end]);
        std::sort(found.begin(), found.end());
        found.erase(std::unique(found.begin(), found.end()), found.end());
        for (std::uint32_t c : found) {
          if (!members.empty() && members[k][c] != g) continue;
          if (writer.add(k, c)) continue;
          const std::size_t next = patches.parts.size() / patches.part_words;
          writer.close(part, end - first);
          patches.parts[part * patches.part_words + 3] = std::uint32_t(next);
          patches.parts.resize(patches.parts.size() + patches.part_words);
          patches.parted = true;
          part = next;
          begin_part();
          writer.add(k, c);
        }
      }
      writer.close(part, end - first);
    }
  writer.finish();
  if (!members.empty()) {  // count those of the group alone
    std::vector<std::uint32_t> here(vertices * std::size_t(groups));
    for (std::size_t k = 0; k < system.lists.size(); ++k)
      for (std::size_t at = 0; at < system.lists[k].vertices.size(); ++at)
        ++here[members[k][at / std::size_t(system.lists[k].arity)] * vertices + system.lists[k].vertices[at]];
    for (std::size_t g = 0; g < std::size_t(groups); ++g)
      for (std::size_t p = 0; p < patches.count; ++p)
        for (std::size_t part = g * patches.count + p;;) {
          const std::uint32_t* words = patches.parts.data() + part * patches.part_words;
          for (std::size_t v = part * patches.largest; v < (part + 1) * patches.largest; ++v)
            patches.vertices[v][1] =
                std::bit_cast<std::uint32_t>(float(here[g * vertices + patches.vertices[v][0]]));
          part = words[3];
          if (part == 0) break;
        }
  }
  return patches;
}

}  // namespace tetpbd
