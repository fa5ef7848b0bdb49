#include "sim/contact/offset_contact.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "sim/contact/cell_grid.h"
#include "sim/contact/pairs.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

using glsl::ProximityFormulas;
using Proximity = ProximityFormulas::Proximity;

constexpr double ahead = 3;           // substeps before which a pair that will touch gets its share
constexpr double push_to = 0.95;      // of the offset, that places keep; the rest is room to rest in
constexpr double push_part = 0.5;     // of what is missing to that, made up in a substep
constexpr double least_gap = 0.02;    // of the offset, below which nothing moves on
constexpr double gap_part = 0.9;      // of the gap, which both sides together may cross in a substep
constexpr double least_part = 0.1;    // of the offset, which bodies that touch from the start keep
constexpr double rest_part = 0.5;     // of a distance at rest, which the offset within a body may be at most
constexpr double reserve = 16;        // times the longest motion in a substep: a list holds for some
constexpr double motion_part = 0.49;  // of the margin, which keeps what is not listed apart

int side_of(bool edges, std::size_t k) { return (edges ? k < 2 : k == 0) ? 0 : 1; }
auto key_of(const auto& pair) { return std::tuple(bool(pair.edges), pair.first, pair.second); }

}  // namespace

void OffsetContact::begin(const Settings& settings, const Points& x) {
  if (bodies_touch(*model_, settings))
    start_ = x;
  else
    start_.clear(), listed_.clear();
}

void OffsetContact::resolve(const Settings& settings, Points& x, Points& v, std::vector<State::Touching>& touching,
                            const std::vector<double>& inverse_masses, double h, double push_limit) {
  if (start_.empty()) return touching.clear();
  if (surfaces_.vertices.empty()) surfaces_ = lay_out_surfaces(*model_);
  Substep substep{x, v, inverse_masses, h};
  if (!list_holds(x)) {
    set_margins(x, inverse_masses);
    find_pairs(settings.contact == "self");
  }
  evaluate_pairs();
  take_shares(touching);
  touching = next_touching(substep);
  const double before = kinetic_energy(substep);
  apply_impulses(settings, substep);
  push_apart(push_limit, substep);
  counts_.gained += std::max(0.0, kinetic_energy(substep) - before);
  truncate(substep);
}

// Whether all pairs are listed that this substep may ask for: those that touch, or will in `ahead` such substeps.
bool OffsetContact::list_holds(const Points& x) const {
  if (listed_.empty()) return false;
  return std::ranges::all_of(surfaces_.vertices, [&](std::uint32_t i) {
    const double away = glm::distance(start_[i], listed_[i]), way = glm::distance(x[i], start_[i]);
    return away == 0 || away + ahead * way <= 0.5 * margins_[i];
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
          {2 * surfaces_.offsets[i], 2 * ahead * longest, std::min(reserve * longest, 8 * surfaces_.offsets[i])});
}

OffsetContact::Extents OffsetContact::find_extents() const {
  Extents result;
  for (const Body& body : model_->bodies) {
    result.boxes.push_back(body_bounds(body, start_));
    const auto first = margins_.begin() + std::ptrdiff_t(body.first_vertex);
    result.margins.push_back(*std::max_element(first, first + std::ptrdiff_t(body.vertices)));
  }
  double edge = 0;
  for (const Surfaces::Edge& e : surfaces_.edges) edge += glm::distance(start_[e.ends[0]], start_[e.ends[1]]);
  edge /= double(std::max<std::size_t>(surfaces_.edges.size(), 1));
  result.cell = 2 * edge + std::ranges::max(result.margins);
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
  pairs_.clear();
  for (const std::vector<Pair>& each : found) pairs_.insert(pairs_.end(), each.begin(), each.end());
  ++counts_.detections, counts_.pairs = long(pairs_.size());
}

void OffsetContact::add_pair(bool self, bool edges, std::uint32_t first, std::uint32_t second,
                             std::vector<Pair>& found) const {
  Pair pair{edges, first, second, {}, 0, {}};
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
    double& margin = margins[std::size_t(side_of(edges, k))];
    margin = std::max(margin, margins_[i]), pair.offset = std::min(pair.offset, surfaces_.offsets[i]);
  }
  if (margins[0] + margins[1] == 0) return;  // neither moves
  const double distance = proximity(pair, start_).distance, margin = (margins[0] + margins[1]) / 2;
  if (distance > pair.offset + margin) return;
  // What is near from the start must not be pressed apart by its offset: that would be energy from nothing.
  const double given = body == other ? rest_part * proximity(pair, model_->rest.positions).distance
                                     : std::max(proximity(pair, model_->positions).distance, least_part * pair.offset);
  pair.offset = std::min(pair.offset, given);
  if (distance > pair.offset + margin) return;
  found.push_back(pair);
}

void OffsetContact::evaluate_pairs() {
  parallel_for(pairs_.size(), 256, [&](std::size_t p) {
    Pair& pair = pairs_[p];
    pair.near = proximity(pair, start_), pair.belongs = belongs(pair), pair.acts = false;
  });
}

Proximity OffsetContact::proximity(const Pair& pair, const Points& x) const {
  const auto at = [&](std::size_t k) { return x[pair.vertices[k]] - x[pair.vertices[0]]; };
  return pair.edges ? ProximityFormulas{}.edge_edge_proximity(at(1), at(2), at(3))
                    : ProximityFormulas{}.vertex_triangle_proximity(at(1), at(2), at(3));
}

bool OffsetContact::belongs(const Pair& pair) const {
  const int part = pair.near.part;
  const glm::dvec3& n = pair.near.normal;
  if (pair.edges) return part == 0 && leads_off_edge(pair.first, -n) && leads_off_edge(pair.second, n);
  if (part == 0) return true;
  if (part < 4) {
    const std::uint32_t edge = surfaces_.triangle_edges[pair.second][std::size_t(part - 1)];
    const std::uint32_t third = model_->rest.surface[pair.second][std::size_t(part + 1) % 3];
    return surfaces_.edges[edge].beside[0] == third && leads_off_edge(edge, n);
  }
  const std::uint32_t corner = pair.vertices[std::size_t(part - 3)];
  return surfaces_.own_triangle[corner] == pair.second && pair.first < corner && leads_off_vertex(corner, n) &&
         leads_off_vertex(pair.first, -n);
}

bool OffsetContact::leads_off_edge(std::uint32_t edge, const glm::dvec3& to) const {
  const Surfaces::Edge& e = surfaces_.edges[edge];
  const glm::dvec3 &a = start_[e.ends[0]], along = start_[e.ends[1]] - a;
  return std::ranges::all_of(e.beside, [&](std::uint32_t beside) {
    if (beside == Surfaces::none) return true;
    const glm::dvec3 across = start_[beside] - a;
    return ProximityFormulas{}.leads_away(to, across - along * (glm::dot(across, along) / glm::dot(along, along)));
  });
}

bool OffsetContact::leads_off_vertex(std::uint32_t vertex, const glm::dvec3& to) const {
  const auto begin = surfaces_.neighbours.begin();
  const std::uint32_t first = surfaces_.first_neighbour[vertex], end = surfaces_.first_neighbour[vertex + 1];
  return std::all_of(begin + first, begin + end, [&](std::uint32_t next) {
    return ProximityFormulas{}.leads_away(to, start_[next] - start_[vertex]);
  });
}

// Those of the substep before: frozen, so that they sum to one at each vertex.
void OffsetContact::take_shares(const std::vector<State::Touching>& touching) {
  shared_.assign(start_.size(), 0);
  auto before = touching.begin();
  for (Pair& pair : pairs_) {
    while (before != touching.end() && key_of(*before) < key_of(pair)) ++before;
    if (before == touching.end() || key_of(*before) != key_of(pair) || !pair.belongs) continue;
    pair.acts = true, pair.shares = before->shares;
    for (std::size_t k = 0; k < 4; ++k) shared_[pair.vertices[k]] += pair.shares[k];
  }
}

std::vector<State::Touching> OffsetContact::next_touching(const Substep& substep) const {
  std::vector<State::Touching> touching;
  for (const Pair& pair : pairs_) {
    if (!pair.belongs) continue;
    double approach = 0;  // m, in this substep
    for (std::size_t k = 0; k < 4; ++k)
      approach +=
          pair.near.weights[k] * glm::dot(pair.near.normal, substep.x[pair.vertices[k]] - start_[pair.vertices[k]]);
    if (pair.near.distance + ahead * std::min(0.0, approach) >= pair.offset) continue;
    State::Touching& next = touching.emplace_back(State::Touching{pair.edges, pair.first, pair.second, {}});
    for (std::size_t k = 0; k < 4; ++k)
      next.shares[k] = std::uint8_t(std::clamp(
          std::round(255 * std::max(std::abs(pair.near.weights[k]), glm::length(pair.near.turns[k]))), 1.0, 255.0));
  }
  return touching;
}

// Inelastic, on the part of each vertex's mass that is the pair's, so that kinetic energy cannot rise.
void OffsetContact::apply_impulses(const Settings& settings, Substep& substep) {
  const auto& [x, v, weights, h] = substep;
  changes_.assign(x.size(), glm::dvec3(0));
  counts_.touching = 0;
  for (const Pair& pair : pairs_) {
    if (!pair.acts) continue;
    ++counts_.touching;
    counts_.nearest = std::min(counts_.nearest, pair.near.distance / pair.offset);
    const Meeting meeting = meet(pair, substep);
    if (!(meeting.weight > 0)) continue;
    const auto& [b, e, n, distance, part] = pair.near;
    const auto friction = [&](std::uint32_t vertex) {
      return body_at(*model_, vertex).friction.value_or(settings.friction);
    };
    const double both = Formulas<double>{}.mean_friction(friction(pair.vertices[0]), friction(pair.vertices[3]));
    const double stop = std::max(0.0, -meeting.along - std::max(0.0, distance - pair.offset) / h) / meeting.weight;
    const double size = glm::length(meeting.slip);
    const double grip = size > 0 ? std::min(1 / meeting.slip_weight, both * stop / size) : 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t i = pair.vertices[k];
      glm::dvec3 impulse = b[k] * (stop * n - grip * meeting.slip);
      if (meeting.turns) impulse -= grip * glm::dot(e[k], meeting.slip) * n;
      changes_[i] += weights[i] * impulse;
    }
  }
  change_velocities(substep);
}

// Moves what is nearer than its offset apart, in place alone. As that turns what slips, a little of the velocities
// goes along.
void OffsetContact::push_apart(double push_limit, Substep& substep) {
  auto& [x, v, weights, h] = substep;
  changes_.assign(x.size(), glm::dvec3(0));
  Points places(x.size(), glm::dvec3(0));
  for (const Pair& pair : pairs_) {
    const double missing = push_to * pair.offset - pair.near.distance;
    if (!pair.acts || missing <= 0) continue;
    const Meeting meeting = meet(pair, substep);
    if (!(meeting.weight > 0)) continue;
    const double push = std::min(push_part * missing, push_limit * pair.offset) / meeting.weight;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t i = pair.vertices[k];
      places[i] += (weights[i] * pair.near.weights[k] * push) * pair.near.normal;
      if (meeting.turns)
        changes_[i] += (weights[i] * push / pair.near.distance * glm::dot(pair.near.turns[k], meeting.velocity)) *
                       pair.near.normal;
    }
  }
  change_velocities(substep);
  for (const std::uint32_t i : surfaces_.vertices) x[i] += places[i];
}

OffsetContact::Meeting OffsetContact::meet(const Pair& pair, const Substep& substep) const {
  const auto& [b, e, n, distance, part] = pair.near;
  Meeting m;
  std::array<double, 4> weight;  // 1/kg, of the pair's part of the mass
  for (std::size_t k = 0; k < 4; ++k) {
    const std::uint32_t i = pair.vertices[k];
    weight[k] = substep.weights[i] * shared_[i] / double(pair.shares[k]);
    m.turns = m.turns && substep.weights[i] > 0;
  }
  for (std::size_t k = 0; k < 4; ++k) {
    const std::uint32_t i = pair.vertices[k];
    const glm::dvec3 velocity = (substep.x[i] - start_[i]) / substep.h;
    m.along += b[k] * glm::dot(n, velocity), m.weight += b[k] * b[k] * weight[k];
    m.velocity += b[k] * velocity;
    if (m.turns) m.slip += glm::dot(n, velocity) * e[k];
  }
  m.slip += m.velocity;
  m.slip -= glm::dot(m.slip, n) * n;
  const double size = glm::length(m.slip);
  for (std::size_t k = 0; k < 4; ++k) {
    const double turn = m.turns && size > 0 ? glm::dot(e[k], m.slip) / size : 0;
    m.slip_weight += (b[k] * b[k] + turn * turn) * weight[k];
  }
  return m;
}

void OffsetContact::change_velocities(Substep& substep) {
  for (const std::uint32_t i : surfaces_.vertices) substep.x[i] += substep.h * changes_[i], substep.v[i] += changes_[i];
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
    std::array<double, 2> approach{0, 0};
    const auto way = [&](std::size_t k) {
      const std::uint32_t i = pair.vertices[k];
      return (side_of(pair.edges, k) == 0 ? -1 : 1) * glm::dot(pair.near.normal, x[i] - start_[i]);
    };
    for (std::size_t k = 0; k < 4; ++k) {
      double& of_side = approach[std::size_t(side_of(pair.edges, k))];
      of_side = std::max(of_side, way(k));
    }
    const double both = approach[0] + approach[1];
    const double most = gap_part * std::max(0.0, pair.near.distance - least_gap * pair.offset);
    if (both <= most) continue;
    for (std::size_t k = 0; k < 4; ++k) {
      const double limit = most * approach[std::size_t(side_of(pair.edges, k))] / both, own = way(k);
      if (own > limit) part[pair.vertices[k]] = std::min(part[pair.vertices[k]], limit / own);
    }
  }
  for (const std::uint32_t i : surfaces_.vertices) {
    if (!(weights[i] > 0)) continue;
    const glm::dvec3 way = x[i] - start_[i];
    // What is not listed is at least half of both margins apart.
    const double away = glm::distance(start_[i] + part[i] * way, listed_[i]), most = motion_part * margins_[i];
    if (away > most)
      part[i] *= std::clamp((most - glm::distance(start_[i], listed_[i])) / (part[i] * glm::length(way)), 0.0, 1.0);
    if (part[i] == 1) continue;
    ++counts_.truncated;
    counts_.truncated_momentum += (part[i] - 1) * v[i] / weights[i];
    x[i] = start_[i] + part[i] * way, v[i] *= part[i];
  }
}

}  // namespace tetpbd
