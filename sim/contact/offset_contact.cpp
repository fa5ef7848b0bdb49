#include "sim/contact/offset_contact.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "sim/contact/cell_grid.h"
#include "sim/contact/pairs.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

using real = double;  // of the formulas' constants
using glm::uint;
using Proximity = Formulas<double>::Proximity;

constexpr double limit_part = 0.49;  // of the margin, which a vertex may go: what is not listed is a margin apart
constexpr double reserve = 16;       // times the longest motion in a substep: a list holds for some

}  // namespace

namespace glsl {

// The surface, for the shaders' formulas.
struct SurfaceFormulas : Formulas<double> {
  using uvec4 = glm::uvec4;
  static constexpr uint NONE = Surfaces::none;
  const Model& model;
  const Surfaces& surfaces;
  const std::vector<glm::dvec3>& places;

  vec3 between(uint from, uint to) const { return places[to] - places[from]; }
  uvec4 edge_vertices(uint e) const {
    const Surfaces::Edge& edge = surfaces.edges[e];
    return {edge.ends[0], edge.ends[1], edge.beside[0], edge.beside[1]};
  }
  uvec4 triangle_corners(uint t) const {
    const auto& [i, j, k] = model.rest.surface[t];
    return {i, j, k, 0};
  }
  uint edge_of_triangle(uint t, int side) const { return surfaces.triangle_edges[t][std::size_t(side)]; }
  uint own_triangle_of(uint vertex) const { return surfaces.own_triangle[vertex]; }
  uint first_neighbour_of(uint vertex) const { return surfaces.first_neighbour[vertex]; }
  uint neighbour_at(uint k) const { return surfaces.neighbours[k]; }
#include "shaders/contact/bodies/belongs.glsl"
};

}  // namespace glsl

void OffsetContact::begin_step(const State& state) {
  listed_.clear(), pairs_.clear();
  kept_ = state.impulses, wrenches_ = state.wrenches;
}

void OffsetContact::end_step(State& state) const {
  state.impulses.clear();
  for (const Pair& pair : pairs_) keep(pair, state.impulses);
  state.wrenches = wrenches_;
}

void OffsetContact::begin(const Settings& settings, const Points& x, const Points& v) {
  if (bodies_touch(*model_, settings))
    start_ = x, start_velocities_ = v;
  else
    start_.clear(), listed_.clear(), wrenches_.clear();
}

void OffsetContact::resolve(const Settings& settings, Points& x, Points& v, const std::vector<double>& inverse_masses,
                            double h, double push_limit, std::span<const char> rigid) {
  if (start_.empty()) return;
  if (surfaces_.vertices.empty()) surfaces_ = lay_out_surfaces(*model_, settings.contact_distance);
  Substep substep{x, v, inverse_masses, h};
  const bool anew = !list_holds(x);
  if (anew) {
    set_margins(x, inverse_masses);
    find_pairs(settings.contact == "self");
  }
  evaluate_pairs();
  if (anew)
    for (Pair& pair : pairs_) {
      Ways ways;
      for (std::size_t k = 0; k < 4; ++k) ways[k] = h * start_velocities_[pair.vertices[k]];
      share_masses(pair, ways);
    }
  const double before = kinetic_energy(substep);
  const Points moved = x;
  find_hard_bodies(substep, rigid);
  apply_impulses(settings, push_limit, substep);
  counts_.gained += std::max(0.0, kinetic_energy(substep) - before);
  for (Pair& pair : pairs_) share_masses(pair, ways_of(pair, moved));
  truncate(substep);
}

void OffsetContact::keep(const Pair& pair, std::vector<PairImpulse>& kept) {
  if (pair.warm.size > 0) kept.push_back({pair.edges, pair.first, pair.second, pair.warm});
}

void OffsetContact::take_up_kept() {
  const auto order = [](const auto& a, const auto& b) {
    return std::tie(a.edges, a.first, a.second) < std::tie(b.edges, b.first, b.second);
  };
  std::ranges::sort(kept_, order);
  for (Pair& pair : pairs_) {
    const auto at = std::lower_bound(kept_.begin(), kept_.end(), pair, order);
    if (at != kept_.end() && !order(pair, *at)) pair.warm = at->warm;
  }
  kept_.clear();
}

// Whether all pairs are listed that this substep may ask for: those that touch, or will in `ahead` such substeps.
bool OffsetContact::list_holds(const Points& x) const {
  if (listed_.empty()) return false;
  return std::ranges::all_of(surfaces_.vertices, [&](std::uint32_t i) {
    const double away = glm::distance(start_[i], listed_[i]), way = glm::distance(x[i], start_[i]);
    return away == 0 || away + AHEAD * way <= 0.5 * margins_[i];
  });
}

// By the longest motion of all in a substep: what it hits may move as far in the next.
void OffsetContact::set_margins(const Points& x, const std::vector<double>& weights) {
  double longest = 0;
  for (const std::uint32_t i : surfaces_.vertices) longest = std::max(longest, glm::distance(x[i], start_[i]));
  longest = std::min(longest, model_->size);
  margins_.assign(x.size(), 0);
  for (const std::uint32_t i : surfaces_.vertices)
    if (weights[i] > 0 || x[i] != start_[i])
      margins_[i] = std::max(
          {2 * surfaces_.offsets[i], 2 * AHEAD * longest, std::min(reserve * longest, 8 * surfaces_.offsets[i])});
}

OffsetContact::Extents OffsetContact::find_extents() const {
  Extents result;
  for (const Body& body : model_->bodies) {
    result.boxes.push_back(body_bounds(body, start_));
    const auto first = margins_.begin() + std::ptrdiff_t(body.first_vertex);
    result.margins.push_back(*std::max_element(first, first + std::ptrdiff_t(body.vertices)));
  }
  result.cell = 2 * mean_edge(surfaces_, start_) + std::ranges::max(result.margins);
  return result;
}

// Around vertices, grown by half of their margins and, where `kept`, by their offsets.
Bounds OffsetContact::box_around(std::span<const std::uint32_t> vertices, bool kept) const {
  Bounds box{start_[vertices[0]], start_[vertices[0]]};
  double margin = 0, offset = 0;
  for (const std::uint32_t i : vertices) {
    box.low = glm::min(box.low, start_[i]), box.high = glm::max(box.high, start_[i]);
    margin = std::max(margin, margins_[i]), offset = std::max(offset, surfaces_.offsets[i]);
  }
  const double grown = margin / 2 + (kept ? offset : 0);
  return {box.low - grown, box.high + grown};
}

bool OffsetContact::Extents::may_meet(std::uint32_t own, const Bounds& box) const {
  for (std::uint32_t b = 0; b < boxes.size(); ++b)
    if (b != own && glm::all(glm::lessThanEqual(box.low - margins[b] / 2, boxes[b].high)) &&
        glm::all(glm::greaterThanEqual(box.high + margins[b] / 2, boxes[b].low)))
      return true;
  return false;
}

// All pairs nearer to each other than their offset and half of both margins, where the substep begins.
void OffsetContact::find_pairs(bool self) {
  listed_ = start_;
  const Extents bodies = find_extents();
  const auto may_meet = [&](std::uint32_t body, std::span<const std::uint32_t> vertices) {
    return self || bodies.may_meet(body, box_around(vertices, true));
  };
  CellGrid triangle_grid(bodies.cell), edge_grid(bodies.cell);
  const auto& triangles = model_->rest.surface;
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    if (may_meet(surfaces_.triangle_bodies[t], triangles[t])) triangle_grid.add(box_around(triangles[t], false), t);
  for (std::uint32_t e = 0; e < surfaces_.edges.size(); ++e)
    if (const Surfaces::Edge& edge = surfaces_.edges[e]; may_meet(edge.body, edge.ends))
      edge_grid.add(box_around(edge.ends, false), e);
  const std::size_t vertices = surfaces_.vertices.size();
  std::vector<std::vector<Pair>> found(vertices + surfaces_.edges.size());
  parallel_for(found.size(), 64, [&](std::size_t item) {
    const bool edges = item >= vertices;
    const std::uint32_t own = edges ? std::uint32_t(item - vertices) : surfaces_.vertices[item];
    const std::span<const std::uint32_t> corners =
        edges ? std::span<const std::uint32_t>(surfaces_.edges[own].ends) : std::span(&own, 1);
    if (!may_meet(edges ? surfaces_.edges[own].body : surfaces_.triangle_bodies[surfaces_.own_triangle[own]], corners))
      return;
    std::vector<std::uint32_t> near;
    (edges ? edge_grid : triangle_grid).for_each(box_around(corners, true), [&](std::uint32_t other) {
      if (!edges || other > own) near.push_back(other);
    });
    std::ranges::sort(near);
    const auto repeated = std::ranges::unique(near);
    near.erase(repeated.begin(), repeated.end());
    for (const std::uint32_t other : near) add_pair(self, edges, own, other, found[item]);
  });
  for (const Pair& pair : pairs_) keep(pair, kept_);
  pairs_.clear();
  for (const std::vector<Pair>& each : found) pairs_.insert(pairs_.end(), each.begin(), each.end());
  take_up_kept();
  ++counts_.detections, counts_.pairs = long(pairs_.size());
}

void OffsetContact::add_pair(bool self, bool edges, std::uint32_t first, std::uint32_t second,
                             std::vector<Pair>& found) const {
  Pair pair{.edges = edges, .first = first, .second = second, .vertices = {}, .offset = 0};
  std::uint32_t body, other;
  if (edges) {
    const Surfaces::Edge &a = surfaces_.edges[first], &b = surfaces_.edges[second];
    pair.vertices = {a.ends[0], a.ends[1], b.ends[0], b.ends[1]}, body = a.body, other = b.body;
  } else {
    const Triangle& t = model_->rest.surface[second];
    pair.vertices = {first, t[0], t[1], t[2]};
    body = surfaces_.triangle_bodies[surfaces_.own_triangle[first]], other = surfaces_.triangle_bodies[second];
  }
  if (body == other && !self) return;
  const std::size_t own = edges ? 2 : 1;
  for (std::size_t i = 0; i < own; ++i)
    for (std::size_t j = own; j < 4; ++j)
      if (pair.vertices[i] == pair.vertices[j]) return;
  std::array<double, 2> margins{0, 0};
  pair.offset = INFINITY;
  for (std::size_t k = 0; k < 4; ++k) {
    const std::uint32_t i = pair.vertices[k];
    double& margin = margins[pair.side_of(k)];
    margin = std::max(margin, margins_[i]), pair.offset = std::min(pair.offset, surfaces_.offsets[i]);
  }
  if (margins[0] + margins[1] == 0) return;  // neither moves
  const double distance = proximity(pair, start_).distance, margin = (margins[0] + margins[1]) / 2;
  if (distance > pair.offset + margin) return;
  // What is near from the start must not be pressed apart by its offset: that would be energy from nothing.
  const double given = body == other ? REST_PART * proximity(pair, model_->rest.positions).distance
                                     : std::max(proximity(pair, model_->positions).distance, LEAST_PART * pair.offset);
  pair.offset = std::min(pair.offset, given);
  if (distance > pair.offset + margin) return;
  found.push_back(pair);
}

void OffsetContact::evaluate_pairs() {
  parallel_for(pairs_.size(), 256, [&](std::size_t p) {
    Pair& pair = pairs_[p];
    pair.near = proximity(pair, start_);
    pair.belongs =
        glsl::SurfaceFormulas{{}, *model_, surfaces_, start_}.belongs(pair.near, pair.edges, pair.first, pair.second);
  });
}

Proximity OffsetContact::proximity(const Pair& pair, const Points& x) const {
  const auto at = [&](std::size_t k) { return x[pair.vertices[k]] - x[pair.vertices[0]]; };
  return pair.edges ? Formulas<double>{}.edge_edge_proximity(at(1), at(2), at(3))
                    : Formulas<double>{}.vertex_triangle_proximity(at(1), at(2), at(3));
}

OffsetContact::Ways OffsetContact::ways_of(const Pair& pair, const Points& x) const {
  Ways ways;
  for (std::size_t k = 0; k < 4; ++k) ways[k] = x[pair.vertices[k]] - start_[pair.vertices[k]];
  return ways;
}

// For the next substep: frozen, so that they sum to one at each vertex.
void OffsetContact::share_masses(Pair& pair, Ways ways) const {
  pair.shares = {};
  if (!pair.belongs || !Formulas<double>{}.touches_soon(pair.near, ways.data(), pair.offset)) return;
  for (std::size_t k = 0; k < 4; ++k) pair.shares[k] = std::uint8_t(Formulas<double>{}.mass_share(pair.near, int(k)));
}

void OffsetContact::apply_impulses(const Settings& settings, double push_limit, Substep& substep) {
  auto& [x, v, weights, h] = substep;
  Formulas<double> f;
  std::vector<int> shared(x.size(), 0);
  for (const Pair& pair : pairs_)
    for (std::size_t k = 0; k < 4; ++k) shared[pair.vertices[k]] += pair.shares[k];
  Points stopped(x.size(), glm::dvec3(0)), pushed = stopped;
  counts_.touching = 0;
  for (Pair& pair : pairs_) {
    pair.push = 0;
    if (!pair.acts()) continue;
    ++counts_.touching;
    counts_.nearest = std::min(counts_.nearest, pair.near.distance / pair.offset);
    if (const auto [own, other] = hard_sides(pair); own || other) continue;
    std::array<double, 4> split;
    for (std::size_t k = 0; k < 4; ++k)
      split[k] = weights[pair.vertices[k]] * shared[pair.vertices[k]] / double(pair.shares[k]);
    Ways ways = ways_of(pair, x);
    const bool turns = all_move(pair, weights);
    const auto m = f.meet(pair.near, ways.data(), split.data(), turns);
    if (!(m.weight > 0)) continue;
    const double stop = f.stopping_impulse(pair.near, m, pair.offset),
                 slip = f.slip_impulse(m, stop, mean_of_bodies(friction_of, settings, pair));
    pair.push = f.push_apart(pair.near, m, pair.offset, push_limit);
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t i = pair.vertices[k];
      stopped[i] += weights[i] * f.impulse_on(int(k), pair.near, m, stop, slip, turns);
      pushed[i] += (weights[i] * pair.near.weights[k] * pair.push) * pair.near.normal;
    }
  }
  solve_hard_pairs(settings, push_limit, shared, substep, stopped, pushed);
  for (const std::uint32_t i : surfaces_.vertices) v[i] += stopped[i] / h, x[i] += stopped[i];
  turn_pushed(substep);
  for (const std::uint32_t i : surfaces_.vertices) x[i] += pushed[i];
  move_hard_bodies(substep);
}

double OffsetContact::mean_of_bodies(double (*of)(const Settings&, std::size_t), const Settings& settings,
                                     const Pair& pair) const {
  const auto own = [&](std::uint32_t vertex) { return of(settings, body_at(*model_, vertex).number); };
  return Formulas<double>{}.mean_of_surfaces(own(pair.vertices[0]), own(pair.vertices[3]));
}

bool OffsetContact::all_move(const Pair& pair, const std::vector<double>& weights) {
  return std::ranges::all_of(pair.vertices, [&](std::uint32_t i) { return weights[i] > 0; });
}

// Pushes that are yet to come turn what slips: a little of the velocities goes along.
void OffsetContact::turn_pushed(Substep& substep) {
  auto& [x, v, weights, h] = substep;
  Points turned(x.size(), glm::dvec3(0));
  for (const Pair& pair : pairs_) {
    if (!(pair.push > 0) || !all_move(pair, weights)) continue;
    Ways ways = ways_of(pair, x);
    glm::dvec3 way(0);
    for (std::size_t k = 0; k < 4; ++k) way += pair.near.weights[k] * ways[k];
    for (std::size_t k = 0; k < 4; ++k)
      turned[pair.vertices[k]] +=
          weights[pair.vertices[k]] * Formulas<double>{}.push_turn(int(k), pair.near, way, pair.push);
  }
  for (const std::uint32_t i : surfaces_.vertices) v[i] += turned[i] / h;
}

double OffsetContact::kinetic_energy(const Substep& substep) const {
  double sum = 0;
  for (const std::uint32_t i : surfaces_.vertices)
    if (substep.weights[i] > 0) sum += 0.5 / substep.weights[i] * glm::dot(substep.v[i], substep.v[i]);
  return sum;
}

// Cuts ways short that would take a surface through another: each side of a pair may cross a part of the gap between
// them, by how fast it comes. Velocities are cut with the ways.
void OffsetContact::truncate(Substep& substep) {
  auto& [x, v, weights, h] = substep;
  std::vector<double> part(x.size(), 1);
  for (const Pair& pair : pairs_) {
    glm::dvec2 sides(0);
    const auto own = [&](std::size_t k) {
      const std::uint32_t i = pair.vertices[k];
      return (int(pair.side_of(k)) == 0 ? -1 : 1) * glm::dot(pair.near.normal, x[i] - start_[i]);
    };
    for (std::size_t k = 0; k < 4; ++k) {
      double& of_side = sides[int(pair.side_of(k))];
      of_side = std::max(of_side, own(k));
    }
    for (std::size_t k = 0; k < 4; ++k)
      part[pair.vertices[k]] =
          std::min(part[pair.vertices[k]],
                   Formulas<double>{}.allowed_part(pair.near, pair.offset, sides, int(pair.side_of(k)), own(k)));
  }
  for (const std::uint32_t i : surfaces_.vertices) {
    const glm::dvec3 way = x[i] - start_[i];
    if (!(weights[i] > 0) && way == glm::dvec3(0)) continue;
    // What is not listed is at least half of both margins apart.
    const double away = glm::distance(start_[i] + part[i] * way, listed_[i]), most = limit_part * margins_[i];
    if (away > most)
      part[i] *= std::clamp((most - glm::distance(start_[i], listed_[i])) / (part[i] * glm::length(way)), 0.0, 1.0);
  }
  for (std::size_t b = 0; b < hard_.size(); ++b) {  // rigid bodies are cut as a whole
    const auto first = part.begin() + std::ptrdiff_t(model_->bodies[b].first_vertex),
               end = first + std::ptrdiff_t(model_->bodies[b].vertices);
    if (hard_[b].moves) std::fill(first, end, *std::min_element(first, end));
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    const glm::dvec3 way = x[i] - start_[i];
    if (part[i] == 1) continue;
    ++counts_.truncated;
    if (weights[i] > 0) counts_.truncated_momentum += (part[i] - 1) * v[i] / weights[i];
    x[i] = start_[i] + part[i] * way, v[i] *= part[i];
  }
}

}  // namespace tetpbd
