// The buffers of mode newton (newton/newton.glsl): sizes, layouts, and first contents.
#pragma once

#include <array>

#include "sim/gl/buffer_layout.h"
#include "sim/solvers/aggregates.h"
#include "sim/solvers/newton_graph.h"

namespace tetpbd {

template <>
inline constexpr std::size_t std430_alignment<newton::BodyMotion> = 16;
template <>
inline constexpr std::size_t std430_alignment<newton::MomentumSums> = 16;
template <>
inline constexpr std::size_t std430_alignment<newton::BodyResponse> = 16;

/// What does not depend on forces and on the length of a substep.
struct NewtonLevels {
  NewtonGraph graph;
  Aggregates aggregates;
  std::vector<std::uint32_t> free_bodies;  ///< bodies without a fixed vertex
};
NewtonLevels build_newton_levels(const Model& model, const ConstraintSystem& system);

/// Sizes of work-groups and of the arrays that kernels work on.
struct NewtonSizes {
  std::size_t vertices, edges, uses, members, aggregates, bodies, free_bodies;
  std::size_t coarse;          ///< vec4s of the coarse inverses of all bodies
  std::size_t group;           ///< invocations of a work-group
  std::size_t product_groups;  ///< work-groups of a product with the matrix
  std::size_t parts;           ///< work-groups that add up a free body's momentum
  bool rigid_start;            ///< whether obstacles can stop a free body
  std::size_t tets;            ///< constraints of the largest kind of tets, for which Newton's start is checked
  std::size_t unknowns() const { return 6 * aggregates; }
  static constexpr std::size_t lanes = 4;       ///< invocations for a row of the matrix
  static constexpr std::size_t row_lanes = 32;  ///< invocations for a row of the coarse matrix
};
NewtonSizes measure_newton(const SolverInput& input, const NewtonLevels& levels);
std::vector<std::string> newton_defines(const NewtonSizes& sizes, const SolverInput& input);

struct NewtonBuffers {
  BufferLayout vectors, mesh, coarse, sums;
  std::array<Range<glm::vec4>, newton::SLOTS> slots;  ///< of vectors
  Range<std::uint32_t> first_use, uses, first_neighbour, first_member;
  Range<glm::uvec2> neighbours, members;
  Range<glm::uvec4> shares;
  Range<newton::BodyRange> body_ranges;
  Range<std::uint32_t> free_bodies, aggregate_bodies, group_bodies;
  struct Constraints {
    Range<std::uint32_t> vertices;
    Range<float> values, compliances, dampings;
  };
  std::array<Constraints, kind_count> constraints;
  Range<glm::vec4> centres, coarse_inverse;
  Range<glm::vec4> bodies;
  Range<glm::vec4> rotations;
  Range<newton::BodyMotion> motions;
};
/// The arrays of floats that each kind of constraint has in `mesh`.
struct ConstraintArray {
  const char* name;
  std::vector<double> ConstraintList::*array;
  Range<float> NewtonBuffers::Constraints::*range;
};
inline constexpr ConstraintArray constraint_arrays[] = {
    {"values", &ConstraintList::rest, &NewtonBuffers::Constraints::values},
    {"compliances", &ConstraintList::compliance, &NewtonBuffers::Constraints::compliances},
    {"dampings", &ConstraintList::damping, &NewtonBuffers::Constraints::dampings}};
/// By body, the part of its stiffness that mode newton gives it; empty where all have the whole. Sound that crosses a
/// body in a tenth of a substep is not told from faster sound, and floats would lose inertia beside such stiffness.
std::vector<float> stiffness_shares(const Model& model, const Settings& settings);
/// The constraints with these shares of their materials' stiffness.
ConstraintSystem soften(ConstraintSystem system, const Model& model, const std::vector<float>& shares);

NewtonBuffers lay_out_newton_buffers(const NewtonSizes& sizes, const ConstraintSystem& system);

/// The contents of `vectors` at rest, of `mesh`, and of `coarse`.
std::vector<glm::vec4> fill_newton_vectors(const Model& model, const NewtonBuffers& layout);
std::vector<std::byte> fill_newton_mesh(const SolverInput& input, const NewtonLevels& levels, const NewtonSizes& sizes,
                                        const NewtonBuffers& layout);
std::vector<glm::vec4> fill_newton_coarse(const SolverInput& input, const NewtonLevels& levels,
                                          const NewtonBuffers& layout);

}  // namespace tetpbd
