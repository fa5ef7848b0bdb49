#include "sim/solvers/aggregates.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <queue>

#include "sim/hash.h"
#include "sim/mesh/cache.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

constexpr std::uint32_t none = ~0u;

struct Nearest {
  std::vector<std::uint32_t> seed;  // by vertex
  std::vector<double> distance;
};

// Dijkstra's algorithm from all seeds from `first` on at once.
void spread(const Model& model, const Grouped& neighbours, const std::vector<std::uint32_t>& seeds, std::size_t first,
            Nearest& nearest) {
  using Entry = std::pair<double, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (std::size_t s = first; s < seeds.size(); ++s) {
    nearest.distance[seeds[s]] = 0, nearest.seed[seeds[s]] = std::uint32_t(s);
    queue.push({0, seeds[s]});
  }
  while (!queue.empty()) {
    const auto [distance, v] = queue.top();
    queue.pop();
    if (distance > nearest.distance[v]) continue;
    for (std::uint32_t k = neighbours.first[v]; k < neighbours.first[v + 1]; ++k) {
      const std::uint32_t u = neighbours.values[k];
      if (!(model.inverse_masses[u] > 0)) continue;
      const double further = distance + glm::distance(model.rest.positions[u], model.rest.positions[v]);
      if (further < nearest.distance[u]) {
        nearest.distance[u] = further, nearest.seed[u] = nearest.seed[v];
        queue.push({further, u});
      }
    }
  }
}

// Clusters a body by k-means: seeds begin evenly spread, as vertices are numbered along a curve, and move to the middle
// of what is nearest to them a few times.
void cluster(const Model& model, const Body& body, const Grouped& neighbours, std::size_t wanted,
             std::vector<std::uint32_t>& seeds, Nearest& nearest) {
  const std::size_t first = seeds.size();
  std::vector<std::uint32_t> moving;
  for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v)
    if (model.inverse_masses[v] > 0) moving.push_back(std::uint32_t(v));
  wanted = std::min(wanted, moving.size());
  for (std::size_t s = 0; s < wanted; ++s) seeds.push_back(moving[(2 * s + 1) * moving.size() / (2 * wanted)]);
  for (int round = 0; round < 6; ++round) {
    for (const std::uint32_t v : moving)
      nearest.seed[v] = none, nearest.distance[v] = std::numeric_limits<double>::max();
    spread(model, neighbours, seeds, first, nearest);
    for (const std::uint32_t v : moving)  // A part without a seed gets one.
      if (nearest.seed[v] == none && seeds.size() - first < most_aggregates)
        seeds.push_back(v), spread(model, neighbours, seeds, seeds.size() - 1, nearest);
    if (round == 5) break;
    std::vector<glm::dvec4> centres(seeds.size() - first, glm::dvec4(0));
    for (const std::uint32_t v : moving)
      if (nearest.seed[v] != none)
        centres[nearest.seed[v] - first] += model.masses[v] * glm::dvec4(model.rest.positions[v], 1);
    std::vector<double> best(centres.size(), std::numeric_limits<double>::max());
    for (const std::uint32_t v : moving) {
      if (nearest.seed[v] == none) continue;
      const std::size_t s = nearest.seed[v] - first;
      const double distance = glm::distance(model.rest.positions[v], glm::dvec3(centres[s]) / centres[s].w);
      if (distance < best[s]) best[s] = distance, seeds[first + s] = v;
    }
  }
}

using Weights = std::vector<std::pair<std::uint32_t, double>>;  // aggregate, weight

// In each round a vertex takes over three fifths of its weights from its neighbours.
std::vector<Weights> smooth_weights(const Model& model, const Grouped& neighbours, const Nearest& nearest) {
  std::vector<Weights> weights(nearest.seed.size()), next(nearest.seed.size());
  for (std::size_t v = 0; v < weights.size(); ++v)
    if (nearest.seed[v] != none) weights[v] = {{nearest.seed[v], 1}};
  for (int round = 0; round < 4; ++round) {
    parallel_for(weights.size(), [&](std::size_t v) {
      Weights& sum = next[v];
      sum.clear();
      if (!(model.inverse_masses[v] > 0)) return;
      const auto add = [&](const Weights& from, double factor) {
        for (const auto& [aggregate, weight] : from) {
          const auto found = std::ranges::find(sum, aggregate, &Weights::value_type::first);
          if (found == sum.end())
            sum.push_back({aggregate, factor * weight});
          else
            found->second += factor * weight;
        }
      };
      const auto all =
          std::span(neighbours.values).subspan(neighbours.first[v], neighbours.first[v + 1] - neighbours.first[v]);
      const auto count = std::ranges::count_if(all, [&](std::uint32_t u) { return model.inverse_masses[u] > 0; });
      add(weights[v], count > 0 ? 0.4 : 1);
      for (const std::uint32_t u : all)
        if (model.inverse_masses[u] > 0) add(weights[u], 0.6 / double(count));
      std::ranges::sort(sum, [](const auto& a, const auto& b) { return a.second > b.second; });
      if (sum.size() > 8) sum.resize(8);
    });
    std::swap(weights, next);
  }
  return weights;
}

// The four largest weights, which are scaled to add up to 1.
std::array<Share, 4> make_shares(const Weights& weights) {
  std::array<Share, 4> shares{};
  double sum = 0;
  const std::size_t count = std::min<std::size_t>(weights.size(), 4);
  for (std::size_t k = 0; k < count; ++k) sum += weights[k].second;
  std::uint32_t left = 65535;
  for (std::size_t k = count; k-- > 0;) {
    const std::uint32_t weight = k == 0 ? left : std::uint32_t(65535 * weights[k].second / sum);
    shares[k] = {weights[k].first, weight}, left -= weight;
  }
  return shares;
}

using Modes = Eigen::Matrix<double, 3, 6>;

// How a vertex moves with an aggregate's three translations and three rotations.
Modes modes(const Model& model, const Aggregates& aggregates, std::size_t v, const Share& share) {
  const Aggregate& aggregate = aggregates.all[share.aggregate];
  const glm::dvec3 r = (model.rest.positions[v] - aggregate.centre) / aggregate.reach;
  Modes m;
  m << 1, 0, 0, 0, r.z, -r.y,  //
      0, 1, 0, -r.z, 0, r.x,   //
      0, 0, 1, r.y, -r.x, 0;
  return m * (double(share.weight) / 65535);
}

// Has to change whenever the aggregates of the same mesh do.
constexpr std::uint64_t cache_version = 3;

std::uint64_t cache_key(const Model& model, const Grouped& neighbours, const std::vector<std::size_t>& wanted) {
  std::uint64_t key = hash_values(wanted, hash_values(std::array{cache_version}));
  key = hash_values(model.rest.positions, key);
  key = hash_values(model.masses, hash_values(model.inverse_masses, key));
  return hash_values(neighbours.values, hash_values(neighbours.first, key));
}

bool parse_aggregates(std::string_view bytes, std::uint64_t key, const Model& model, Aggregates& result) {
  const auto sound = [&](const std::array<Share, 4>& shares) {
    return std::ranges::all_of(shares,
                               [&](const Share& s) { return s.weight == 0 || s.aggregate < result.all.size(); });
  };
  return take_sealed(bytes, key, result.all, result.first, result.of_vertex) &&
         result.of_vertex.size() == model.positions.size() && result.first.size() == model.bodies.size() + 1 &&
         std::ranges::is_sorted(result.first) && result.first.back() == result.all.size() &&
         std::ranges::all_of(result.of_vertex, sound);
}

void list_members(Aggregates& result) {
  const auto& shares = result.of_vertex;
  result.members = group_by_key(shares.size(), result.all.size(), [&](std::size_t v, auto&& emit) {
    for (std::size_t k = 0; k < 4; ++k)
      if (shares[v][k].weight > 0) emit(shares[v][k].aggregate, std::uint32_t(4 * v + k));
  });
}

}  // namespace

Aggregates make_aggregates(const Model& model, const Grouped& neighbours, const std::vector<std::size_t>& wanted) {
  // Aggregates of smaller meshes are made as quickly as they are read.
  const bool large = model.positions.size() >= 10000;
  const std::uint64_t key = large ? cache_key(model, neighbours, wanted) : 0;
  const std::string file = fmt::format("{:016x}.aggregates", key);
  Aggregates result;
  if (large && parse_aggregates(read_cached(file), key, model, result)) {
    list_members(result);
    return result;
  }
  result = {};
  result.first.push_back(0);
  std::vector<std::uint32_t> seeds;
  Nearest nearest;
  nearest.seed.assign(model.positions.size(), none), nearest.distance.resize(model.positions.size());
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    cluster(model, model.bodies[b], neighbours, wanted[b], seeds, nearest);
    result.first.push_back(std::uint32_t(seeds.size()));
  }
  const auto weights = smooth_weights(model, neighbours, nearest);
  result.of_vertex.resize(weights.size());
  parallel_for(weights.size(), [&](std::size_t v) { result.of_vertex[v] = make_shares(weights[v]); });
  result.all.resize(seeds.size());
  list_members(result);
  for (std::size_t a = 0; a < seeds.size(); ++a) {
    glm::dvec4 centre(0);
    double squares = 0;
    const auto each = [&](auto&& f) {
      for (std::uint32_t k = result.members.first[a]; k < result.members.first[a + 1]; ++k) {
        const std::uint32_t member = result.members.values[k], v = member / 4;
        f(model.rest.positions[v], model.masses[v] * result.of_vertex[v][member % 4].weight);
      }
    };
    each([&](const glm::dvec3& x, double m) { centre += m * glm::dvec4(x, 1); });
    const glm::dvec3 middle = centre.w > 0 ? glm::dvec3(centre) / centre.w : model.rest.positions[seeds[a]];
    each([&](const glm::dvec3& x, double m) { squares += m * glm::dot(x - middle, x - middle); });
    // One vertex alone reaches nowhere, but for rounding, by which nothing may be divided.
    const double reach = centre.w > 0 ? std::sqrt(squares / centre.w) : 0;
    result.all[a] = {middle, reach > 1e-9 * model.size ? reach : model.size};
  }
  if (large) keep_cached(file, key, result.all, result.first, result.of_vertex);
  return result;
}

namespace {

// The six rigid motions of a body about its centre of mass in coarse unknowns.
Eigen::MatrixXd rigid_motions(std::span<const Aggregate> aggregates, const glm::dvec3& pivot) {
  Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(Eigen::Index(6 * aggregates.size()), 6);
  for (std::size_t a = 0; a < aggregates.size(); ++a) {
    const auto at = Eigen::Index(6 * a);
    const glm::dvec3 arm = aggregates[a].centre - pivot;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 unit(0);
      unit[axis] = 1;
      const glm::dvec3 shift = glm::cross(unit, arm);
      for (int c = 0; c < 3; ++c) motions(at + c, 3 + axis) = shift[c];
      motions(at + axis, axis) = 1;
      motions(at + 3 + axis, 3 + axis) = aggregates[a].reach;
    }
  }
  return motions;
}

// The coarse matrix of a body, of which each thread fills the columns of its aggregates; the matrix is symmetric.
Eigen::MatrixXd coarse_matrix(const Model& model, std::size_t body, const Aggregates& aggregates,
                              const BlockRows& rows) {
  const std::size_t first = aggregates.first[body];
  const auto count = Eigen::Index(6 * aggregates.of_body(body));
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(count, count);
  parallel_for(aggregates.of_body(body), 1, [&](std::size_t column) {
    const std::size_t a = first + column;
    const auto add = [&](const Share& other, std::size_t v, const Eigen::Matrix<double, 6, 3>& from) {
      if (other.weight > 0)
        A.block<6, 6>(6 * Eigen::Index(other.aggregate - first), 6 * Eigen::Index(column)) +=
            (from * modes(model, aggregates, v, other)).transpose();
    };
    for (std::uint32_t k = aggregates.members.first[a]; k < aggregates.members.first[a + 1]; ++k) {
      const std::uint32_t member = aggregates.members.values[k], v = member / 4;
      const Modes own = modes(model, aggregates, v, aggregates.of_vertex[v][member % 4]);
      Eigen::Matrix3d diagonal = rows.inertia[v] * Eigen::Matrix3d::Identity();
      for (std::uint32_t e = rows.neighbours.first[v]; e < rows.neighbours.first[v + 1]; ++e) {
        const Eigen::Map<const Eigen::Matrix3d> block(&rows.blocks[e][0].x);
        diagonal -= block;
        const std::uint32_t u = rows.neighbours.values[e];
        const Eigen::Matrix<double, 6, 3> from = own.transpose() * block;
        for (const Share& share : aggregates.of_vertex[u]) add(share, u, from);
      }
      const Eigen::Matrix<double, 6, 3> from = own.transpose() * diagonal;
      for (const Share& share : aggregates.of_vertex[v]) add(share, v, from);
    }
  });
  return 0.5 * (A + A.transpose());
}

}  // namespace

std::vector<float> coarse_inverse(const Model& model, std::size_t body, const Aggregates& aggregates,
                                  const BlockRows& rows, const glm::dvec3* pivot) {
  Eigen::MatrixXd A = coarse_matrix(model, body, aggregates, rows);
  const Eigen::Index count = A.rows();
  // An aggregate of one vertex has no rotation: whatever an unknown is that no member feels, the matrix stays regular.
  A.diagonal() *= 1 + 1e-6;
  if (count > 0) A.diagonal().array() += 1e-12 * A.diagonal().maxCoeff();
  Eigen::MatrixXd N, of_motions;  // rigid motions and their matrix
  if (pivot) {
    N = rigid_motions(std::span(aggregates.all).subspan(aggregates.first[body], aggregates.of_body(body)), *pivot);
    of_motions = N.transpose() * A * N;
  }
  const Eigen::LLT<Eigen::MatrixXd> factors(A);
  Eigen::MatrixXd& inverse = A;
  inverse.setIdentity();
  parallel_parts(std::size_t(count), 32, [&](std::size_t first, std::size_t end) {
    factors.solveInPlace(inverse.middleCols(Eigen::Index(first), Eigen::Index(end - first)));
  });
  if (pivot) inverse -= N * of_motions.ldlt().solve(N.transpose());
  const std::size_t width = (std::size_t(count) + 3) / 4 * 4;
  std::vector<float> values(width * std::size_t(count), 0.0f);
  parallel_for(std::size_t(count), 64, [&](std::size_t row) {
    for (Eigen::Index c = 0; c < count; ++c)
      values[row * width + std::size_t(c)] = float(inverse(Eigen::Index(row), c));
  });
  return values;
}

}  // namespace tetpbd
