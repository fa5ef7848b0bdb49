#include "sim/solvers/patches.h"

#include <algorithm>
#include <bit>
#include <span>

#include "sim/hilbert.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

struct Item {
  std::uint64_t key;
  std::uint32_t kind, constraint;
  auto operator<=>(const Item&) const = default;
};

// Along a Hilbert curve through the rest shape, by the middle of each constraint.
std::vector<Item> ordered(const Model& model, const ConstraintSystem& system) {
  const Bounds box = bounds(model.rest.positions);
  std::vector<Item> items;
  for (std::uint32_t k = 0; k < system.lists.size(); ++k) {
    const ConstraintList& list = system.lists[k];
    if (!system.present[k]) continue;
    const std::size_t start = items.size(), arity = std::size_t(list.arity);
    items.resize(start + list.count());
    parallel_for(list.count(), [&](std::size_t first, std::size_t end) {
      for (std::size_t c = first; c < end; ++c) {
        glm::dvec3 middle(0);
        for (std::size_t j = 0; j < arity; ++j) middle += model.rest.positions[list.vertices[c * arity + j]];
        items[start + c] = {hilbert_key(middle / double(arity), box), k, std::uint32_t(c)};
      }
    });
  }
  parallel_sort(std::span(items));
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

// One part of a patch after the other.
class PartWriter {
 public:
  /// With room for `parts` parts; those that add_part() gives come behind them.
  explicit PartWriter(const ConstraintSystem& system, std::size_t parts = 0)
      : system_(system),
        part_words_(4 + 2 * std::size_t(std::count(system.present.begin(), system.present.end(), true))),
        local_(system.at_vertex.size(), none),
        records_of_(system.lists.size()),
        parts_(parts * part_words_),
        firsts_(parts) {}
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
    records_of_[kind].push_back(record);
    return true;
  }
  std::size_t add_part() {
    parts_.resize(parts_.size() + part_words_);
    firsts_.push_back(0);
    return firsts_.size() - 1;
  }
  /// Writes the part's words; `summed`: how many of its first vertices are.
  void close(std::size_t part, std::size_t summed) {
    firsts_[part] = first_;
    std::uint32_t* words = parts_.data() + part * part_words_;
    words[0] = std::uint32_t(vertices());
    words[1] = std::uint32_t(summed);
    words[2] = summed ? gathered_[first_][0] : 0;
    words[3] = 0;
    words += 4;
    for (std::size_t k = 0; k < records_of_.size(); ++k) {
      if (!system_.present[k]) continue;
      *words++ = std::uint32_t(records_.size());
      *words++ = std::uint32_t(records_of_[k].size());
      spread(records_of_[k]);
      records_.insert(records_.end(), records_of_[k].begin(), records_of_[k].end());
      records_of_[k].clear();
    }
    largest_ = std::max(largest_, vertices());
    most_summed_ = std::max(most_summed_, summed);
    for (std::size_t v = first_; v < gathered_.size(); ++v) local_[gathered_[v][0]] = none;
    first_ = gathered_.size();
  }
  /// The patch of `part` goes on in `next`.
  void link(std::size_t part, std::size_t next) { parts_[part * part_words_ + 3] = std::uint32_t(next); }

  friend void assemble(Patches& patches, const std::vector<PartWriter>& writers,
                       const std::vector<std::size_t>& given);

 private:
  static constexpr std::uint32_t none = ~0u;
  const ConstraintSystem& system_;
  std::size_t part_words_;
  std::vector<std::uint32_t> local_;                    // of a vertex, its number in the part being written
  std::vector<std::vector<Record>> records_of_;         // by kind, of the part being written
  std::vector<std::uint32_t> parts_;                    // words, as in Patches
  std::vector<std::size_t> firsts_;                     // of each part's vertices among `gathered_`
  std::vector<std::array<std::uint32_t, 2>> gathered_;  // vertices of parts, as they were closed
  std::vector<Record> records_;
  std::size_t first_ = 0;  // of the part being written
  std::size_t largest_ = 0, most_summed_ = 0;
};

// Writers' parts in order: first the `given` many that each began with, then what they added. Each part gets
// the same room for its vertices, the rest of it copies of the first.
void assemble(Patches& patches, const std::vector<PartWriter>& writers,
              const std::vector<std::size_t>& given) {
  std::size_t given_parts = 0, parts = 0, records = 0;
  for (std::size_t w = 0; w < writers.size(); ++w) {
    given_parts += given[w];
    parts += writers[w].firsts_.size();
    records += writers[w].records_.size();
    patches.largest = std::max(patches.largest, writers[w].largest_);
    patches.most_summed = std::max(patches.most_summed, writers[w].most_summed_);
  }
  patches.part_words = writers[0].part_words_;
  patches.parts.resize(parts * patches.part_words);
  patches.records.resize(records);
  patches.vertices.resize(parts * patches.largest);
  patches.parted = parts > given_parts;
  struct Place {
    std::size_t given, added, record;
  };
  std::vector<Place> places(writers.size(), {0, given_parts, 0});
  for (std::size_t w = 1; w < writers.size(); ++w)
    places[w] = {places[w - 1].given + given[w - 1],
                 places[w - 1].added + writers[w - 1].firsts_.size() - given[w - 1],
                 places[w - 1].record + writers[w - 1].records_.size()};
  const auto place_one = [&](std::size_t w) {
    const PartWriter& writer = writers[w];
    const auto number = [&](std::size_t part) {
      return part < given[w] ? places[w].given + part : places[w].added + part - given[w];
    };
    std::copy(writer.records_.begin(), writer.records_.end(),
              patches.records.begin() + std::ptrdiff_t(places[w].record));
    for (std::size_t p = 0; p < writer.firsts_.size(); ++p) {
      std::uint32_t* words = patches.parts.data() + number(p) * patches.part_words;
      std::copy_n(writer.parts_.data() + p * patches.part_words, patches.part_words, words);
      if (words[3] != 0) words[3] = std::uint32_t(number(words[3]));
      for (std::size_t word = 4; word < patches.part_words; word += 2)
        words[word] += std::uint32_t(places[w].record);
      auto* to = patches.vertices.data() + number(p) * patches.largest;
      for (std::size_t v = 0; v < patches.largest; ++v)
        to[v] = writer.gathered_[writer.firsts_[p] + (v < words[0] ? v : 0)];
    }
  };
  parallel_for(
      writers.size(),
      [&](std::size_t first, std::size_t end) {
        for (std::size_t w = first; w < end; ++w) place_one(w);
      },
      1);
}

// The constraints of one kind on each vertex, in order.
Grouped constraints_at(const ConstraintList& list, std::size_t vertices) {
  const std::size_t arity = std::size_t(list.arity);
  return group_by_key(list.count(), vertices, [&](std::size_t c, const auto& emit) {
    for (std::size_t j = 0; j < arity; ++j) emit(list.vertices[c * arity + j], std::uint32_t(c));
  });
}

// Where patches of at most `own` consecutive vertices begin, and the end: fewer vertices where these and the
// ones that share a constraint with them would not fit a part, and at every `stretch` vertices, between which
// nothing depends on the rest.
std::vector<std::size_t> starts_of_patches(const ConstraintSystem& system, const std::vector<Grouped>& at,
                                           std::size_t own) {
  constexpr std::size_t stretch = 4096;
  const std::size_t vertices = system.at_vertex.size();
  std::vector<std::vector<std::size_t>> of_stretch((vertices + stretch - 1) / stretch);
  parallel_for(
      of_stretch.size(),
      [&](std::size_t first_stretch, std::size_t end_stretch) {
        std::vector<std::uint32_t> last(vertices);  // patch that had the vertex last, from 1 on
        std::uint32_t patch = 0;
        std::size_t held = 0;
        const auto add = [&](std::size_t v) {
          const auto hold = [&](std::size_t u) {
            if (last[u] != patch) last[u] = patch, ++held;
          };
          hold(v);
          for (std::size_t k = 0; k < system.lists.size(); ++k) {
            const ConstraintList& list = system.lists[k];
            const std::size_t arity = std::size_t(list.arity);
            for (std::size_t i = at[k].first[v]; i < at[k].first[v + 1]; ++i)
              for (std::size_t j = 0; j < arity; ++j) hold(list.vertices[at[k].values[i] * arity + j]);
          }
        };
        for (std::size_t s = first_stretch; s < end_stretch; ++s) {
          auto& starts = of_stretch[s];
          for (std::size_t v = s * stretch; v < std::min(vertices, (s + 1) * stretch); ++v) {
            if (!starts.empty() && v - starts.back() < own) add(v);
            if (starts.empty() || v - starts.back() == own || held > Patches::most_vertices) {
              starts.push_back(v);
              ++patch;
              held = 0;
              add(v);
            }
          }
        }
      },
      1);
  std::vector<std::size_t> starts;
  for (const auto& some : of_stretch) starts.insert(starts.end(), some.begin(), some.end());
  starts.push_back(vertices);
  return starts;
}

}  // namespace

Patches constraint_patches(const Model& model, const ConstraintSystem& system, std::size_t most) {
  Patches patches;
  std::vector<PartWriter> writers(1, PartWriter(system));
  PartWriter& writer = writers[0];
  std::size_t filled = 0;
  const auto close = [&] {
    writer.close(writer.add_part(), writer.vertices());
    ++patches.count;
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
  assemble(patches, writers, {patches.count});
  return patches;
}

Patches vertex_patches(const ConstraintSystem& system, std::size_t own, int groups,
                       const std::vector<std::vector<std::uint8_t>>& members) {
  const std::size_t vertices = system.at_vertex.size();
  Patches patches;
  std::vector<Grouped> at;
  for (const ConstraintList& list : system.lists) at.push_back(constraints_at(list, vertices));
  const std::vector<std::size_t> starts = starts_of_patches(system, at, own);
  patches.count = starts.size() - 1;
  const auto write_patch = [&](PartWriter& writer, std::size_t part, std::size_t g, std::size_t p,
                               std::vector<std::uint32_t>& found) {
    const std::size_t first = starts[p], end = starts[p + 1];
    const auto begin_part = [&] {
      for (std::size_t v = first; v < end; ++v) writer.vertex(std::uint32_t(v));
    };
    begin_part();
    for (std::size_t k = 0; k < system.lists.size(); ++k) {
      const ConstraintList& list = system.lists[k];
      const std::size_t arity = std::size_t(list.arity);
      found.clear();
      for (std::size_t v = first; v < end; ++v)
        for (std::uint32_t i = at[k].first[v]; i < at[k].first[v + 1]; ++i) {
          const std::uint32_t c = at[k].values[i];
          // Tets lie about in memory; the list is long enough to look ahead.
          const std::uint32_t soon = at[k].values[std::min<std::size_t>(i + 16, at[k].values.size() - 1)];
          __builtin_prefetch(list.vertices.data() + std::size_t(soon) * arity);
          __builtin_prefetch(list.rest.data() + soon);
          // Taken at the first of the patch's vertices that it has.
          const auto earlier = [&](std::uint32_t u) { return u >= first && u < v; };
          const std::uint32_t* of = list.vertices.data() + std::size_t(c) * arity;
          if (std::none_of(of, of + arity, earlier)) found.push_back(c);
        }
      std::sort(found.begin(), found.end());
      for (std::uint32_t c : found) {
        if (!members.empty() && members[k][c] != g) continue;
        if (writer.add(k, c)) continue;
        writer.close(part, end - first);
        const std::size_t next = writer.add_part();
        writer.link(part, next);
        part = next;
        begin_part();
        writer.add(k, c);
      }
    }
    writer.close(part, end - first);
  };
  const std::size_t all = patches.count * std::size_t(groups);
  const std::size_t parts = std::clamp<std::size_t>(all / 64, 1, thread_count());
  std::vector<PartWriter> writers;
  std::vector<std::size_t> given;
  for (std::size_t w = 0; w < parts; ++w) {
    given.push_back(all * (w + 1) / parts - all * w / parts);
    writers.emplace_back(system, given.back());
  }
  parallel_for(
      parts,
      [&](std::size_t begin, std::size_t end) {
        std::vector<std::uint32_t> found;
        for (std::size_t w = begin; w < end; ++w)
          for (std::size_t part = 0; part < given[w]; ++part) {
            const std::size_t patch = all * w / parts + part;  // group after group
            write_patch(writers[w], part, patch / patches.count, patch % patches.count, found);
          }
      },
      1);
  assemble(patches, writers, given);
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
