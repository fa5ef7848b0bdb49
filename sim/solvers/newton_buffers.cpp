#include "sim/solvers/newton_buffers.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <numeric>

#include "sim/contact/moving_obstacle.h"
#include "sim/contact/obstacles.h"
#include "sim/contact/pairs.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

std::size_t body_of(const Model& model, std::size_t vertex) {
  return std::size_t(&body_at(model, vertex) - model.bodies.data());
}

// The work-groups that go through the rows of so many vertices.
std::size_t groups_of_rows(std::size_t vertices, std::size_t group) {
  const std::size_t rows = group / NewtonSizes::lanes;
  return (vertices + rows - 1) / rows;
}

// Enough for what 3x3 blocks alone do not solve in a few iterations, and few enough for a dense inverse.
std::size_t choose_aggregates(std::size_t vertices) {
  const double count = double(vertices);
  return std::size_t(std::clamp(std::min(1.3 * std::sqrt(count), count / 8), 1.0, double(most_aggregates)));
}

// Where each body's vertices, work-groups, aggregates and coarse inverse are.
std::vector<newton::BodyRange> make_body_ranges(const Model& model, const Aggregates& aggregates, std::size_t group) {
  std::vector<newton::BodyRange> ranges;
  std::size_t groups = 0, coarse = 0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    const std::size_t unknowns = 6 * aggregates.of_body(b), row = (unknowns + 3) / 4;
    ranges.push_back({std::uint32_t(body.first_vertex), std::uint32_t(body.first_vertex + body.vertices),
                      std::uint32_t(groups), std::uint32_t(body.tets), aggregates.first[b], aggregates.first[b + 1],
                      std::uint32_t(coarse), std::uint32_t(row), float(body_mass(model, body))});
    groups += groups_of_rows(body.vertices, group), coarse += unknowns * row;
  }
  return ranges;
}

}  // namespace

NewtonLevels build_newton_levels(const Model& model, const ConstraintSystem& system) {
  const std::size_t vertices = model.positions.size();
  NewtonLevels levels{build_newton_graph(system, vertices), {}, {}};
  std::vector<std::size_t> wanted;
  for (const Body& body : model.bodies) wanted.push_back(choose_aggregates(body.vertices));
  levels.aggregates = make_aggregates(model, levels.graph.neighbours, wanted);
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    const auto begin = model.inverse_masses.begin() + std::ptrdiff_t(body.first_vertex);
    if (std::all_of(begin, begin + std::ptrdiff_t(body.vertices), [](double w) { return w != 0; }))
      levels.free_bodies.push_back(std::uint32_t(b));
  }
  return levels;
}

NewtonSizes measure_newton(const SolverInput& input, const NewtonLevels& levels) {
  const std::size_t group = std::max<std::size_t>(tuned({0, 128}, input.tuning).group, NewtonSizes::row_lanes);
  const std::vector<Body>& bodies = input.model.bodies;
  const std::vector<newton::BodyRange> ranges = make_body_ranges(input.model, levels.aggregates, group);
  const newton::BodyRange last = ranges.empty() ? newton::BodyRange{} : ranges.back();
  std::size_t largest = 0, tets = 0;
  for (const std::uint32_t b : levels.free_bodies) largest = std::max(largest, bodies[b].vertices);
  for (std::size_t k = 0; k < kind_count; ++k)
    if (constraint_kinds[k].tet) tets = std::max(tets, input.system.lists[k].count());
  return {.vertices = input.model.positions.size(),
          .edges = levels.graph.edges(),
          .uses = levels.graph.uses.size(),
          .members = levels.aggregates.members.values.size(),
          .aggregates = levels.aggregates.all.size(),
          .bodies = bodies.size(),
          .free_bodies = levels.free_bodies.size(),
          .coarse = last.coarse_at + 6 * (last.end_aggregate - last.first_aggregate) * last.coarse_row,
          .group = group,
          .product_groups = last.first_group + groups_of_rows(last.end - last.first, group),
          .parts = std::clamp<std::size_t>((largest + 127) / 128, 1, 32),
          .rigid_start = !levels.free_bodies.empty() &&
                         (has_obstacles(input.model, input.settings) || bodies_touch(input.model, input.settings)),
          .tets = tets};
}

std::vector<std::string> newton_defines(const NewtonSizes& sizes, const SolverInput& input) {
  std::vector<std::string> defines = obstacle_defines(input.model, has_own_surfaces(input.settings));
  std::ranges::move(quanta_defines(input), std::back_inserter(defines));
  for (const auto& [name, value] : {std::pair<const char*, std::size_t>{"GROUP_SIZE", sizes.group},
                                    {"LANES", sizes.lanes},
                                    {"ROW_LANES", sizes.row_lanes},
                                    {"VERTICES", sizes.vertices},
                                    {"EDGES", sizes.edges},
                                    {"USES", sizes.uses},
                                    {"TETS", sizes.tets},
                                    {"AGGREGATES", sizes.aggregates},
                                    {"MEMBERS", sizes.members},
                                    {"PRODUCT_GROUPS", sizes.product_groups},
                                    {"BODIES", sizes.bodies},
                                    {"FREE_BODIES", sizes.free_bodies},
                                    {"PARTS", sizes.parts},
                                    {"RIGID_START", sizes.rigid_start}})
    defines.push_back(fmt::format("{} {}u", name, value));
  defines.push_back(define("AVERAGED", has_averages(input.system)));
  defines.push_back(define("TOUCHING", bodies_touch(input.model, input.settings)));
  const std::vector<double>& masses = input.model.masses;
  defines.push_back(fmt::format("TOTAL_MASS {:.9g}", std::accumulate(masses.begin(), masses.end(), 0.0)));
  for (std::size_t k = 0; k < kind_count; ++k)
    if (input.system.present[k])
      defines.push_back(fmt::format("COUNT_{} {}u", constraint_kinds[k].name, input.system.lists[k].count()));
  return defines;
}

std::vector<float> stiffness_shares(const Model& model, const Settings& settings) {
  constexpr double most = 100;  // stiffness over mass, in 1/h^2
  const double h = settings.dt / settings.substeps;
  std::vector<float> shares;
  for (const Body& body : model.bodies) {
    const Material& material = material_of(settings, body.number);
    const double size = body_bounds(body, model.rest.positions).size();
    const Lame whole = lame(material.young_modulus, material.poisson_ratio);
    double stiffness = 0;
    for (std::size_t t = body.first_tet; has_energy(material) && t < body.first_tet + body.tets; ++t) {
      const Lame m = model.regions.empty() ? whole : tet_moduli(model, settings, t);
      stiffness += 3 * (m.lambda + 2 * m.mu) * tet_volume(model.rest, model.rest.tets[t]) / (size * size);
    }
    shares.push_back(float(std::min(1.0, most * body_mass(model, body) / (stiffness * h * h))));
  }
  return std::ranges::all_of(shares, [](float share) { return share == 1; }) ? std::vector<float>{} : shares;
}

ConstraintSystem soften(ConstraintSystem system, const Model& model, const std::vector<float>& shares) {
  for (ConstraintList& list : system.lists)
    for (std::size_t c = 0; c < list.count() && !list.compliance.empty() && !shares.empty(); ++c) {
      const std::size_t each = list.compliance.size() / list.count();
      for (std::size_t k = 0; k < each; ++k)
        list.compliance[each * c + k] /= double(shares[body_of(model, list.ends(c)[0])]);
    }
  for (std::size_t v = 0; v < system.averages.vertices.size() && !shares.empty(); ++v) {
    const double share = double(shares[body_of(model, v)]);
    system.averages.vertices[v].shear *= share, system.averages.vertices[v].bulk *= share;
  }
  return system;
}

NewtonBuffers lay_out_newton_buffers(const NewtonSizes& sizes, const ConstraintSystem& system) {
  NewtonBuffers to;
  for (Range<glm::vec4>& slot : to.slots) slot = to.vectors.add<glm::vec4>("vectors", sizes.vertices);

  to.first_use = to.mesh.add<std::uint32_t>("first_use", sizes.edges + 1);
  to.uses = to.mesh.add<std::uint32_t>("uses", sizes.uses);
  to.first_neighbour = to.mesh.add<std::uint32_t>("first_neighbour", sizes.vertices + 1);
  to.neighbours = to.mesh.add<glm::uvec2>("neighbours", 2 * sizes.edges);
  to.shares = to.mesh.add<glm::uvec4>("shares", sizes.vertices);
  to.first_member = to.mesh.add<std::uint32_t>("first_member", sizes.aggregates + 1);
  to.members = to.mesh.add<glm::uvec2>("members", sizes.members);
  to.body_ranges = to.mesh.add<newton::BodyRange>("body_ranges", sizes.bodies);
  to.free_bodies = to.mesh.add<std::uint32_t>("free_bodies", sizes.free_bodies);
  to.aggregate_bodies = to.mesh.add<std::uint32_t>("aggregate_bodies", sizes.aggregates);
  to.group_bodies = to.mesh.add<std::uint32_t>("group_bodies", sizes.product_groups);
  const auto for_each_list = [&](const char* what, auto&& add) {
    for (std::size_t k = 0; k < kind_count; ++k)
      if (system.present[k])
        add(fmt::format("{}_{}", what, constraint_kinds[k].name), system.lists[k], to.constraints[k]);
  };
  for_each_list("vertices", [&](const std::string& name, const ConstraintList& list, auto& ranges) {
    const std::size_t at = list.arity == 2 ? to.mesh.add<glm::uvec2>(name, list.count()).at
                                           : to.mesh.add<glm::uvec4>(name, list.count()).at;
    ranges.vertices = {at, list.vertices.size()};
  });
  for (const auto& [what, array, range] : constraint_arrays)
    for_each_list(what, [&, a = array, r = range](const std::string& name, const ConstraintList& list, auto& ranges) {
      ranges.*r = to.mesh.add<float>(name, (list.*a).size());
    });

  to.centres = to.coarse.add<glm::vec4>("centres", sizes.aggregates);
  to.bodies = to.coarse.add<glm::vec4>("bodies", sizes.bodies);
  to.coarse_inverse = to.coarse.add<glm::vec4>("coarse_inverse", sizes.coarse);

  to.rotations = to.sums.add<glm::vec4>("rotations", sizes.aggregates);
  to.motions = to.sums.add<newton::BodyMotion>("motions", sizes.bodies);
  to.sums.add<newton::BodyResponse>("responses", sizes.bodies);
  to.sums.add<newton::MomentumSums>("momentum_sums", sizes.free_bodies * sizes.parts);
  to.sums.add<glm::vec2>("group_dots", sizes.product_groups);
  to.sums.add<glm::vec2>("dots", sizes.bodies);
  to.sums.add<newton::Iteration>("iterations", 2 * sizes.bodies);
  to.sums.add<float>("coarse_r", sizes.unknowns() + 3);
  to.sums.add<float>("coarse_q", sizes.unknowns());
  to.sums.add<float>("coarse_y", sizes.unknowns());
  to.sums.add<float>("is_free", sizes.aggregates);
  to.sums.add<float>("first_rz", sizes.bodies);
  to.sums.add<std::uint32_t>("islands", sizes.bodies);
  to.sums.add<std::uint32_t>("bad_starts", 6 * sizes.bodies);
  to.sums.add<std::uint32_t>("products_done", sizes.bodies);
  to.sums.add<std::uint32_t>("parts_done", sizes.free_bodies);
  return to;
}

std::vector<glm::vec4> fill_newton_vectors(const Model& model, const NewtonBuffers& layout) {
  std::vector<glm::vec4> vectors(layout.vectors.bytes / sizeof(glm::vec4), glm::vec4(0)), rest;
  for (const glm::dvec3& x : model.rest.positions) rest.emplace_back(glm::vec3(x), 0);
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b)
    for (std::size_t k = 0; k < model.bodies[b].vertices; ++k)
      rest[model.bodies[b].first_vertex + k].w = std::bit_cast<float>(b);
  put(std::as_writable_bytes(std::span(vectors)), layout.slots[newton::REST], rest);
  return vectors;
}

std::vector<std::byte> fill_newton_mesh(const SolverInput& input, const NewtonLevels& levels, const NewtonSizes& sizes,
                                        const NewtonBuffers& layout) {
  const ConstraintSystem& system = input.system;
  const auto& [graph, aggregates, free_bodies] = levels;
  std::vector<std::uint32_t> uses;
  std::vector<glm::uvec2> neighbours;
  std::vector<glm::uvec4> shares;
  std::vector<glm::uvec2> members;
  for (const NewtonGraph::Use& use : graph.uses) uses.push_back(use.packed);
  for (std::size_t n = 0; n < graph.edge_of.size(); ++n)
    neighbours.push_back({graph.edge_of[n], graph.neighbours.values[n]});
  const auto pack = [](const Share& share) { return PACKED_SHARE(share.aggregate, share.weight); };
  for (const auto& [a, b, c, d] : aggregates.of_vertex) shares.push_back({pack(a), pack(b), pack(c), pack(d)});
  for (const std::uint32_t m : aggregates.members.values)
    members.push_back({m / 4, aggregates.of_vertex[m / 4][m % 4].weight});
  std::vector<std::uint32_t> group_bodies, aggregate_bodies;
  for (std::uint32_t b = 0; b < input.model.bodies.size(); ++b) {
    group_bodies.insert(group_bodies.end(), groups_of_rows(input.model.bodies[b].vertices, sizes.group), b);
    aggregate_bodies.insert(aggregate_bodies.end(), aggregates.of_body(b), b);
  }
  std::vector<std::byte> contents(layout.mesh.bytes);
  put(contents, layout.first_use, graph.first_use);
  put(contents, layout.uses, uses);
  put(contents, layout.first_neighbour, graph.neighbours.first);
  put(contents, layout.neighbours, neighbours);
  put(contents, layout.shares, shares);
  put(contents, layout.first_member, aggregates.members.first);
  put(contents, layout.members, members);
  put(contents, layout.body_ranges, make_body_ranges(input.model, aggregates, sizes.group));
  put(contents, layout.free_bodies, free_bodies);
  put(contents, layout.aggregate_bodies, aggregate_bodies);
  put(contents, layout.group_bodies, group_bodies);
  for (std::size_t k = 0; k < kind_count; ++k) {
    put(contents, layout.constraints[k].vertices, system.lists[k].vertices);
    for (const auto& [name, array, range] : constraint_arrays)
      put(contents, layout.constraints[k].*range, to_floats(system.lists[k].*array));
  }
  return contents;
}

namespace {

// Of each free body its centre of mass at rest, and 1/s^2, its stiffness against a force on opposite faces (of a cube E
// times the edge) over its mass; 0 of the others.
std::vector<glm::dvec4> describe_bodies(const Model& model, const NewtonLevels& levels, const BlocksAtRest& matrix,
                                        bool averaged) {
  std::vector<glm::dvec4> bodies(model.bodies.size(), glm::dvec4(0));
  const auto& [neighbours, blocks] = matrix;
  for (const std::uint32_t b : levels.free_bodies) {
    const std::size_t first = model.bodies[b].first_vertex, end = first + model.bodies[b].vertices;
    const double mass = body_mass(model, model.bodies[b]);
    double stiffness = 0;  // N m
    glm::dvec3 centre{0};
    Bounds box{model.rest.positions[first], model.rest.positions[first]};
    for (std::size_t v = first; v < end; ++v) {
      const glm::dvec3& x = model.rest.positions[v];
      centre += model.masses[v] * x;
      box = {glm::min(box.low, x), glm::max(box.high, x)};
      for (std::size_t n = neighbours.first[v]; n < neighbours.first[v + 1]; ++n) {
        const glm::dvec3 edge = model.rest.positions[neighbours.values[n]] - x;
        const glm::dmat3& block = blocks[n];
        const double trace = block[0][0] + block[1][1] + block[2][2];
        // Averages couple neighbours of neighbours with either sign, which cancels.
        stiffness += (averaged ? -trace : std::abs(trace)) / 6 * glm::dot(edge, edge);  // each edge twice
      }
    }
    bodies[b] = {centre / mass, stiffness / (box.size() * box.size() / 3) / mass};
  }
  return bodies;
}

}  // namespace

std::vector<glm::vec4> fill_newton_coarse(const SolverInput& input, const NewtonLevels& levels,
                                          const NewtonBuffers& layout) {
  const double h = input.plan.h * 2 / 3;  // s, by which BDF2 multiplies a velocity
  std::vector<double> inertia;
  for (const double w : input.model.inverse_masses) inertia.push_back(w > 0 ? 1 / (w * h * h) : 0);
  const BlocksAtRest matrix = compute_blocks_at_rest(input, levels.graph, h);
  const std::vector<glm::dvec4> described = describe_bodies(input.model, levels, matrix, has_averages(input.system));
  const std::vector<glm::vec4> bodies(described.begin(), described.end());
  const std::size_t count = bodies.size();
  std::vector<std::vector<float>> inverses(count);
  const BlockRows rows{matrix.neighbours, inertia, matrix.blocks};
  parallel_for(count, count < 8 ? count : 1, [&](std::size_t b) {
    const glm::dvec3 pivot(described[b]);
    const bool rigid =
        std::ranges::binary_search(levels.free_bodies, std::uint32_t(b)) && has_obstacles(input.model, input.settings);
    inverses[b] = coarse_inverse(input.model, b, levels.aggregates, rows, rigid ? &pivot : nullptr);
  });
  std::vector<glm::vec4> contents(layout.coarse.bytes / sizeof(glm::vec4), glm::vec4(0)), centres;
  for (const Aggregate& a : levels.aggregates.all) centres.emplace_back(glm::vec3(a.centre), float(a.reach));
  put(std::as_writable_bytes(std::span(contents)), layout.centres, centres);
  put(std::as_writable_bytes(std::span(contents)), layout.bodies, bodies);
  std::size_t at = layout.coarse_inverse.at;
  for (const std::vector<float>& inverse : inverses) {
    put(std::as_writable_bytes(std::span(contents)), Range<float>{at, inverse.size()}, inverse);
    at += sizeof(float) * inverse.size();
  }
  return contents;
}

}  // namespace tetpbd
