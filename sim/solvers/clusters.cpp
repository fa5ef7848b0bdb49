#include "sim/solvers/clusters.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <utility>

#include "sim/parallel.h"

namespace tetpbd {

namespace {

using Members = std::vector<ConstraintRef>;
struct Cluster {
  Members members;
  std::vector<std::uint32_t> vertices;
};

// Constraints of all kinds have one sequence of numbers here.
class ClusterGrower {
 public:
  explicit ClusterGrower(const ConstraintSystem& system)
      : system_(system), missing_(system.count()), gain_(system.at_vertex.size()), inside_(system.at_vertex.size()) {
    for (std::uint32_t k = 0; k < kind_count; ++k)
      for (std::uint32_t c = 0; c < system.lists[k].count(); ++c) refs_.push_back({k, c});
    for (std::size_t n = 0; n < refs_.size(); ++n) missing_[n] = std::uint8_t(ends(n).size());
    at_ = group_by_key(refs_.size(), system.at_vertex.size(), [&](std::size_t n, const auto& emit) {
      for (const std::uint32_t v : ends(n)) emit(v, std::uint32_t(n));
    });
    for (std::uint32_t n = 0; n < refs_.size(); ++n) seeds_.emplace_back(std::ranges::min(ends(n)), n);
    parallel_sort(std::span(seeds_));
  }

  /// Returns the next cluster, or an empty one where all constraints have theirs.
  Cluster grow(std::size_t most) {
    while (seed_ < seeds_.size() && missing_[seeds_[seed_].second] == taken) ++seed_;
    if (seed_ == seeds_.size()) return {};
    const std::uint32_t seed = seeds_[seed_].second;
    take(seed);
    for (const std::uint32_t v : ends(seed)) add_vertex(v, most);
    while (members_.size() < most) {
      // The vertex that completes most constraints; of several the first, so that the result is always the same.
      const auto best = std::ranges::max_element(near_, {}, [&](std::uint32_t v) { return std::pair(gain_[v], ~v); });
      if (best == near_.end() || gain_[*best] == 0 || vertices_.size() == most_vertices) break;
      add_vertex(*best, most);
    }
    forget();
    std::ranges::sort(members_);
    return {std::exchange(members_, {}), std::exchange(vertices_, {})};
  }

 private:
  static constexpr std::uint8_t taken = 255;
  static constexpr std::size_t most_vertices = 32;  // a small mesh must not become one cluster
  std::span<const std::uint32_t> ends(std::size_t n) const {
    return system_.lists[refs_[n].kind].ends(refs_[n].constraint);
  }
  void take(std::uint32_t n) { members_.push_back(refs_[n]), missing_[n] = taken; }
  void add_gain(std::uint32_t v, int change) {
    if (gain_[v] == 0 && change > 0) near_.push_back(v);
    gain_[v] += change;
  }
  // Constraints on the vertex that now lie within the cluster join it; those that lack one vertex add to its gain.
  void add_vertex(std::uint32_t v, std::size_t most) {
    if (inside_[v]) return;
    inside_[v] = true, vertices_.push_back(v);
    std::erase(near_, v), gain_[v] = 0;
    for (std::uint32_t k = at_.first[v]; k < at_.first[v + 1]; ++k) {
      const std::uint32_t n = at_.values[k];
      if (missing_[n] == taken) continue;
      if (--missing_[n] == 0 && members_.size() < most) {
        take(n);
      } else if (missing_[n] == 1) {
        for (const std::uint32_t end : ends(n))
          if (!inside_[end]) add_gain(end, 1);
      }
    }
  }
  void forget() {
    for (const std::uint32_t v : near_) gain_[v] = 0;
    for (const std::uint32_t v : vertices_) {
      inside_[v] = false;
      for (std::uint32_t k = at_.first[v]; k < at_.first[v + 1]; ++k)
        if (const std::uint32_t n = at_.values[k]; missing_[n] != taken) missing_[n] = std::uint8_t(ends(n).size());
    }
    near_.clear();
  }

  const ConstraintSystem& system_;
  std::vector<ConstraintRef> refs_;
  std::vector<std::uint8_t> missing_;  // by constraint, how many of its vertices are not in the cluster; `taken`
  std::vector<std::int32_t> gain_;     // by vertex, how many constraints lack it alone
  std::vector<bool> inside_;
  Grouped at_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> seeds_;  // smallest vertex, constraint
  std::size_t seed_ = 0;
  Members members_;
  std::vector<std::uint32_t> vertices_, near_;
};

// The first colour that none of the vertices has yet, with large clusters before small ones, which fit in anywhere.
Clusters colour_clusters(std::vector<Cluster> clusters, std::size_t vertices) {
  std::ranges::stable_sort(clusters, std::greater{}, [](const Cluster& c) { return c.members.size(); });
  struct Colour {
    std::vector<bool> has;  // by vertex
    std::vector<Members> members;
  };
  std::vector<Colour> colours;
  for (Cluster& cluster : clusters) {
    const auto is_free = [&](const Colour& colour) {
      return std::ranges::none_of(cluster.vertices, [&](std::uint32_t v) { return colour.has[v]; });
    };
    auto colour = std::ranges::find_if(colours, is_free);
    if (colour == colours.end()) colour = colours.insert(colour, {std::vector<bool>(vertices), {}});
    for (const std::uint32_t v : cluster.vertices) colour->has[v] = true;
    colour->members.push_back(std::move(cluster.members));
  }
  Clusters result;
  for (Colour& colour : colours) {
    result.first.push_back(result.members.size());
    std::ranges::move(colour.members, std::back_inserter(result.members));
  }
  result.first.push_back(result.members.size());
  return result;
}

}  // namespace

Clusters cluster_constraints(const ConstraintSystem& system, std::size_t most) {
  ClusterGrower grower(system);
  std::vector<Cluster> clusters;
  for (Cluster next = grower.grow(most); !next.members.empty(); next = grower.grow(most))
    clusters.push_back(std::move(next));
  return colour_clusters(std::move(clusters), system.at_vertex.size());
}

}  // namespace tetpbd
