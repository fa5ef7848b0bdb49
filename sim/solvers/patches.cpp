#include "sim/solvers/patches.h"

#include <algorithm>
#include <bit>
#include <tuple>
#include <utility>

#include "sim/parallel.h"

namespace tetpbd {

namespace {

using Record = std::array<std::uint32_t, 2>;  // vertices, constraint

struct Chunk {
  std::vector<std::uint32_t> vertices;
  std::array<std::vector<Record>, kind_count> records;
  std::size_t owned = 0;
};

class ChunkWriter {
 public:
  explicit ChunkWriter(const ConstraintSystem& system) : system_(system), local_(system.at_vertex.size(), none) {}
  /// Adds the vertex to the chunk if it is not there yet, and returns its number in it.
  std::uint32_t vertex(std::uint32_t v) {
    if (local_[v] == none) {
      local_[v] = std::uint32_t(chunk_.vertices.size());
      chunk_.vertices.push_back(v);
    }
    return local_[v];
  }
  /// Returns false, and adds nothing, if the constraint has more vertices than fit.
  bool add(std::size_t kind, std::uint32_t constraint) {
    const ConstraintList& list = system_.lists[kind];
    const auto ends = list.ends(constraint);
    const auto added = std::ranges::count_if(ends, [&](std::uint32_t v) { return local_[v] == none; });
    if (chunk_.vertices.size() + std::size_t(added) > Patches::most_vertices) return false;
    Record record = {0, constraint};
    for (std::size_t j = 0; j < ends.size(); ++j) record[0] |= vertex(ends[j]) << (8 * j);
    chunk_.records[kind].push_back(record);
    return true;
  }
  /// Returns the chunk and begins the next one. The chunk owns at most its first `owned` vertices.
  Chunk close(std::size_t owned = Patches::most_vertices) {
    for (std::uint32_t v : chunk_.vertices) local_[v] = none;
    chunk_.owned = std::min(owned, chunk_.vertices.size());
    return std::exchange(chunk_, {});
  }

 private:
  static constexpr std::uint32_t none = ~0u;
  const ConstraintSystem& system_;
  std::vector<std::uint32_t> local_;  // a vertex's number in the chunk
  Chunk chunk_;
};

// Lays out the chunks of all patches. Each has room for as many vertices, filled up with copies of its first.
Patches assemble(const ConstraintSystem& system, const std::vector<std::vector<Chunk>>& patches, bool with_tets) {
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
  const auto write_record = [&](const ConstraintList& list, const Record& record) {
    if (with_tets && &list == &system.lists[index_of<NeoHookean>])
      result.tets.push_back({record[1], std::uint32_t(result.records.size())});
    std::vector<std::uint32_t> words = {record[0]};
    for (const auto* values : {&list.rest, &list.compliance, &list.stiffness, &list.damping}) {
      const std::size_t each = values->size() / list.count();
      for (std::size_t v = 0; v < each; ++v)
        words.push_back(std::bit_cast<std::uint32_t>(float((*values)[record[1] * each + v])));
    }
    words.resize(2 * record_pairs(list));
    for (std::size_t w = 0; w < words.size(); w += 2) result.records.push_back({words[w], words[w + 1]});
  };
  std::size_t further = patches.size();  // place of the next chunk that is not the first of its patch
  const auto write = [&](const Chunk& chunk, std::size_t number, std::size_t next) {
    std::uint32_t* words = result.chunks.data() + number * result.chunk_words;
    *words++ = std::uint32_t(chunk.vertices.size());
    *words++ = std::uint32_t(chunk.owned);
    *words++ = chunk.vertices[0];
    *words++ = std::uint32_t(next);
    for (std::size_t k = 0; k < kind_count; ++k) {
      if (!system.present[k]) continue;
      *words++ = std::uint32_t(result.records.size());
      const std::vector<Record>& records = chunk.records[k];
      *words++ = std::uint32_t(records.size());
      // Consecutive invocations get constraints far apart, which seldom share a vertex: their additions to its sum
      // would wait for each other.
      const std::size_t stride = (records.size() + 31) / 32;
      for (std::size_t start = 0; start < stride; ++start)
        for (std::size_t r = start; r < records.size(); r += stride) write_record(system.lists[k], records[r]);
    }
    for (std::size_t v = 0; v < result.largest; ++v) {
      const std::uint32_t vertex = chunk.vertices[v < chunk.vertices.size() ? v : 0];
      const float constraints = float(system.at_vertex[vertex]);
      result.vertices[number * result.largest + v] = {vertex, std::bit_cast<std::uint32_t>(constraints)};
    }
  };
  for (std::size_t p = 0; p < patches.size(); ++p)
    for (std::size_t c = 0; c < patches[p].size(); ++c) {
      const std::size_t number = c == 0 ? p : further++;
      write(patches[p][c], number, c + 1 < patches[p].size() ? further : 0);
    }
  return result;
}

}  // namespace

Patches constraint_patches(const ConstraintSystem& system, std::size_t most, bool with_tets) {
  // Neighbours in space have vertices with near numbers, so constraints are taken in the order of these.
  std::vector<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>> order;  // vertex, kind, constraint
  for (std::uint32_t k = 0; k < kind_count; ++k)
    for (std::uint32_t c = 0; c < system.lists[k].count(); ++c)
      order.emplace_back(std::ranges::min(system.lists[k].ends(c)), k, c);
  parallel_sort(std::span(order));
  std::vector<std::vector<Chunk>> patches;
  ChunkWriter writer(system);
  std::size_t filled = 0;
  for (const auto& [vertex, kind, constraint] : order) {
    if (filled == most || !writer.add(kind, constraint)) {
      patches.push_back({writer.close()});
      writer.add(kind, constraint);
      filled = 0;
    }
    ++filled;
  }
  if (filled > 0) patches.push_back({writer.close()});
  return assemble(system, patches, with_tets);
}

Patches pack_patches(const ConstraintSystem& system, const std::vector<std::vector<ConstraintRef>>& members,
                     bool with_tets) {
  std::vector<std::vector<Chunk>> patches;
  ChunkWriter writer(system);
  for (const auto& patch : members) {
    for (const ConstraintRef& member : patch) writer.add(member.kind, member.constraint);
    patches.push_back({writer.close()});
  }
  return assemble(system, patches, with_tets);
}

Patches vertex_patches(const ConstraintSystem& system, std::size_t own, bool with_tets) {
  const std::size_t vertices = system.at_vertex.size();
  std::array<Grouped, kind_count> at;  // the constraints on each vertex
  for (std::size_t k = 0; k < kind_count; ++k)
    at[k] = group_by_key(system.lists[k].count(), vertices, [&](std::size_t c, const auto& emit) {
      for (std::uint32_t v : system.lists[k].ends(c)) emit(v, std::uint32_t(c));
    });
  // The chunks of the patch that owns vertices [first, end).
  const auto make_patch = [&](ChunkWriter& writer, std::size_t first, std::size_t end) {
    std::vector<Chunk> chunks;
    const auto own_vertices = [&] {
      for (std::size_t v = first; v < end; ++v) writer.vertex(std::uint32_t(v));
    };
    own_vertices();
    for (std::size_t k = 0; k < kind_count; ++k) {
      std::vector<std::uint32_t> found(at[k].values.begin() + at[k].first[first],
                                       at[k].values.begin() + at[k].first[end]);
      std::ranges::sort(found);
      found.erase(std::ranges::unique(found).begin(), found.end());
      for (std::uint32_t c : found) {
        if (writer.add(k, c)) continue;
        chunks.push_back(writer.close(end - first));
        own_vertices();
        writer.add(k, c);
      }
    }
    chunks.push_back(writer.close(end - first));
    return chunks;
  };
  // Parts of as many vertices are cut on their own, so that the number of threads changes nothing. A patch has fewer
  // than `own` vertices where these and the ones that share a constraint with them would not fit a chunk.
  constexpr std::size_t part = 4096;
  std::vector<std::vector<std::vector<Chunk>>> of_part((vertices + part - 1) / part);
  const auto cut = [&](std::size_t first_part, std::size_t end_part) {
    ChunkWriter writer(system);
    for (std::size_t p = first_part; p < end_part; ++p)
      for (std::size_t v = p * part, end = std::min(v + part, vertices), taken = 0; v < end; v += taken) {
        taken = std::min(own, end - v);
        auto chunks = make_patch(writer, v, v + taken);
        for (; chunks.size() > 1 && taken > 1; chunks = make_patch(writer, v, v + taken)) taken -= (taken + 15) / 16;
        of_part[p].push_back(std::move(chunks));
      }
  };
  parallel_parts(of_part.size(), 1, cut);
  std::vector<std::vector<Chunk>> patches;
  for (auto& some : of_part) std::ranges::move(some, std::back_inserter(patches));
  return assemble(system, patches, with_tets);
}

}  // namespace tetpbd
