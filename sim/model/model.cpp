#include "sim/model/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <numeric>
#include <random>
#include <span>

#include "sim/error.h"
#include "sim/model/constraint_kinds.h"
#include "sim/model/hilbert.h"
#include "sim/parallel.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

void add_body(Model& model, const std::string& name, const TetMesh& mesh, double density,
              const std::vector<glm::dvec3>& positions, const glm::dvec3& velocity, const glm::dvec3& spin,
              const std::vector<std::uint32_t>& fixed, const std::vector<double>& mass_factors) {
  const std::uint32_t base = std::uint32_t(model.rest.positions.size());
  Body body{name,
            model.bodies.size(),
            base,
            mesh.positions.size(),
            model.rest.tets.size(),
            mesh.tets.size(),
            model.rest.surface.size(),
            mesh.surface.size(),
            mesh.one_piece};
  if (mesh.tets.empty()) body.thickness = mesh.thickness;
  const auto append_shifted = [&](auto& to, const auto& from) {
    const std::size_t start = to.size();
    to.resize(start + from.size());
    parallel_for(from.size(), [&](std::size_t i) {
      for (std::size_t j = 0; j < from[i].size(); ++j) to[start + i][j] = from[i][j] + base;
    });
  };
  model.rest.positions.insert(model.rest.positions.end(), mesh.positions.begin(), mesh.positions.end());
  model.rest.thickness = std::max(model.rest.thickness, body.thickness);
  append_shifted(model.rest.tets, mesh.tets);
  if (!model.rest.fill.empty() || !mesh.fill.empty()) {
    model.rest.fill.resize(body.first_tet, 1);
    model.rest.fill.insert(model.rest.fill.end(), mesh.fill.begin(), mesh.fill.end());
    model.rest.fill.resize(model.rest.tets.size(), 1);
  }
  append_shifted(model.rest.surface, mesh.surface);
  glm::dvec3 centre{0};
  double total = 0;
  auto masses = lumped_masses(mesh, density);
  for (std::size_t i = 0; i < masses.size(); ++i) {
    if (!mass_factors.empty()) masses[i] *= mass_factors[i];
    centre += masses[i] * positions[i], total += masses[i];
  }
  centre /= total;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    model.original.push_back(std::uint32_t(model.original.size()));
    model.masses.push_back(masses[i]);
    // A vertex of no tet has no mass and stays where it is.
    model.inverse_masses.push_back(masses[i] > 0 ? 1 / masses[i] : 0);
    model.positions.push_back(positions[i]);
    model.velocities.push_back(velocity + glm::cross(spin, positions[i] - centre));
  }
  for (std::uint32_t v : fixed) {
    model.inverse_masses[base + v] = 0;
    model.velocities[base + v] = glm::dvec3(0);
  }
  const double size = bounds(mesh.positions).size();
  model.size = model.bodies.empty() ? size : std::max(model.size, size);
  model.bodies.push_back(body);
}

const Body& body_at(const Model& model, std::size_t vertex) {
  return *std::prev(std::ranges::upper_bound(model.bodies, vertex, {}, &Body::first_vertex));
}

std::vector<float> quantum_fineness(const Model& model, const Settings& settings) {
  if (settings.contact != "none" || !model.attachments.empty()) return {};
  std::vector<float> fineness;
  bool any = false;
  for (const Body& body : model.bodies) {
    const double ratio = body_bounds(body, model.rest.positions).size() / model.size;
    const bool small = ratio > 0 && ratio < 0.125;
    fineness.resize(body.first_vertex + body.vertices, small ? float(std::exp2(std::ceil(std::log2(ratio)))) : 1.0f);
    any = any || small;
  }
  return any ? fineness : std::vector<float>{};
}

double factor_at(const FactorOverTime& factors, double time) {
  if (factors.empty()) return 1;
  const auto next = std::ranges::upper_bound(factors, time, {}, &std::pair<double, double>::first);
  if (next == factors.begin()) return next->second;
  const auto last = std::prev(next);
  if (next == factors.end()) return last->second;
  return std::lerp(last->second, next->second, (time - last->first) / (next->first - last->first));
}

double time_of_loads(const Settings& settings, double time) {
  return time + (solver_mode(settings).implicit ? 1 : 0.5) * settings.dt;
}

double body_mass(const Model& model, const Body& body) {
  const auto first = model.masses.begin() + std::ptrdiff_t(body.first_vertex);
  return std::accumulate(first, first + std::ptrdiff_t(body.vertices), 0.0);
}

Bounds body_bounds(const Body& body, const std::vector<glm::dvec3>& positions) {
  const auto first = positions.begin() + std::ptrdiff_t(body.first_vertex);
  return bounds({first, first + std::ptrdiff_t(body.vertices)});
}

double mean_edge(const Model& model, const Body& body) {
  double sum = 0;
  const auto& x = model.rest.positions;
  for (std::size_t t = body.first_triangle; t < body.first_triangle + body.triangles; ++t)
    for (std::size_t c = 0; c < 3; ++c) {
      const Triangle& corners = model.rest.surface[t];
      sum += glm::distance(x[corners[c]], x[corners[(c + 1) % 3]]);
    }
  return sum / double(std::max<std::size_t>(3 * body.triangles, 1));
}

TetMesh body_mesh(const Model& model, const Body& body) {
  const auto part = [](const auto& all, std::size_t first, std::size_t count) {
    const auto begin = all.begin() + std::ptrdiff_t(first);
    return std::vector(begin, begin + std::ptrdiff_t(count));
  };
  TetMesh mesh{part(model.rest.positions, body.first_vertex, body.vertices),
               part(model.rest.tets, body.first_tet, body.tets),
               part(model.rest.surface, body.first_triangle, body.triangles), body.one_piece, body.thickness};
  if (!model.rest.fill.empty()) mesh.fill = part(model.rest.fill, body.first_tet, body.tets);
  const auto shift = [&](auto& elements) {
    for (auto& element : elements)
      for (std::uint32_t& v : element) v -= std::uint32_t(body.first_vertex);
  };
  shift(mesh.tets), shift(mesh.surface);
  return mesh;
}

void check_settings(const Model& model, const Settings& settings) {
  if (!settings.bodies.empty() && settings.bodies.size() != model.bodies.size())
    throw Error(fmt::format("there are settings of {} bodies", settings.bodies.size()),
                fmt::format("a model of {}", model.bodies.size()), "give one for each body, or none");
  const bool published = solver_mode(settings).published, soft = any_material(settings, compliant);
  if (published && !(model.attachments.empty() && model.loads.empty() && model.fibres.empty()))
    throw Error(fmt::format("mode {} has no attachments, fibres and forces beside gravity", settings.mode), "settings",
                "use mode node or constraint");
  if (!model.fibres.empty() && !soft)
    throw Error("fibres pull on what is soft, and the bodies are hard", "settings", "give them a material");
  for (const Attachment& a : model.attachments)
    if ((a.stiffness > 0 || a.break_force) && !soft)
      throw Error("an attachment with a stiffness or a break_force holds what is soft, and the bodies are hard",
                  fmt::format("'{}' to '{}'", model.bodies[a.body].name, model.bodies[a.to].name),
                  "leave these out, or give a body a material");
  std::vector<std::string> names;
  for (const Body& body : model.bodies) names.push_back(body.name);
  check_settings(settings, "settings", names);
}

void renumber(Model& model) {
  const std::size_t count = model.rest.positions.size();
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(count);  // place along the curve, vertex
  std::vector<std::uint32_t> old(count), now(count);                 // vertex i was old[i]; what was i is now[i]
  for (const Body& body : model.bodies) {
    const Bounds box = body_bounds(body, model.rest.positions);
    parallel_for(body.vertices, [&](std::size_t v) {
      const std::size_t i = body.first_vertex + v;
      keys[i] = {hilbert_key(model.rest.positions[i], box), std::uint32_t(i)};
    });
    parallel_sort(std::span(keys).subspan(body.first_vertex, body.vertices));
  }
  for (std::uint32_t i = 0; i < count; ++i) old[i] = keys[i].second, now[old[i]] = i;
  const auto reorder = [&](auto& rows) {
    const auto from = rows;
    parallel_for(count, [&](std::size_t i) { rows[i] = from[old[i]]; });
  };
  for (auto* vectors : {&model.rest.positions, &model.positions, &model.velocities}) reorder(*vectors);
  for (auto* numbers : {&model.inverse_masses, &model.masses}) reorder(*numbers);
  reorder(model.original);
  const auto renumber_all = [&](std::vector<std::uint32_t>& vertices) {
    for (std::uint32_t& v : vertices) v = now[v];
  };
  for (Fixture& fixture : model.fixtures) renumber_all(fixture.vertices);
  for (Load& load : model.loads) renumber_all(load.vertices);
  for (Attachment& attachment : model.attachments) {
    renumber_all(attachment.vertices);
    for (Triangle& t : attachment.triangles)
      for (std::uint32_t& v : t) v = now[v];
  }
  const auto rename = [&](auto& elements) {
    parallel_for(elements.size(), [&](std::size_t i) {
      for (std::uint32_t& v : elements[i]) v = now[v];
    });
  };
  rename(model.rest.tets);
  rename(model.rest.surface);
}

namespace {

double parse_factor(const std::string& how) {
  const std::string text = how.substr(how.find(':') + 1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0) || value > 1e6)
    throw Error("bad factor", "--deform " + how, "give a number above 0, at most 1e6, as in stretch:2");
  return value;
}

// The tet nearest to the centre.
Tet middle_tet(const std::vector<glm::dvec3>& x, const TetMesh& rest, const glm::dvec3& centre) {
  if (rest.tets.empty()) throw Error("a sheet has no tets", "--deform", "take a deformation of all of it");
  return std::ranges::min(rest.tets, {}, [&](const Tet& t) {
    return glm::length((x[t[0]] + x[t[1]] + x[t[2]] + x[t[3]]) * 0.25 - centre);
  });
}

}  // namespace

void deform(std::vector<glm::dvec3>& x, const TetMesh& rest, const std::string& how, unsigned seed) {
  if (how.empty() || how == "none") return;
  const Bounds box = bounds(x);
  const glm::dvec3 centre = box.centre();
  std::mt19937 generator(seed);
  // std::uniform_real_distribution would give other numbers with another standard library.
  const auto unit = [&] { return double(generator()) / 4294967296.0; };
  if (how == "flatten") {
    for (auto& p : x) p.y = centre.y;
  } else if (how == "line") {
    for (auto& p : x) p = {p.x, centre.y, centre.z};
  } else if (how == "point") {
    std::ranges::fill(x, centre);
  } else if (how == "random") {
    for (auto& p : x)
      for (int a = 0; a < 3; ++a) p[a] = box.low[a] + unit() * (box.high[a] - box.low[a]);
  } else if (how == "mirror") {
    for (auto& p : x) p.x = 2 * centre.x - p.x;
  } else if (how.starts_with("stretch:") || how.starts_with("squash:")) {
    const double factor = parse_factor(how);
    for (auto& p : x) p.y = centre.y + (p.y - centre.y) * factor;
  } else if (how == "invert-one") {
    // Its first vertex is mirrored in the opposite face.
    const Tet t = middle_tet(x, rest, centre);
    const glm::dvec3 n = glm::normalize(glm::cross(x[t[2]] - x[t[1]], x[t[3]] - x[t[1]]));
    x[t[0]] -= 2 * glm::dot(x[t[0]] - x[t[1]], n) * n;
  } else if (how == "coincident") {
    const Tet t = middle_tet(x, rest, centre);
    x[t[0]] = x[t[1]];
  } else if (how.starts_with("twist:")) {
    const double turn = glm::radians(parse_factor(how));
    for (auto& p : x) {
      const double angle = turn * (p.y - box.low.y) / std::max(box.high.y - box.low.y, 1e-300);
      const double s = std::sin(angle), c = std::cos(angle), dx = p.x - centre.x, dz = p.z - centre.z;
      p.x = centre.x + c * dx + s * dz, p.z = centre.z - s * dx + c * dz;
    }
  } else if (how.starts_with("jitter:")) {
    const double most = parse_factor(how);
    glm::dvec3 move, axis;
    for (int a = 0; a < 3; ++a) move[a] = (2 * unit() - 1) * most * box.size(), axis[a] = 2 * unit() - 1;
    const double angle = (2 * unit() - 1) * most * glm::radians(360.0);
    const glm::dmat3 turn(glm::rotate(glm::dmat4(1), angle, axis));
    for (auto& p : x) p = centre + move + turn * (p - centre);
  } else if (how == "fold") {
    // One wing of the first hinge of the surface is laid onto the other.
    const auto all = hinges(rest);
    if (all.empty()) return;
    const auto& v = all[0];
    const glm::dvec3 e = glm::normalize(x[v[3]] - x[v[2]]);
    const auto across = [&](const glm::dvec3& p) { return (p - x[v[2]]) - e * glm::dot(p - x[v[2]], e); };
    const glm::dvec3 a = across(x[v[0]]), b = across(x[v[1]]);
    x[v[1]] += glm::normalize(a) * glm::length(b) - b;
  } else {
    throw Error("no such deformation", "--deform " + how,
                "choose from none, flatten, line, point, random, mirror, stretch:F, squash:F, twist:DEGREES, "
                "jitter:F, invert-one, coincident, fold");
  }
}

}  // namespace tetpbd
