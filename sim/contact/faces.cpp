#include "sim/contact/faces.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/sim.h"

namespace tetpbd {

namespace {

constexpr unsigned group = 64;  // invocations

// An obstacle's distance at the deepest point of a face, of which no corner is.
struct Met {
  glm::dvec3 weights;
  Formulas<double>::Surface surface;
};
std::optional<Met> meet(const MovingObstacle& o, const std::array<glm::dvec3, 3>& corners) {
  const glm::dvec3 centre = (corners[0] + corners[1] + corners[2]) / 3.0;
  double radius = 0;
  for (const glm::dvec3& p : corners) radius = std::max(radius, glm::distance(p, centre));
  if (o.is_plane || glm::distance(centre, o.pose.centre) > o.reach + radius) return std::nullopt;
  const auto middle = o.surface_at(centre);
  double lowest = 0;
  for (const glm::dvec3& p : corners) lowest = std::min(lowest, glm::dot(middle.normal, p - centre));
  // A convex solid's distance rises at least as that from its plane does: what rests on one is searched no further.
  if (o.solid.convex != 0 ? middle.distance + lowest > -1e-3 * radius : middle.distance * o.solid.trust > radius)
    return std::nullopt;
  std::array<glm::dvec3, 3> p;
  for (std::size_t k = 0; k < 3; ++k) p[k] = glm::transpose(o.pose.axes) * (corners[k] - o.pose.centre);
  const auto d = Formulas<double>{o.texels, o.kind->distance}.deepest_point(o.solid, p[0], p[1], p[2]);
  if (!(d.surface.distance < 0) || std::max({d.weights.x, d.weights.y, d.weights.z}) > 0.999) return std::nullopt;
  return Met{d.weights, {o.pose.axes * d.surface.normal, d.surface.distance}};
}

}  // namespace

std::vector<Triangle> wide_faces(const Model& model) {
  std::vector<Triangle> wide;
  if (model.obstacles.empty()) return wide;
  for (const Body& body : model.bodies) {
    double edge = 0;  // not found where nothing asks for it
    const auto gets_between = [&](const Obstacle& o) {
      if (o.kind->flat || !o.kind->half) return false;
      if (body.thickness > 0 && o.kind->edged) return true;
      if (edge == 0) edge = mean_edge(model, body);
      const glm::dvec3 half = o.kind->half(o);
      return edge > (o.kind->edged ? 0.5 : 1) * std::min({half.x, half.y, half.z});
    };
    if (!std::ranges::any_of(model.obstacles, gets_between)) continue;
    const auto first = model.rest.surface.begin() + std::ptrdiff_t(body.first_triangle);
    wide.insert(wide.end(), first, first + std::ptrdiff_t(body.triangles));
  }
  return wide;
}

void move_faces_out(const Model& model, const Settings& settings, const std::vector<Triangle>& faces,
                    const std::vector<MovingObstacle>& obstacles, double h, std::vector<glm::dvec3>& x,
                    std::vector<glm::dvec3>& v, const std::vector<double>& inverse_masses, std::vector<double>& work) {
  Formulas<double> f;
  for (const Triangle& face : faces)
    for (const MovingObstacle& o : obstacles) {
      const auto met = meet(o, {x[face[0]], x[face[1]], x[face[2]]});
      if (!met) continue;
      glm::dvec3 place(0), way(0);
      double weight = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double share = met->weights[glm::length_t(k)];
        place += share * x[face[k]], way += share * h * v[face[k]], weight += share * share * inverse_masses[face[k]];
      }
      if (!(weight > 0)) continue;
      const glm::dvec3 speed = o.velocity_at(place), n = met->surface.normal;
      way -= h * speed;
      // What was inside before is moved out without becoming faster.
      const double depth = met->surface.distance, came = std::max(depth, std::min(0.0, glm::dot(n, way))),
                   friction = friction_on(o, settings, body_at(model, face[0]).number);
      const glm::dvec3 placed = f.plane_correction(n, depth, way, friction) / weight,
                       sped = f.plane_correction(n, came, way, friction) / weight;
      for (std::size_t k = 0; k < 3; ++k) {
        const double share = met->weights[glm::length_t(k)];
        x[face[k]] += share * inverse_masses[face[k]] * placed,
            v[face[k]] += share * inverse_masses[face[k]] / h * sped;
        if (!work.empty()) work[face[k]] += share / h * glm::dot(sped, speed);
      }
    }
}

double deepest_face(const std::vector<Triangle>& faces, const std::vector<MovingObstacle>& obstacles,
                    const std::vector<glm::dvec3>& x) {
  double deepest = 0;
  for (const Triangle& face : faces)
    for (const MovingObstacle& o : obstacles)
      if (const auto met = meet(o, {x[face[0]], x[face[1]], x[face[2]]}))
        deepest = std::max(deepest, -met->surface.distance);
  return deepest;
}

Faces make_faces(const SolverInput& input) {
  const std::vector<Triangle> wide = wide_faces(input.model);
  Faces result;
  if (wide.empty()) return result;
  struct Sums {  // of contact/faces.comp
    int placed[3], sped[3];
    std::uint32_t weight, solid, faces, left;
  };
  std::vector<Sums> sums(input.model.positions.size());
  std::vector<glm::uvec4> corners;
  for (const auto& [a, b, c] : wide) {
    corners.emplace_back(a, b, c, 0);
    for (const std::uint32_t v : {a, b, c}) ++sums[v].faces, ++sums[v].left;
  }
  check_storage(input.tuning, "sums of faces", sums.size() * sizeof(Sums));
  result.corners = Buffer("faces that obstacles get between", corners);
  result.sums = Buffer("sums of faces", sums, GL_DYNAMIC_COPY);
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), {define("IMPLICIT", solver_mode(input.settings).implicit), define("FACE_GROUP", group),
                                 fmt::format("VERTICES {}u", sums.size())});
  result.pass = {Program::compute("contact/faces.comp", {}, defines), work_groups(wide.size(), group)};
  return result;
}

void move_faces_out(Sim& sim) {
  if (!sim.faces) return;
  Recorder& recorder = sim.recorder;
  recorder.give("Faces", sim.faces.corners), recorder.give("FaceSumsByVertex", sim.faces.sums);
  if (sim.solver.quantized_buffers > 0) recorder.give("QuantizedOut", sim.quantized[sim.read_index]);
  recorder.run(sim.faces.pass, {{"phases", sim.pairs.phases}});
  give_quantized(sim);
}

}  // namespace tetpbd
