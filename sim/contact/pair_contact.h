// Contact of bodies with each other and themselves in double, on the CPU: what sim/contact/pairs.h does on
// the GPU, with the candidates found anew in each substep.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>

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
  /// After a substep of `h`: of places `x` and velocities `v`, and what vertices are `held` by.
  void resolve(const Settings& settings, std::vector<glm::dvec3>& x, std::vector<glm::dvec3>& v,
               std::vector<State::Held>& held, const std::vector<double>& inverse_masses, double h) {
    if (!bodies_touch(*model_, settings)) return held.clear();
    self_ = settings.contact == "self";
    if (mesh_.triangles.empty()) mesh_ = pair_mesh(*model_), add_tets(model_->rest, mesh_);
    double fastest = 0;
    for (const glm::dvec3& speed : v) fastest = std::max(fastest, glm::length(speed));
    double margin = std::min(std::max(pair_margin(mesh_), 2.2 * fastest * h), model_->size) + mesh_.thickness;
    if (held.empty()) margin += 2 * measure_overlap(*model_, x, self_).deepest;  // bodies that start in each other
    const auto contacts = find(x, margin, held);
    std::vector<int> counts(x.size(), 0);
    for (const Contact& c : contacts)
      for (std::size_t j = 0; j < 4; ++j) counts[c.vertices[j]] += c.meeting.weights[j] != 0;
    std::vector<glm::dvec3> stopped(x.size(), glm::dvec3(0));
    for (const auto& [vertices, m] : contacts) {
      glm::dvec3 way(0);
      double weight = 0;
      for (std::size_t j = 0; j < 4; ++j) {
        const double b = m.weights[j];
        way += b * h * v[vertices[j]];
        weight += b * b * inverse_masses[vertices[j]] * counts[vertices[j]];
      }
      if (!(weight > 0)) continue;
      const double push_most = mesh_.edge / 10;  // correct.glsl
      const auto friction = [&](std::uint32_t vertex) {
        return body_at(*model_, vertex).friction.value_or(settings.friction);
      };
      const double both = Formulas<double>{}.mean_friction(friction(vertices[0]), friction(vertices[3]));
      const auto by = Formulas<double>{}.meeting_correction(m, way, push_most, both);
      for (std::size_t j = 0; j < 4; ++j) {
        const double factor = m.weights[j] * inverse_masses[vertices[j]] / weight;
        x[vertices[j]] += factor * (by.stopped + by.pushed), stopped[vertices[j]] += factor * by.stopped;
      }
    }
    for (std::size_t i = 0; i < x.size(); ++i) v[i] += stopped[i] / h;
  }

 private:
  using Meeting = Formulas<double>::Meeting;
  struct Contact {
    std::array<std::uint32_t, 4> vertices;
    Meeting meeting;
  };
  bool neighbours(std::uint32_t a, std::uint32_t b, std::uint32_t body) const {
    const double apart = mesh_.thicknesses[body] > 0 ? 0 : 2.4 * mesh_.edge;
    return glm::distance(model_->rest.positions[a], model_->rest.positions[b]) <= apart;
  }
  struct Near {  // whether another body is there, or the same is asked for as well
    std::vector<Bounds> boxes;
    bool self;
    bool operator()(std::uint32_t body, const glm::dvec3& low, const glm::dvec3& high) const {
      for (std::uint32_t b = 0; b < boxes.size(); ++b)
        if (b != body && glm::all(glm::greaterThanEqual(high, boxes[b].low)) &&
            glm::all(glm::lessThanEqual(low, boxes[b].high)))
          return true;
      return self;
    }
  };
  // The triangle that each vertex is in, and the edge that each sharp one has crossed, if any: the nearest
  // within the margin.
  std::vector<Contact> find(const std::vector<glm::dvec3>& x, double margin, std::vector<State::Held>& held) {
    Near near{std::vector<Bounds>(model_->bodies.size(), Bounds{glm::dvec3(1e30), glm::dvec3(-1e30)}), self_};
    for (const auto& [vertex, body] : mesh_.vertices) {
      near.boxes[body].low = glm::min(near.boxes[body].low, x[vertex]);
      near.boxes[body].high = glm::max(near.boxes[body].high, x[vertex]);
    }
    std::vector<Contact> contacts;
    find_vertices(x, margin, near, held, contacts);
    find_edges(x, margin, near, contacts);
    return contacts;
  }
  // How far each vertex looks: one that is deep in a body, as far as its surface (reach_of, pairs.glsl).
  std::vector<double> reaches_of(const std::vector<glm::dvec3>& x, double margin,
                                 const std::vector<State::Held>& held) const {
    std::vector<double> reaches(mesh_.vertices.size(), margin);
    for (std::size_t s = 0; s < held.size(); ++s) {
      if (held[s].target == ~0u) continue;
      const auto& [i, j, k, body] = mesh_.triangles[held[s].target];
      const glm::dvec3 own = x[mesh_.vertices[s].vertex];
      const double far = std::abs(Formulas<double>{}.meet(x[i] - own, x[j] - own, x[k] - own).gap);
      if (far < 1e29) reaches[s] = std::max(margin, 1.05 * far + 0.5 * margin);
    }
    return reaches;
  }
  void find_vertices(const std::vector<glm::dvec3>& x, double margin, const Near& near,
                     std::vector<State::Held>& all_held, std::vector<Contact>& contacts) const {
    const std::vector<double> reaches = reaches_of(x, margin, all_held);
    const double most = std::ranges::max(reaches);
    CellGrid grid(1.2 * mesh_.edge);
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& [i, j, k, body] = mesh_.triangles[t];
      const glm::dvec3 low = glm::min(x[i], glm::min(x[j], x[k])), high = glm::max(x[i], glm::max(x[j], x[k]));
      if (near(body, low - most, high + most)) grid.add({low, high}, t);
    }
    std::vector<glm::dvec3> normals(x.size(), glm::dvec3(0));
    for (const auto& [i, j, k, body] : mesh_.triangles) {
      const glm::dvec3 n = glm::cross(x[j] - x[i], x[k] - x[i]);
      if (const double area = glm::length(n); area > 0)
        for (const std::uint32_t v : {i, j, k}) normals[v] += n / area;
    }
    std::vector<State::Held> held(mesh_.vertices.size());
    for (std::size_t s = 0; s < mesh_.vertices.size(); ++s) {
      const auto& [vertex, body] = mesh_.vertices[s];
      const glm::dvec3 own = x[vertex];
      const double reach = reaches[s];
      if (!near(body, own - reach, own + reach)) continue;
      const double thickness = double(mesh_.thicknesses[body]);
      Contact best{};
      best.meeting.rank = reach;
      Meeting nearest = best.meeting;
      nearest.gap = reach;
      std::vector<std::pair<Contact, State::Held>> deeper;  // behind which it is
      const State::Held was = s < all_held.size() ? all_held[s] : State::Held{};
      grid.for_each({own - reach, own + reach}, [&](std::uint32_t t) {
        const auto& [i, j, k, other] = mesh_.triangles[t];
        if (other == body &&
            (!self_ || neighbours(vertex, i, body) || neighbours(vertex, j, body) || neighbours(vertex, k, body)))
          return;
        const double other_thickness = double(mesh_.thicknesses[other]);
        const glm::dvec3 a = x[i] - own, b = x[j] - own, c = x[k] - own;
        auto m = Formulas<double>{}.meet(a, b, c);
        bool under = false;
        if (other_thickness > 0) {  // query.comp
          under = was.target != ~0u && share_a_vertex(was.target, t) ? was.under != 0 : glm::dot(m.face, a) > 0;
          m = Formulas<double>{}.meet_sheet(a, b, c, under);
        }
        if (other == body && std::abs(m.gap) > pair_margin(mesh_)) return;  // a thin part's other side
        m.gap -= std::max(thickness, other_thickness);
        m.in_doubt = m.in_doubt && thickness == 0 && other_thickness == 0;
        if (m.rank < nearest.rank) nearest = m;
        const bool sheets = thickness > 0 || other_thickness > 0;
        if (m.rank >= reach || !(sheets || Formulas<double>{}.opposes(m, normals[vertex]))) return;
        const Contact contact{{vertex, i, j, k}, m};
        const State::Held by{t, under ? 1u : 0u};
        if (m.gap < 0 || m.in_doubt) deeper.push_back({contact, by});
        if (m.rank < best.meeting.rank) best = contact, held[s] = by;
      });
      if (nearest.gap > 0) {  // meet.comp, where only the eight nearest are known
        std::ranges::sort(deeper, {}, [](const auto& d) { return std::pair(d.first.meeting.rank, d.second.target); });
        const auto found = std::ranges::find_if(deeper, [&](const auto& d) {
          return (d.first.meeting.gap < 0 || nearest.in_doubt) && is_behind(x, vertex, d.second.target);
        });
        if (found != deeper.end()) {
          nearest.gap = 0, best = found->first, held[s] = found->second;
          Meeting& m = best.meeting;
          if (m.gap > 0) m.gap = -m.gap, m.normal = -m.normal;
        }
      }
      if (best.meeting.rank < reach && best.meeting.gap < 0 && nearest.gap <= 0)
        contacts.push_back(best);
      else
        held[s] = {};
    }
    all_held = std::move(held);
  }
  void find_edges(const std::vector<glm::dvec3>& x, double margin, const Near& near,
                  std::vector<Contact>& contacts) const {
    CellGrid grid(1.2 * mesh_.edge);
    const auto box = [&](const PairMesh::Edge& e) { return bounds({x[e.vertex[0]], x[e.vertex[1]]}); };
    for (std::uint32_t e = 0; e < mesh_.edges.size(); ++e) {
      const Bounds b = box(mesh_.edges[e]);
      if (near(mesh_.edges[e].body, b.low - margin, b.high + margin)) grid.add(b, e);
    }
    for (std::size_t s = 0; s < mesh_.edges.size(); ++s) {
      const PairMesh::Edge& own = mesh_.edges[s];
      const Bounds b = box(own);
      if (!near(own.body, b.low - margin, b.high + margin)) continue;
      Contact best{};
      best.meeting.rank = margin;
      const auto from_own = [&](std::uint32_t i) { return x[i] - x[own.vertex[0]]; };
      const glm::dvec3 p = from_own(own.vertex[1]), left = from_own(own.beside[0]), right = from_own(own.beside[1]);
      grid.for_each({b.low - margin, b.high + margin}, [&](std::uint32_t e) {
        if (e <= s) return;  // of two edges, the first looks for the second
        const PairMesh::Edge& other = mesh_.edges[e];
        if (other.body == own.body && (!self_ || std::ranges::any_of(own.vertex, [&](std::uint32_t i) {
              return neighbours(i, other.vertex[0], own.body) || neighbours(i, other.vertex[1], own.body);
            })))
          return;
        const glm::dvec3 q = from_own(other.vertex[0]), r = from_own(other.vertex[1]),
                         other_left = from_own(other.beside[0]), other_right = from_own(other.beside[1]);
        Formulas<double> f;
        const auto m = f.meet_edges(p, left, right, q, r, other_left, other_right);
        if (!(m.gap < 0 && m.rank < best.meeting.rank)) return;
        if (other.body == own.body && -m.gap > pair_margin(mesh_)) return;
        if (f.edges_oppose(p, left, right, q, r, other_left, other_right))
          best = {{own.vertex[0], own.vertex[1], other.vertex[0], other.vertex[1]}, m};
      });
      if (best.meeting.rank < margin) contacts.push_back(best);
    }
  }
  bool is_behind(const std::vector<glm::dvec3>& x, std::uint32_t vertex, std::uint32_t triangle) const {
    std::uint32_t tet = mesh_.behind[triangle];
    for (int turn = 0; turn < 6 && tet != PairMesh::none; ++turn) {  // pairs/meeting.glsl
      const auto& [v, beyond] = mesh_.tets[tet];
      const auto at = [&](std::size_t k) { return x[v[k]] - x[vertex]; };
      const auto [parts] = Formulas<double>{}.tet_parts(at(0), at(1), at(2), at(3));
      const double whole = std::accumulate(parts, parts + 4, 0.0);
      if (!(whole > 0)) return false;
      const auto least = std::ranges::min_element(parts);
      const auto small = std::ranges::count_if(parts, [&](double p) { return p <= 1e-3 * whole; });
      tet = beyond[least - parts];
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
  PairMesh mesh_;  // made when something is to touch
};

}  // namespace tetpbd
