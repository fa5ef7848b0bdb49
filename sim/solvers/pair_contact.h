// Contact of bodies with each other and themselves in double, on the CPU: what sim/pairs.h does on the GPU,
// with the candidates found anew in each substep.
#pragma once

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "sim/formulas.h"
#include "sim/pairs.h"
#include "sim/settings.h"

namespace tetpbd {

class PairContact {
 public:
  PairContact(const Model& model, const Settings& settings)
      : model_(model),
        wanted_(bodies_touch(model, settings)),
        self_(settings.contact == "self"),
        friction_(settings.friction) {
    if (wanted_) mesh_ = pair_mesh(model), cell_ = 1.2 * mesh_.edge;
  }
  bool wanted() const { return wanted_; }
  /// After a substep of `h`: of places `x` and velocities `v`.
  void resolve(std::vector<glm::dvec3>& x, std::vector<glm::dvec3>& v,
               const std::vector<double>& inverse_masses, double h) const {
    if (!wanted_) return;
    double fastest = 0;
    for (const glm::dvec3& speed : v) fastest = std::max(fastest, glm::length(speed));
    const auto contacts = find(x, std::max(pair_margin(mesh_), 2.2 * fastest * h) + mesh_.thickness);
    std::vector<int> counts(x.size(), 0);
    for (const Contact& c : contacts) {
      ++counts[c.vertex];
      for (glm::length_t j = 0; j < 3; ++j) counts[c.corners[std::size_t(j)]] += c.meeting.weights[j] > 0;
    }
    std::vector<glm::dvec3> stopped(x.size(), glm::dvec3(0));
    for (const Contact& c : contacts) {
      const auto& m = c.meeting;
      glm::dvec3 way = h * v[c.vertex];
      double weight = inverse_masses[c.vertex] * counts[c.vertex];
      for (std::size_t j = 0; j < 3; ++j) {
        const double b = m.weights[glm::length_t(j)];
        way -= b * h * v[c.corners[j]];
        weight += b * b * inverse_masses[c.corners[j]] * counts[c.corners[j]];
      }
      if (!(weight > 0)) continue;
      const double push_most = cell_ / 12;  // push.comp
      const auto by = Formulas<double>{}.meeting_correction(m, way, push_most, friction_);
      const auto add = [&](std::uint32_t i, double factor) {
        factor *= inverse_masses[i] / weight;
        x[i] += factor * (by.stopped + by.pushed), stopped[i] += factor * by.stopped;
      };
      add(c.vertex, 1);
      for (std::size_t j = 0; j < 3; ++j) add(c.corners[j], -m.weights[glm::length_t(j)]);
    }
    for (std::size_t i = 0; i < x.size(); ++i) v[i] += stopped[i] / h;
  }

 private:
  struct Contact {
    std::uint32_t vertex;
    std::array<std::uint32_t, 3> corners;
    Formulas<double>::Meeting meeting;
  };
  using Cell = std::array<int, 3>;
  struct Hash {
    std::size_t operator()(const Cell& c) const {
      return std::size_t(c[0]) * 73856093u ^ std::size_t(c[1]) * 19349663u ^ std::size_t(c[2]) * 83492791u;
    }
  };
  template <class F>
  void for_each_cell(const glm::dvec3& low, const glm::dvec3& high, F&& f) const {
    const glm::ivec3 first(glm::floor(low / cell_)), last(glm::floor(high / cell_));
    for (int z = first.z; z <= last.z; ++z)
      for (int y = first.y; y <= last.y; ++y)
        for (int x = first.x; x <= last.x; ++x) f(Cell{x, y, z});
  }
  bool neighbours(std::uint32_t i, const std::array<std::uint32_t, 4>& t) const {
    const auto& rest = model_.rest.positions;
    for (std::size_t c = 0; c < 3; ++c)
      if (glm::distance(rest[i], rest[t[c]]) < 2 * cell_) return true;
    return false;
  }
  // The triangle that each vertex is in, if any: the nearest within the margin.
  std::vector<Contact> find(const std::vector<glm::dvec3>& x, double margin) const {
    struct Box {
      glm::dvec3 low{1e30}, high{-1e30};
    };
    std::vector<Box> boxes(model_.bodies.size());
    for (const auto& [vertex, body, thickness] : mesh_.vertices) {
      boxes[body].low = glm::min(boxes[body].low, x[vertex]);
      boxes[body].high = glm::max(boxes[body].high, x[vertex]);
    }
    const auto near_another = [&](std::uint32_t body, const glm::dvec3& low, const glm::dvec3& high) {
      for (std::uint32_t b = 0; b < boxes.size(); ++b)
        if (b != body && glm::all(glm::greaterThanEqual(high, boxes[b].low)) &&
            glm::all(glm::lessThanEqual(low, boxes[b].high)))
          return true;
      return self_;
    };
    std::unordered_map<Cell, std::vector<std::uint32_t>, Hash> grid;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& [i, j, k, body] = mesh_.triangles[t];
      const glm::dvec3 low = glm::min(x[i], glm::min(x[j], x[k])),
                       high = glm::max(x[i], glm::max(x[j], x[k]));
      if (near_another(body, low - margin, high + margin))
        for_each_cell(low, high, [&](const Cell& cell) { grid[cell].push_back(t); });
    }
    std::vector<glm::dvec3> normals(x.size(), glm::dvec3(0));
    for (const auto& [i, j, k, body] : mesh_.triangles) {
      const glm::dvec3 n = glm::cross(x[j] - x[i], x[k] - x[i]);
      if (const double area = glm::length(n); area > 0)
        for (const std::uint32_t v : {i, j, k}) normals[v] += n / area;
    }
    std::vector<Contact> contacts;
    for (const auto& [vertex, body, thickness] : mesh_.vertices) {
      const glm::dvec3 own = x[vertex];
      if (!near_another(body, own - margin, own + margin)) continue;
      Contact best{vertex, {}, {}};
      best.meeting.gap = best.meeting.rank = margin;
      Formulas<double>::Meeting nearest = best.meeting;
      for_each_cell(own - margin, own + margin, [&](const Cell& cell) {
        const auto found = grid.find(cell);
        if (found == grid.end()) return;
        for (const std::uint32_t t : found->second) {
          const auto& corners = mesh_.triangles[t];
          if (corners[3] == body && (!self_ || neighbours(vertex, corners))) continue;
          const auto m =
              Formulas<double>{}.meet(x[corners[0]] - own, x[corners[1]] - own, x[corners[2]] - own);
          if (m.rank < nearest.rank) nearest = m;
          if (!(thickness > 0) && !Formulas<double>{}.opposes(m, normals[vertex])) continue;
          if (m.rank < best.meeting.rank)
            best.meeting = m, std::copy_n(corners.begin(), 3, best.corners.begin());
        }
      });
      best.meeting.gap -= double(thickness);
      if (best.meeting.gap < 0 && nearest.gap <= double(thickness)) contacts.push_back(best);
    }
    return contacts;
  }

  const Model& model_;
  bool wanted_, self_;
  double friction_, cell_ = 1;
  PairMesh mesh_;
};

}  // namespace tetpbd
