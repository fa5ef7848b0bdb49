// What smoothed tets share (method.md, "Smoothed tets"): averages of the deformation gradient F and of its determinant
// J over the tets around each vertex, and the moduli with which these resist.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// By vertex of all bodies; a vertex without smoothed tets has volume 0 and no neighbours. Empty: no body has any.
struct Averages {
  struct Vertex {
    double volume = 0;           ///< V, m^3: a quarter of what its tets fill
    double shear = 0, bulk = 0;  ///< Pa: (1 - s) mu of its average F, and lambda of its average J (method.md eq. 45)
    double alpha = 1;            ///< J at which nothing presses, as of a neo-Hookean tet
  };
  struct Neighbour {
    std::uint32_t vertex;
    glm::dvec3 own, other;  ///< m^2: V dF/dx of this vertex by the neighbour's position, and of the neighbour's by its
  };
  struct Part {
    std::array<std::uint32_t, 3> others;  ///< corners of a tet around the vertex, which make its volume positive
    double weight;                        ///< by which 6 volumes add to V J
  };
  std::vector<Vertex> vertices;
  std::vector<std::uint32_t> first_neighbour, first_part;  ///< by vertex, and the end
  std::vector<Neighbour> neighbours;                       ///< in the order of their numbers
  std::vector<Part> parts;
};

/// The averages of a body whose tets have these moduli (Pa), mu and lambda of Smith's energy, and smoothing s.
Averages average_tets(const TetMesh& mesh, double mu, double lambda, double s);
/// Appends those of `from`, a body of so many vertices, all numbers of which are `offset` higher.
void append(Averages& to, const Averages& from, std::size_t vertices, std::uint32_t offset);

/// F and J of a vertex, averaged over the tets around it, by their volumes at rest.
struct Average {
  glm::dmat3 F{1};
  double J = 1;
};
Average average_at(const Averages& averages, std::size_t vertex, const std::vector<glm::dvec3>& positions);

}  // namespace tetpbd
