// Contact of bodies with each other and themselves on the CPU, in double: what pairs.h does on the GPU, with a broad
// phase in each substep.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "sim/contact/cell_grid.h"
#include "sim/contact/pairs.h"
#include "sim/measure/overlap.h"
#include "sim/model/formulas.h"
#include "sim/model/settings.h"

namespace tetpbd {

class PairContact {
 public:
  explicit PairContact(const Model& model) : model_(&model) {}
  void change_model(const Model& model) { model_ = &model; }
  /// Corrects positions `x` and velocities `v` after a substep of `h`; `held`: the triangle that each vertex is in.
  void resolve(const Settings& settings, std::vector<glm::dvec3>& x, std::vector<glm::dvec3>& v,
               std::vector<State::Held>& held, const std::vector<double>& inverse_masses, double h) {
    if (!bodies_touch(*model_, settings)) return held.clear();
    self_ = settings.contact == "self";
    if (mesh_.triangles.empty()) mesh_ = pair_mesh(*model_), add_tets(model_->rest, mesh_);
    double fastest = 0;
    for (const glm::dvec3& velocity : v) fastest = std::max(fastest, glm::length(velocity));
    double margin = std::min(std::max(pair_margin(mesh_), 2.2 * fastest * h), model_->size) + mesh_.thickness;
    if (held.empty()) margin += 2 * measure_overlap(*model_, x, self_).deepest;  // bodies may overlap at the start
    const std::vector<Contact> contacts = find_contacts(x, margin, held);
    std::vector<int> counts(x.size(), 0);
    for (const Contact& c : contacts)
      for (std::size_t j = 0; j < 4; ++j) counts[c.vertices[j]] += c.geometry.weights[j] != 0;
    std::vector<glm::dvec3> stopped(x.size(), glm::dvec3(0));
    for (const auto& [vertices, geometry, held_by] : contacts) {
      glm::dvec3 displacement(0);
      double weight = 0;
      for (std::size_t j = 0; j < 4; ++j) {
        const double b = geometry.weights[j];
        displacement += b * h * v[vertices[j]];
        weight += b * b * inverse_masses[vertices[j]] * counts[vertices[j]];
      }
      if (!(weight > 0)) continue;
      const double push_most = mesh_.edge / 10;  // correct.glsl
      const auto friction = [&](std::uint32_t vertex) {
        return body_at(*model_, vertex).friction.value_or(settings.friction);
      };
      const double both = Rules{}.mean_friction(friction(vertices[0]), friction(vertices[3]));
      const auto by = Rules{}.contact_correction(geometry, displacement, push_most, both);
      for (std::size_t j = 0; j < 4; ++j) {
        const double factor = geometry.weights[j] * inverse_masses[vertices[j]] / weight;
        x[vertices[j]] += factor * (by.stopped + by.pushed), stopped[vertices[j]] += factor * by.stopped;
      }
    }
    for (std::size_t i = 0; i < x.size(); ++i) v[i] += stopped[i] / h;
  }

 private:
  using Rules = Formulas<double>;
  using Positions = std::vector<glm::dvec3>;
  struct Contact {
    std::array<std::uint32_t, 4> vertices;
    Rules::Contact geometry;
    State::Held held_by;  // of a vertex
  };

  // The triangle that each vertex is in and the edge that each sharp edge crosses, if any: the nearest in the margin.
  std::vector<Contact> find_contacts(const Positions& x, double margin, std::vector<State::Held>& held) {
    boxes_.assign(model_->bodies.size(), Bounds{glm::dvec3(1e30), glm::dvec3(-1e30)});
    for (const auto& [vertex, body] : mesh_.vertices) {
      boxes_[body].low = glm::min(boxes_[body].low, x[vertex]);
      boxes_[body].high = glm::max(boxes_[body].high, x[vertex]);
    }
    std::vector<Contact> contacts;
    find_vertex_contacts(x, find_reaches(x, margin, held), held, contacts);
    find_edge_contacts(x, margin, contacts);
    return contacts;
  }
  // Whether another body, or with contact of bodies with themselves any, may be that near to a box.
  bool may_touch(std::uint32_t body, const Bounds& box, double reach) const {
    const glm::dvec3 low = box.low - reach, high = box.high + reach;
    for (std::uint32_t b = 0; b < boxes_.size(); ++b)
      if (b != body && glm::all(glm::greaterThanEqual(high, boxes_[b].low)) &&
          glm::all(glm::lessThanEqual(low, boxes_[b].high)))
        return true;
    return self_;
  }
  // Whether parts of one body cannot touch, because some of these vertices are near each other at rest.
  bool are_neighbours(std::span<const std::uint32_t> some, std::span<const std::uint32_t> others,
                      std::uint32_t body) const {
    const double apart = mesh_.thicknesses[body] > 0 ? 0 : 2.4 * mesh_.edge;
    const auto& rest = model_->rest.positions;
    return !self_ || std::ranges::any_of(some, [&](std::uint32_t a) {
      return std::ranges::any_of(others, [&](std::uint32_t b) { return glm::distance(rest[a], rest[b]) <= apart; });
    });
  }
  // m, the radius of each vertex's search: of one deep in a body as far as its surface (reach_of, pairs.glsl).
  std::vector<double> find_reaches(const Positions& x, double margin, const std::vector<State::Held>& held) const {
    std::vector<double> reaches(mesh_.vertices.size(), margin);
    for (std::size_t s = 0; s < held.size(); ++s) {
      if (held[s].target == ~0u) continue;
      const auto& [i, j, k, body] = mesh_.triangles[held[s].target];
      const glm::dvec3 own = x[mesh_.vertices[s].vertex];
      const double far = std::abs(Rules{}.vertex_triangle_contact(x[i] - own, x[j] - own, x[k] - own).gap);
      if (far < 1e29) reaches[s] = std::max(margin, 1.05 * far + 0.5 * margin);
    }
    return reaches;
  }
  void find_vertex_contacts(const Positions& x, const std::vector<double>& reaches, std::vector<State::Held>& held,
                            std::vector<Contact>& contacts) const {
    CellGrid grid(1.2 * mesh_.edge);
    std::vector<glm::dvec3> normals(x.size(), glm::dvec3(0));
    const double most = std::ranges::max(reaches);
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& [i, j, k, body] = mesh_.triangles[t];
      const Bounds box{glm::min(x[i], glm::min(x[j], x[k])), glm::max(x[i], glm::max(x[j], x[k]))};
      if (may_touch(body, box, most)) grid.add(box, t);
      const glm::dvec3 n = glm::cross(x[j] - x[i], x[k] - x[i]);
      if (const double area = glm::length(n); area > 0)
        for (const std::uint32_t v : {i, j, k}) normals[v] += n / area;
    }
    const std::vector<State::Held> before = std::move(held);
    held.assign(mesh_.vertices.size(), {});
    for (std::uint32_t s = 0; s < mesh_.vertices.size(); ++s) {
      const auto& [vertex, body] = mesh_.vertices[s];
      if (!may_touch(body, {x[vertex], x[vertex]}, reaches[s])) continue;
      const Contact contact =
          find_vertex_contact(x, s, reaches[s], normals[vertex], grid, s < before.size() ? before[s] : State::Held{});
      if (contact.geometry.gap < 0) contacts.push_back(contact), held[s] = contact.held_by;
    }
  }
  // That of surface vertex s with the nearest triangle, or with one of whose body it is behind; else one with gap 0.
  Contact find_vertex_contact(const Positions& x, std::uint32_t s, double reach, const glm::dvec3& normal,
                              const CellGrid& grid, const State::Held& before) const {
    const auto& [vertex, body] = mesh_.vertices[s];
    Rules::Contact nearest{};
    nearest.gap = nearest.rank = reach;
    Contact best{};
    best.geometry.rank = reach;
    std::vector<Contact> deeper;  // in whose body the vertex may be although another triangle is nearer
    grid.for_each({x[vertex] - reach, x[vertex] + reach}, [&](std::uint32_t t) {
      const Contact contact = vertex_contact(x, s, t, before);
      const Rules::Contact& geometry = contact.geometry;
      if (geometry.rank < nearest.rank) nearest = geometry;
      const bool sheets = mesh_.thicknesses[body] > 0 || mesh_.thicknesses[mesh_.triangles[t][3]] > 0;
      if (geometry.rank >= reach || !(sheets || Rules{}.opposes(geometry, normal))) return;
      if (geometry.gap < 0 || geometry.in_doubt) deeper.push_back(contact);
      if (geometry.rank < best.geometry.rank) best = contact;
    });
    if (nearest.gap <= 0) return best;
    // meet.comp does this with the nearest eight triangles, because it knows no others.
    std::ranges::sort(deeper, {}, [](const Contact& c) { return std::pair(c.geometry.rank, c.held_by.target); });
    const auto found = std::ranges::find_if(deeper, [&](const Contact& c) {
      return (c.geometry.gap < 0 || nearest.in_doubt) && is_behind(x, vertex, c.held_by.target);
    });
    if (found == deeper.end()) return {};
    if (Rules::Contact& c = found->geometry; c.gap > 0) c.gap = -c.gap, c.normal = -c.normal;
    return *found;
  }
  // Between surface vertex s and triangle t; far away if they cannot touch.
  Contact vertex_contact(const Positions& x, std::uint32_t s, std::uint32_t t, const State::Held& before) const {
    const auto& [vertex, body] = mesh_.vertices[s];
    const auto& [i, j, k, other] = mesh_.triangles[t];
    Contact far{};
    far.geometry.gap = far.geometry.rank = 1e30;
    if (other == body && are_neighbours({&vertex, 1}, {&mesh_.triangles[t][0], 3}, body)) return far;
    const double thickness = double(mesh_.thicknesses[body]), other_thickness = double(mesh_.thicknesses[other]);
    const glm::dvec3 a = x[i] - x[vertex], b = x[j] - x[vertex], c = x[k] - x[vertex];
    Rules::Contact geometry = Rules{}.vertex_triangle_contact(a, b, c);
    bool under = false;
    if (other_thickness > 0) {  // query.comp
      const bool was_near = before.target != ~0u && share_a_vertex(before.target, t);
      under = was_near ? before.under != 0 : glm::dot(geometry.face, a) > 0;
      geometry = Rules{}.vertex_sheet_contact(geometry, a, b, c, under);
    }
    if (other == body && std::abs(geometry.gap) > pair_margin(mesh_)) return far;  // a thin part's other side
    geometry.gap -= std::max(thickness, other_thickness);
    geometry.in_doubt = geometry.in_doubt && thickness == 0 && other_thickness == 0;
    return {{vertex, i, j, k}, geometry, {t, under ? 1u : 0u}};
  }
  void find_edge_contacts(const Positions& x, double margin, std::vector<Contact>& contacts) const {
    CellGrid grid(1.2 * mesh_.edge);
    const auto box = [&](const PairMesh::Edge& e) { return bounds({x[e.vertex[0]], x[e.vertex[1]]}); };
    for (std::uint32_t e = 0; e < mesh_.edges.size(); ++e)
      if (const Bounds b = box(mesh_.edges[e]); may_touch(mesh_.edges[e].body, b, margin)) grid.add(b, e);
    for (std::size_t s = 0; s < mesh_.edges.size(); ++s) {
      const PairMesh::Edge& own = mesh_.edges[s];
      const Bounds b = box(own);
      if (!may_touch(own.body, b, margin)) continue;
      Contact best{};
      best.geometry.rank = margin;
      const auto from_own = [&](std::uint32_t i) { return x[i] - x[own.vertex[0]]; };
      const glm::dvec3 p = from_own(own.vertex[1]), left = from_own(own.beside[0]), right = from_own(own.beside[1]);
      grid.for_each({b.low - margin, b.high + margin}, [&](std::uint32_t e) {
        if (e <= s) return;  // the first of two edges finds the second
        const PairMesh::Edge& other = mesh_.edges[e];
        if (other.body == own.body && are_neighbours(own.vertex, other.vertex, own.body)) return;
        const glm::dvec3 q = from_own(other.vertex[0]), r = from_own(other.vertex[1]),
                         other_left = from_own(other.beside[0]), other_right = from_own(other.beside[1]);
        const auto geometry = Rules{}.edge_edge_contact(p, left, right, q, r, other_left, other_right);
        if (!(geometry.gap < 0 && geometry.rank < best.geometry.rank)) return;
        if (other.body == own.body && -geometry.gap > pair_margin(mesh_)) return;
        if (Rules{}.edges_oppose(p, left, right, q, r, other_left, other_right))
          best = {{own.vertex[0], own.vertex[1], other.vertex[0], other.vertex[1]}, geometry, {}};
      });
      if (best.geometry.rank < margin) contacts.push_back(best);
    }
  }
  bool is_behind(const Positions& x, std::uint32_t vertex, std::uint32_t triangle) const {  // contact.glsl
    std::uint32_t tet = mesh_.behind[triangle];
    for (int turn = 0; turn < 6 && tet != PairMesh::none; ++turn) {
      const auto at = [&](std::size_t k) { return x[mesh_.tets[tet][k]] - x[vertex]; };
      const auto [parts] = Rules{}.tet_parts(at(0), at(1), at(2), at(3));
      const double whole = std::accumulate(parts, parts + 4, 0.0);
      if (!(whole > 0)) return false;
      const auto least = std::ranges::min_element(parts);
      const auto small = std::ranges::count_if(parts, [&](double p) { return p <= 1e-3 * whole; });
      tet = mesh_.beyond[tet][std::size_t(least - parts)];
      if (small == 0 || (small == 1 && tet != PairMesh::none && *least >= -1e-3 * whole)) return true;
    }
    return false;
  }
  bool share_a_vertex(std::uint32_t a, std::uint32_t b) const {
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        if (mesh_.triangles[a][i] == mesh_.triangles[b][j]) return true;
    return false;
  }

  const Model* model_;
  bool self_ = false;
  PairMesh mesh_;              // made with the first contacts
  std::vector<Bounds> boxes_;  // of bodies
};

}  // namespace tetpbd
