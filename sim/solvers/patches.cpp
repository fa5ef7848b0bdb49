#include "sim/solvers/patches.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <span>
#include <utility>

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
    parallel_for(list.count(), [&](std::size_t c) {
      glm::dvec3 middle(0);
      for (std::size_t j = 0; j < arity; ++j) middle += model.rest.positions[list.vertices[c * arity + j]];
      items[start + c] = {hilbert_key(middle / double(arity), box), k, std::uint32_t(c)};
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

// A chunk as it is written.
struct Chunk {
  std::vector<std::uint32_t> vertices;
  std::array<std::vector<Record>, kind_count> records;
  std::size_t owned = 0;
};

// Adds constraints to one chunk after the other.
class ChunkWriter {
 public:
  explicit ChunkWriter(const ConstraintSystem& system)
      : system_(system), local_(system.at_vertex.size(), none) {}
  /// The vertex's number in the chunk, which has it from now on.
  std::uint32_t vertex(std::uint32_t v) {
    if (local_[v] == none) {
      local_[v] = std::uint32_t(chunk_.vertices.size());
      chunk_.vertices.push_back(v);
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
    if (chunk_.vertices.size() + std::size_t(added) > Patches::most_vertices) return false;
    Record record = {0, std::bit_cast<std::uint32_t>(float(list.rest[constraint]))};
    for (std::size_t j = 0; j < arity; ++j) record[0] |= vertex(of[j]) << (8 * j);
    chunk_.records[kind].push_back(record);
    return true;
  }
  /// The chunk, of whose vertices the first `owned` are owned (all: none given); the next one begins.
  Chunk close(std::optional<std::size_t> owned = std::nullopt) {
    for (std::uint32_t v : chunk_.vertices) local_[v] = none;
    for (auto& records : chunk_.records) spread(records);
    chunk_.owned = owned.value_or(chunk_.vertices.size());
    return std::exchange(chunk_, {});
  }

 private:
  static constexpr std::uint32_t none = ~0u;
  const ConstraintSystem& system_;
  std::vector<std::uint32_t> local_;  // of a vertex, its number in the chunk
  Chunk chunk_;
};

// The chunks of all patches as patches.h lays them out: the first of each patch, then what they need beyond.
// Each gets the same room for its vertices, the rest of it copies of the first.
Patches assemble(const ConstraintSystem& system, const std::vector<std::vector<Chunk>>& patches) {
  Patches result;
  result.count = patches.size();
  result.chunk_words = 4 + 2 * std::size_t(std::count(system.present.begin(), system.present.end(), true));
  std::size_t chunks = 0;
  for (const auto& patch : patches) {
    chunks += patch.size();
    for (const Chunk& chunk : patch) {
      result.largest = std::max(result.largest, chunk.vertices.size());
      result.most_owned = std::max(result.most_owned, chunk.owned);
    }
  }
  result.chunked = chunks > patches.size();
  result.chunks.resize(chunks * result.chunk_words);
  result.vertices.resize(chunks * result.largest);
  std::size_t further = patches.size();  // where the next chunk goes that is not the first of its patch
  const auto write = [&](const Chunk& chunk, std::size_t number, std::size_t next) {
    std::uint32_t* words = result.chunks.data() + number * result.chunk_words;
    *words++ = std::uint32_t(chunk.vertices.size());
    *words++ = std::uint32_t(chunk.owned);
    *words++ = chunk.vertices[0];
    *words++ = std::uint32_t(next);
    for (std::size_t k = 0; k < kind_count; ++k) {
      if (!system.present[k]) continue;
      *words++ = std::uint32_t(result.records.size());
      *words++ = std::uint32_t(chunk.records[k].size());
      result.records.insert(result.records.end(), chunk.records[k].begin(), chunk.records[k].end());
    }
    for (std::size_t v = 0; v < result.largest; ++v) {
      const std::uint32_t vertex = chunk.vertices[v < chunk.vertices.size() ? v : 0];
      result.vertices[number * result.largest + v] = {
          vertex, std::bit_cast<std::uint32_t>(float(system.at_vertex[vertex]))};
    }
  };
  for (std::size_t p = 0; p < patches.size(); ++p)
    for (std::size_t c = 0; c < patches[p].size(); ++c) {
      const std::size_t number = c == 0 ? p : further++;
      write(patches[p][c], number, c + 1 < patches[p].size() ? further : 0);
    }
  return result;
}

// The constraints of one kind on each vertex, in order.
Grouped constraints_at(const ConstraintList& list, std::size_t vertices) {
  const std::size_t arity = std::size_t(list.arity);
  return group_by_key(list.count(), vertices, [&](std::size_t c, const auto& emit) {
    for (std::size_t j = 0; j < arity; ++j) emit(list.vertices[c * arity + j], std::uint32_t(c));
  });
}

// Where patches of at most `own` consecutive vertices begin, and the end: fewer vertices where these and the
// ones that share a constraint with them would not fit a chunk, and at every `stretch` vertices, between
// which nothing depends on the rest.
std::vector<std::size_t> starts_of_patches(const ConstraintSystem& system, const std::vector<Grouped>& at,
                                           std::size_t own) {
  constexpr std::size_t stretch = 4096;
  const std::size_t vertices = system.at_vertex.size();
  std::vector<std::vector<std::size_t>> of_stretch((vertices + stretch - 1) / stretch);
  parallel_parts(of_stretch.size(), 1, [&](std::size_t first_stretch, std::size_t end_stretch) {
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
  });
  std::vector<std::size_t> starts;
  for (const auto& some : of_stretch) starts.insert(starts.end(), some.begin(), some.end());
  starts.push_back(vertices);
  return starts;
}

}  // namespace

Patches constraint_patches(const Model& model, const ConstraintSystem& system, std::size_t most) {
  std::vector<std::vector<Chunk>> patches;
  ChunkWriter writer(system);
  std::size_t filled = 0;
  for (const Item& item : ordered(model, system)) {
    if (filled == most || !writer.add(item.kind, item.constraint)) {
      patches.push_back({writer.close()});
      writer.add(item.kind, item.constraint);
      filled = 0;
    }
    ++filled;
  }
  if (filled > 0) patches.push_back({writer.close()});
  return assemble(system, patches);
}

Patches vertex_patches(const ConstraintSystem& system, std::size_t own) {
  const std::size_t vertices = system.at_vertex.size();
  std::vector<Grouped> at;
  for (const ConstraintList& list : system.lists) at.push_back(constraints_at(list, vertices));
  const std::vector<std::size_t> starts = starts_of_patches(system, at, own);
  std::vector<std::vector<Chunk>> patches(starts.size() - 1);
  const auto write_patch = [&](ChunkWriter& writer, std::size_t p, std::vector<std::uint32_t>& found) {
    const std::size_t first = starts[p], end = starts[p + 1];
    const auto begin_chunk = [&] {
      for (std::size_t v = first; v < end; ++v) writer.vertex(std::uint32_t(v));
    };
    begin_chunk();
    for (std::size_t k = 0; k < kind_count; ++k) {
      const ConstraintList& list = system.lists[k];
      const std::size_t arity = std::size_t(list.arity);
      found.clear();
      for (std::size_t v = first; v < end; ++v)
        for (std::uint32_t i = at[k].first[v]; i < at[k].first[v + 1]; ++i) {
          const std::uint32_t c = at[k].values[i];
          // Taken at the first of the patch's vertices that it has.
          const auto earlier = [&](std::uint32_t u) { return u >= first && u < v; };
          const std::uint32_t* of = list.vertices.data() + std::size_t(c) * arity;
          if (std::none_of(of, of + arity, earlier)) found.push_back(c);
        }
      std::sort(found.begin(), found.end());
      for (std::uint32_t c : found) {
        if (writer.add(k, c)) continue;
        patches[p].push_back(writer.close(end - first));
        begin_chunk();
        writer.add(k, c);
      }
    }
    patches[p].push_back(writer.close(end - first));
  };
  parallel_parts(patches.size(), 64, [&](std::size_t begin, std::size_t end) {
    ChunkWriter writer(system);
    std::vector<std::uint32_t> found;
    for (std::size_t p = begin; p < end; ++p) write_patch(writer, p, found);
  });
  return assemble(system, patches);
}

}  // namespace tetpbd
