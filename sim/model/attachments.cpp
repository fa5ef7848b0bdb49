#include "sim/model/attachments.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/mesh/solid.h"
#include "sim/model/material.h"
#include "sim/parallel.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

// Weights of a triangle's second and third corner, and the way along its normal, that lead to p.
glm::dvec3 place_on(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& p) {
  const glm::dvec3 across = glm::cross(b - a, c - a);
  const double area = glm::length(across);
  if (!(area > 0)) return glm::dvec3(0);
  return glm::inverse(glm::dmat3(b - a, c - a, across / area)) * (p - a);
}

// N/m, with which a body of this material resists a push on a vertex between edges of such a length.
double local_stiffness(const Material& material, double edge) {
  if (has_energy(material)) return material.young_modulus * edge;
  const double compliance = material.compliance[std::size_t(index_of<Stretch>)];
  return compliance > 0 ? 1 / compliance : 0;
}

void append(ConstraintSystem& system, std::size_t kind, std::span<const std::uint32_t> vertices,
            std::span<const double> rest) {
  ConstraintList& list = system.lists[kind];
  list.vertices.insert(list.vertices.end(), vertices.begin(), vertices.end());
  list.rest.insert(list.rest.end(), rest.begin(), rest.end());
  for (const std::uint32_t v : vertices) ++system.at_vertex[v];
  system.present[kind] = true;
}

// The rest values of a coordinate of the attachment's vertex k.
std::array<double, 5> rest_of(const Attachment& attachment, std::size_t k, int axis) {
  const glm::dvec3& place = attachment.places[k];
  return {place.x, place.y, place.z, double(axis), 0};
}

// Damping of bodies is not that of what has compliance here.
void set_compliance(ConstraintList& list, std::vector<double> compliance) {
  list.stiffness.assign(compliance.size(), 1), list.damping.assign(compliance.size(), 0);
  list.compliance = std::move(compliance);
}

}  // namespace

double attach(const Model& model, Attachment& attachment, double within, bool closes,
              const std::vector<double>& offsets) {
  const Body& other = model.bodies[attachment.to];
  const auto first = model.rest.surface.begin() + std::ptrdiff_t(other.first_triangle);
  const SurfaceMesh surface{model.positions, {first, first + std::ptrdiff_t(other.triangles)}};
  const Solid solid(surface);
  const auto& x = model.positions;
  std::vector<Solid::Nearest> nearest(attachment.vertices.size());
  parallel_for(nearest.size(), [&](std::size_t k) { nearest[k] = solid.nearest(x[attachment.vertices[k]]); });
  double least = std::numeric_limits<double>::infinity();
  std::vector<std::uint32_t> kept;
  for (std::size_t k = 0; k < nearest.size(); ++k) {
    least = std::min(least, nearest[k].distance);
    if (nearest[k].distance > within) continue;
    const Triangle& t = surface.triangles[nearest[k].triangle];
    const std::uint32_t v = attachment.vertices[k];
    glm::dvec3 place = place_on(x[t[0]], x[t[1]], x[t[2]], x[v]);
    if (closes) {
      double gap = offsets.empty() ? 0 : offsets[v];
      for (const std::uint32_t corner : t) gap = std::min(gap, offsets.empty() ? 0 : offsets[corner]);
      const double side = place.z;
      place = place_on(x[t[0]], x[t[1]], x[t[2]], nearest[k].point);
      place.z = std::copysign(gap, side);
    }
    kept.push_back(v), attachment.triangles.push_back(t), attachment.places.push_back(place);
  }
  attachment.vertices = std::move(kept);
  return least;
}

double attachment_stiffness(const Attachment& attachment, const Model& model, const Settings& settings) {
  if (attachment.stiffness > 0) return attachment.stiffness;
  const SolverMode& mode = solver_mode(settings);
  if (!mode.forces && !attachment.break_force) return 0;
  // As a fifth of an edge of the stiffer body would resist: more would take shorter steps and more iterations.
  constexpr double firm = 5;
  double edges = 0, stiffness = 0;
  for (const Triangle& t : attachment.triangles)
    for (std::size_t c = 0; c < 3; ++c)
      edges += glm::distance(model.rest.positions[t[c]], model.rest.positions[t[(c + 1) % 3]]);
  const double edge = edges / (3 * double(attachment.triangles.size()));
  for (const std::size_t body : {attachment.body, attachment.to})
    stiffness = std::max(stiffness, local_stiffness(material_of(settings, model.bodies[body].number), edge));
  return firm * stiffness * double(attachment.vertices.size());
}

glm::dvec3 attachment_force(const Attachment& attachment, double stiffness, const std::vector<glm::dvec3>& positions) {
  glm::dvec3 sum(0);
  for (std::size_t k = 0; k < attachment.vertices.size(); ++k) {
    std::array<glm::dvec3, 4> x = {positions[attachment.vertices[k]]};
    for (std::size_t c = 0; c < 3; ++c) x[c + 1] = positions[attachment.triangles[k][c]];
    for (int axis = 0; axis < 3; ++axis)
      sum[axis] -= Attach::evaluate(x.data(), static_cast<const double*>(rest_of(attachment, k, axis).data())).C;
  }
  return sum * (stiffness / double(attachment.vertices.size()));
}

void add_attachments(ConstraintSystem& system, const Model& model, const Settings& settings,
                     const std::vector<char>& broken) {
  constexpr std::size_t kind = index_of<Attach>;
  std::vector<double> compliance;
  for (std::size_t n = 0; n < model.attachments.size(); ++n) {
    const Attachment& all = model.attachments[n];
    if (!broken.empty() && broken[n]) continue;
    const double stiffness = attachment_stiffness(all, model, settings);
    const double own = stiffness > 0 ? double(all.vertices.size()) / stiffness : 0;
    for (std::size_t k = 0; k < all.vertices.size(); ++k)
      for (int axis = 0; axis < 3; ++axis) {
        const Triangle& t = all.triangles[k];
        append(system, kind, std::array{all.vertices[k], t[0], t[1], t[2]}, rest_of(all, k, axis));
        compliance.push_back(own);
      }
  }
  // Where all are hard, no constraint of the scene may have compliance.
  if (std::ranges::any_of(compliance, [](double c) { return c > 0; }))
    set_compliance(system.lists[kind], std::move(compliance));
}

std::vector<char> loose_pieces(const Model& model, const ConstraintSystem& system) {
  std::vector<char> loose;
  for (const Body& body : model.bodies) loose.push_back(body.one_piece);
  const auto hold = [&](const std::vector<std::uint32_t>& vertices) {
    for (const std::uint32_t v : vertices) loose[body_at(model, v).number] = 0;
  };
  if (!system.lists.empty()) hold(system.lists[index_of<Attach>].vertices);
  for (const Load& load : model.loads) hold(load.vertices);
  return loose;
}

void add_fibres(ConstraintSystem& system, const Model& model) {
  constexpr std::size_t kind = index_of<Fibre>;
  std::vector<double> compliance;
  for (std::size_t n = 0; n < model.fibres.size(); ++n)
    for (const std::uint32_t t : model.fibres[n].tets) {
      const Tet& tet = model.rest.tets[t];
      const auto& x = model.rest.positions;
      const glm::dmat3 sides(x[tet[1]] - x[tet[0]], x[tet[2]] - x[tet[0]], x[tet[3]] - x[tet[0]]);
      const glm::dvec3 along = glm::inverse(sides) * model.fibres[n].direction;
      append(system, kind, tet, std::array{along.x, along.y, along.z, 1.0, double(n)});
      const double volume = tet_volume(model.rest, tet) * fill_of(model.rest, t);
      compliance.push_back(1 / (model.fibres[n].stiffness * volume));
    }
  if (!compliance.empty()) set_compliance(system.lists[kind], std::move(compliance));
}

Activations activations_of_step(const Model& model, const Settings& settings, double time) {
  const auto at = [&](const Fibres& fibres, double when) {
    return fibres.activation.empty() ? 0.0f : float(factor_at(fibres.activation, when));
  };
  const double now = time_of_loads(settings, time);
  Activations result;
  for (const Fibres& fibres : model.fibres) {
    result.now.push_back(at(fibres, now));
    result.before.push_back(time > 0 ? at(fibres, now - settings.dt) : 0);
  }
  return result;
}

double activation_work(const ConstraintList& fibres, const Activations& activations,
                       const std::vector<glm::dvec3>& positions) {
  if (activations.now == activations.before) return 0;
  double work = 0;
  for (std::size_t c = 0; c < fibres.count(); ++c) {
    std::array<glm::dvec3, 4> x;
    for (std::size_t j = 0; j < 4; ++j) x[j] = positions[fibres.ends(c)[j]] - positions[fibres.ends(c)[0]];
    std::array<double, 5> rest;
    std::copy_n(fibres.rest.begin() + std::ptrdiff_t(5 * c), 5, rest.begin());
    const auto energy = [&](const std::vector<float>& by_number) {
      auto now = rest;
      now[3] -= double(by_number[std::size_t(rest[4])]);
      const double C = Fibre::evaluate(x.data(), static_cast<const double*>(now.data())).C;
      return 0.5 * C * C / fibres.compliance[c];
    };
    work += energy(activations.now) - energy(activations.before);
  }
  return work;
}

}  // namespace tetpbd
