// Contact of bodies in double: that nothing passes through anything, what impulses keep, and closed forms.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>

#include "sim/contact/offset_contact.h"
#include "sim/measure/crossings.h"
#include "sim/model/material.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/objective.h"
#include "tests/contact/barrier.h"
#include "tests/long_run.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

const Compliances none = [] {
  Compliances all;
  all.fill(INFINITY);
  return all;
}();

struct Stage {
  Model model{};
  Settings settings{};
  ConstraintSystem system{};
  std::unique_ptr<Leapfrog> run{};
  double h = 0, first_energy = 0, highest = -INFINITY, scale = 0;
  std::size_t crossings = 0;
  long vertex_substeps = 0;

  Stage() {
    settings.mode = "explicit", settings.material = "neo-hookean", settings.young_modulus = 1e6;
    settings.poisson_ratio = 0.3, settings.ground = false, settings.contact = "bodies", settings.friction = 0.5;
    settings.constraint_damping = 1e-4;
  }
  BodySettings& add(const TetMesh& mesh, const glm::dvec3& at, const glm::dvec3& velocity = glm::dvec3(0),
                    const glm::dvec3& spin = glm::dvec3(0), double density = 1000, bool fixed = false) {
    std::vector<glm::dvec3> positions = mesh.positions;
    for (glm::dvec3& p : positions) p += at;
    std::vector<std::uint32_t> held;
    for (std::uint32_t i = 0; i < positions.size() && fixed; ++i) held.push_back(i);
    add_body(model, "body", mesh, density, positions, velocity, spin, held);
    return settings.bodies.emplace_back();
  }
  void floor(double half) { add(make_block({2 * half, 0.1, 2 * half}, {2, 1, 2}), {0, -0.05, 0}, {}, {}, 1000, true); }
  // `part` of the longest stable step.
  void begin(double part = 0.4) {
    system = build_constraints(model, settings);
    const ReferenceInput input{model, system, settings, model.inverse_masses};
    h = settings.dt / std::ceil(settings.dt / (part * stable_step(input, none, model.rest.positions, 60)));
    run = std::make_unique<Leapfrog>(leapfrog(input, none, {model.positions, model.velocities}, h));
    first_energy = energy_now(), crossings = cuts();
  }
  std::size_t cuts() const {
    return find_crossings(model, run ? run->x : model.positions, settings.contact == "self").pairs;
  }
  double energy_now() {
    const State now = make_state(*run);
    Objective o{.system = system,
                .compliances = none,
                .masses = std::vector<double>(model.masses.size(), 0),
                .predicted = model.rest.positions};
    double sum = energy(o, now.positions);
    for (std::size_t i = 0; i < now.positions.size(); ++i)
      if (model.inverse_masses[i] > 0)
        sum += model.masses[i] *
               (0.5 * glm::dot(now.velocities[i], now.velocities[i]) + settings.gravity * now.positions[i].y);
    return sum;
  }
  void advance_to(double seconds, const std::function<void()>& each = {}) {
    const long steps = std::lround((seconds - run->time[0]) / h), chunk = std::max(1L, std::lround(1e-3 / h));
    for (long s = 0; s < steps; s += chunk) {
      advance(*run, std::min(chunk, steps - s));
      vertex_substeps += chunk * long(model.positions.size());
      crossings = std::max(crossings, cuts());
      highest = std::max(highest, energy_now());
      if (each) each();
    }
  }
  double created() const { return (highest - first_energy) / scale; }
  double truncated() const { return double(run->pairs.counts().truncated) / double(vertex_substeps); }
  glm::dvec3 mean(const Body& body, const std::vector<glm::dvec3>& of) const {
    glm::dvec3 sum(0);
    double mass = 0;
    for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i)
      sum += model.masses[i] * of[i], mass += model.masses[i];
    return sum / mass;
  }
  glm::dvec3 centre(std::size_t body) const { return mean(model.bodies[body], run->x); }
  glm::dvec3 velocity(std::size_t body) const { return mean(model.bodies[body], run->v); }
  glm::dvec3 momentum() const {
    glm::dvec3 sum(0);
    for (std::size_t i = 0; i < run->v.size(); ++i)
      if (model.inverse_masses[i] > 0) sum += model.masses[i] * run->v[i];
    return sum;
  }
  glm::dvec3 spin() const {
    glm::dvec3 sum(0);
    const State now = make_state(*run);
    for (std::size_t i = 0; i < run->v.size(); ++i)
      sum += model.masses[i] * glm::cross(now.positions[i], now.velocities[i]);
    return sum;
  }
  void check(double most_created = 1e-3, double most_truncated = 1e-3) const {
    CHECK(crossings == 0);
    CHECK(created() < most_created);
    CHECK(run->pairs.counts().gained < 1e-6 * scale);
    CHECK(truncated() < most_truncated);
  }
};

TetMesh ball(int n, double radius) {
  TetMesh mesh = make_block(glm::dvec3(2), glm::ivec3(n));
  for (glm::dvec3& p : mesh.positions) {
    const double cube = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}), length = glm::length(p);
    p *= radius * (0.4 + (length > 0 ? 0.6 * cube / length : 0));
  }
  return mesh;
}

}  // namespace

TEST_CASE("offset contact: two cubes fall on a floor and on each other (long)") {
  Stage s;
  s.settings.young_modulus = 3e5;
  s.floor(1);
  s.add(make_block(glm::dvec3(0.2), glm::ivec3(4)), {0, 0.3, 0});
  s.add(make_block(glm::dvec3(0.2), glm::ivec3(4)), {0.013, 0.55, 0.007});
  s.scale = 8 * 9.81 * 0.55;
  s.begin();
  s.advance_to(is_long_run() ? 2.0 : 0.6);
  MESSAGE("created ", s.created(), " truncated ", s.truncated(), " nearest ", s.run->pairs.counts().nearest, " gained ",
          s.run->pairs.counts().gained / s.scale, " y ", s.centre(2).y);
  s.check();
}

TEST_CASE(
    "offset contact: a block stays on a slope below the angle of friction, and slides as Coulomb has it above (long)") {
  for (const double degrees : {20.0, 35.0}) {
    CAPTURE(degrees);
    Stage s;
    s.add(make_block({2.4, 0.1, 0.4}, {24, 1, 4}), {0.6, -0.05, 0}, {}, {}, 1000, true);
    s.add(make_block({0.2, 0.1, 0.2}, {4, 2, 4}), {0, 0.0587, 0});
    s.settings.gravity = 9.81;
    s.scale = 4 * 9.81 * 0.1;
    // The slope is level and gravity is not: an obstacle-free world has only the one along y, so all is turned.
    const double a = degrees * 3.14159265358979 / 180;
    const glm::dmat3 turn(std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a), 0, 0, 0, 1);
    for (auto* points : {&s.model.rest.positions, &s.model.positions})
      for (glm::dvec3& p : *points) p = turn * p;
    s.begin();
    const glm::dvec3 from = s.centre(1);
    glm::dvec3 half(0);
    s.advance_to(0.5);
    half = s.centre(1);
    s.advance_to(1);
    const glm::dvec3 down = turn * glm::dvec3(1, 0, 0);
    const double moved = glm::dot(s.centre(1) - from, down), last = glm::dot(s.centre(1) - half, down);
    const double right = 0.5 * 9.81 * (std::sin(a) - 0.5 * std::cos(a));
    MESSAGE("moved ", moved, ", in the last half second ", last, ", right ", right);
    if (degrees < 26)
      CHECK(std::abs(last) < 1e-5);
    else
      CHECK(std::abs(moved - right) < 0.02 * right);
    s.check();
  }
}

TEST_CASE("offset contact: a ball at 50 m/s bounces off a plate of 2 cm, fixed or soft (long)") {
  for (const bool soft : {false, true}) {
    CAPTURE(soft);
    Stage s;
    s.settings.young_modulus = 3e6, s.settings.gravity = 0, s.settings.friction = 0.3;
    TetMesh plate = make_block({0.4, 0.4, 0.02}, soft ? glm::ivec3(16, 16, 1) : glm::ivec3(8, 8, 1));
    s.add(plate, glm::dvec3(0), {}, {}, 1000, !soft);
    s.add(ball(6, 0.08), {0.01, 0.02, 0.2}, {0, 0, -50});
    s.settings.bodies[1].material = s.settings, s.settings.bodies[1].material->young_modulus = 1e7;
    for (std::size_t i = 0; i < plate.positions.size() && soft; ++i)
      if (std::max(std::abs(plate.positions[i].x), std::abs(plate.positions[i].y)) > 0.19)
        s.model.inverse_masses[i] = 0;
    s.begin();
    s.scale = s.first_energy;
    s.advance_to(soft ? 0.024 : 0.012);
    MESSAGE("z ", s.centre(1).z, " v ", s.velocity(1).z, " created ", s.created(), " truncated ", s.truncated(),
            " nearest ", s.run->pairs.counts().nearest, " detections ", s.run->pairs.counts().detections, " h ", s.h);
    CHECK(s.centre(1).z > 0);
    s.check();
  }
}

TEST_CASE("offset contact: two spinning balls keep momentum and angular momentum, with friction and without") {
  for (const double friction : {0.5, 0.0}) {
    CAPTURE(friction);
    Stage s;
    s.settings.young_modulus = 3e5, s.settings.gravity = 0, s.settings.friction = friction;
    s.add(ball(5, 0.1), {-0.11, 0, 0}, {2, 0, 0}, {-6, 4, 10});
    s.add(ball(5, 0.1), {0.11, 0.03, 0.01}, {-2, 0, 0}, {3, -5, 8});
    s.begin();
    s.scale = s.first_energy;
    const glm::dvec3 p = s.momentum(), l = s.spin();
    s.advance_to(is_long_run() ? 0.3 : 0.12);
    const double lost = glm::length(s.spin() - l) / glm::length(l);
    MESSAGE("momentum ", glm::length(s.momentum() - p), " angular ", lost, " created ", s.created(), " gained ",
            s.run->pairs.counts().gained / s.scale);
    CHECK(glm::length(s.momentum() - p) < 1e-9);
    CHECK(lost < 1e-5);
    CHECK(s.velocity(1).x > s.velocity(0).x);
    s.check();
  }
}

TEST_CASE("offset contact: a thin plate falls edge on edge on another and stays above it") {
  Stage s;
  s.settings.young_modulus = 1e7;
  const TetMesh lower = make_block({0.4, 0.2, 0.02}, {8, 4, 1}), upper = make_block({0.02, 0.2, 0.4}, {1, 4, 8});
  s.add(lower, {0, 0.1, 0});
  s.add(upper, {0, 0.35, 0}, {0, -2, 0});
  for (std::size_t i = 0; i < lower.positions.size(); ++i)
    if (lower.positions[i].y < -0.0999) s.model.inverse_masses[i] = 0;
  s.scale = 1.6 * (0.5 * 4 + 9.81 * 0.1);
  s.begin();
  double lowest = 1;
  s.advance_to(is_long_run() ? 0.5 : 0.1, [&] { lowest = std::min(lowest, s.centre(1).y); });
  MESSAGE("lowest ", lowest, " created ", s.created(), " truncated ", s.truncated());
  CHECK(lowest > 0.25);
  s.check();
}

TEST_CASE("offset contact: a bent beam closes on itself without passing through (long)") {
  Stage s;
  s.settings.young_modulus = 1e6, s.settings.gravity = 0, s.settings.friction = 0.3, s.settings.contact = "self";
  const TetMesh beam = make_block({1.6, 0.04, 0.04}, {40, 1, 1});
  s.add(beam, glm::dvec3(0));
  for (std::size_t i = 0; i < beam.positions.size(); ++i) {
    const double x = beam.positions[i].x, q = std::abs(x) - 0.05;
    if (q < 0)
      s.model.inverse_masses[i] = 0;
    else
      s.model.velocities[i] = {0, 12 * q * 0.8, (x > 0 ? 1.0 : -0.6) * q};
  }
  s.begin();
  s.scale = s.first_energy;
  s.advance_to(is_long_run() ? 1.0 : 0.35);
  MESSAGE("created ", s.created(), " truncated ", s.truncated(), " crossings ", s.crossings);
  s.check(5e-3, 5e-3);
}

TEST_CASE("offset contact: a hundred times the mass on top, and below (long)") {
  for (const bool heavy : {true, false}) {
    CAPTURE(heavy);
    Stage s;
    s.settings.young_modulus = 2e6;
    s.floor(1);
    s.add(make_block(glm::dvec3(0.2), glm::ivec3(4)), {0, 0.11, 0}, {}, {}, heavy ? 100 : 10000);
    s.add(make_block(glm::dvec3(0.2), glm::ivec3(4)), {0.003, 0.32, 0.001}, {}, {}, heavy ? 10000 : 100);
    s.scale = 80 * 9.81 * 0.1;
    s.begin();
    s.advance_to(is_long_run() ? 1.0 : 0.3);
    MESSAGE("upper ", s.centre(2).y, " lower ", s.centre(1).y, " created ", s.created(), " truncated ", s.truncated(),
            " pairs ", s.run->pairs.counts().pairs, " detections ", s.run->pairs.counts().detections, " h ", s.h);
    CHECK(s.centre(2).y - s.centre(1).y > 0.18);
    s.check();
  }
}

TEST_CASE("offset contact: two thousand times the mass stands on a cube (long)") {
  Stage s;
  s.settings.young_modulus = 1e7;
  s.floor(1);
  s.add(make_block(glm::dvec3(0.2), glm::ivec3(4)), {0, 0.109, 0}, {}, {}, 50);
  s.add(make_block(glm::dvec3(0.2), glm::ivec3(4)), {0.003, 0.318, 0.001}, {}, {}, 100000);
  s.scale = 800 * 9.81 * 0.1;
  s.begin();
  s.advance_to(is_long_run() ? 1.0 : 0.1);
  MESSAGE("upper ", s.centre(2).y, " lower ", s.centre(1).y, " created ", s.created(), " truncated ", s.truncated());
  CHECK(s.centre(1).y > 0.09);
  CHECK(s.centre(2).y > 0.29);
  s.check();
}

TEST_CASE("offset contact: what rests keeps its distance, whatever the meshes (long)") {
  for (const int cells : {1, 4}) {
    CAPTURE(cells);
    Stage s;
    s.settings.young_modulus = 1e6, s.settings.damping = 3;
    TetMesh sheet = make_block({0.6, 0.02, 0.6}, {1, 1, 1});
    sheet.tets.clear(), sheet.thickness = 0.004;
    Material cloth = s.settings;
    cloth.material = "none", cloth.constraints = "stretch,isobend";
    cloth.compliance[index_of<Stretch>] = cloth.compliance[index_of<Isobend>] = 1e-4;
    s.add(sheet, {0, -0.01, 0}, {}, {}, 1000, true).material = cloth;
    s.add(make_block(glm::dvec3(0.1), glm::ivec3(cells)), {0, 0.056, 0});
    s.scale = 9.81 * 0.1;
    s.begin();
    s.advance_to(1.0);
    double lowest = 1;
    for (std::size_t i = s.model.bodies[1].first_vertex; i < s.model.positions.size(); ++i)
      lowest = std::min(lowest, s.run->x[i].y);
    MESSAGE("distance ", lowest);
    CHECK(std::abs(lowest - 0.004) < 0.0004);
    s.check();
  }
}

TEST_CASE("offset contact: linked rings hold each other") {
  Stage s;
  s.settings.friction = 0.3;
  const auto ring = [](const glm::dvec3& at, bool upright) {
    TetMesh mesh = make_block({1, 0.03, 0.03}, {24, 2, 2}), closed;
    const auto number = [&](std::uint32_t v) {  // the last cross-section is the first
      const glm::dvec3 p = mesh.positions[v];
      for (std::uint32_t o = 0; o < v && p.x > 0.4999; ++o)
        if (glm::distance(mesh.positions[o], p - glm::dvec3(1, 0, 0)) < 1e-9) return o;
      return v;
    };
    for (Tet tet : mesh.tets) {
      for (std::uint32_t& v : tet) v = number(v);
      closed.tets.push_back(tet);
    }
    for (const glm::dvec3& p : mesh.positions) {
      const double turn = 2 * 3.14159265358979 * p.x, r = 0.1 + p.y;
      const glm::dvec3 q(r * std::cos(turn), r * std::sin(turn), p.z);
      closed.positions.push_back(at + (upright ? glm::dvec3(q.z, q.y, q.x) : q));
    }
    finish_tets(closed, "ring");
    return closed;
  };
  const TetMesh upper = ring({0, 0, 0}, false);
  s.add(upper, glm::dvec3(0));
  s.add(ring({0, -0.13, 0}, true), glm::dvec3(0), {0, -5, 0});
  for (std::size_t i = 0; i < upper.positions.size(); ++i)
    if (upper.positions[i].y > 0.08) s.model.inverse_masses[i] = 0;
  s.scale = 0.5 * 0.56 * 25;
  s.begin();
  s.advance_to(is_long_run() ? 0.4 : 0.1);
  MESSAGE("lower ", s.centre(1).y, " created ", s.created(), " truncated ", s.truncated());
  CHECK(s.centre(1).y > -0.3);
  s.check();
}

TEST_CASE("offset contact: bodies bounce as barriers have it") {
  for (const bool rods : {false, true}) {
    CAPTURE(rods);
    Stage s;
    s.settings.young_modulus = rods ? 1e6 : 1e5;
    s.settings.gravity = 0, s.settings.friction = 0, s.settings.constraint_damping = 0;
    if (rods) {
      s.add(make_block({0.4, 0.05, 0.05}, {8, 1, 1}), {0, 0, 0}, {0, 1, 0});
      s.add(make_block({0.05, 0.05, 0.4}, {1, 1, 8}), {0.013, 0.07, 0.006}, {0, -1, 0});
    } else {
      s.add(make_block(glm::dvec3(0.2), glm::ivec3(3)), {0, 0, 0}, {1, 0, 0});
      s.add(make_block(glm::dvec3(0.2), glm::ivec3(3)), {0.23, 0.013, 0.006}, {-1, 0, 0});
    }
    const double mass = body_mass(s.model, s.model.bodies[0]);
    s.begin();
    s.scale = s.first_energy;
    const double seconds = rods ? 0.04 : 0.05;
    s.advance_to(seconds);
    s.check();
    BarrierRun barrier{s.model, s.system, none, 2.5e-4, 0.15 * 0.06, 1e8};
    for (double t = 0; t < seconds - 1e-9; t += barrier.h) barrier.step();
    const int axis = rods ? 1 : 0;
    const double right = s.mean(s.model.bodies[1], barrier.v)[axis], ours = s.velocity(1)[axis];
    MESSAGE("mass ", mass, " velocity ", ours, ", of barriers ", right, ", nearest ", barrier.nearest, ", iterations ",
            barrier.most_iterations, ", created ", s.created());
    CHECK(right > 0.3);
    // What vertices of surfaces carry towards each other is lost, with these coarse meshes a seventh of all.
    CHECK(ours > 0.8 * right);
    CHECK(ours < 1.02 * right);
    CHECK(find_crossings(s.model, barrier.x, false).pairs == 0);
  }
}

TEST_CASE("offset contact: a stack of three and cloth on a ball rest where barriers have them (long)") {
  for (const bool cloth : {false, true}) {
    CAPTURE(cloth);
    Stage s;
    s.settings.friction = 0, s.settings.constraint_damping = 0, s.settings.damping = cloth ? 60 : 30;
    if (cloth) {
      Material material = s.settings;
      material.material = "none", material.constraints = "stretch,isobend";
      material.compliance[index_of<Stretch>] = 1e-4, material.compliance[index_of<Isobend>] = 1e3;
      TetMesh sheet = make_sheet({0.4, 0.4}, {7, 7});
      sheet.thickness = 0.004;
      s.add(ball(3, 0.12), {0, 0, 0}, {}, {}, 1000, true);
      s.add(sheet, {0, 0.1242, 0}, {}, {}, 300).material = material;
    } else {
      s.settings.young_modulus = 1e5;
      for (int b = 0; b < 3; ++b)
        s.add(make_block(glm::dvec3(0.2), glm::ivec3(2)), {0.013 * b, 0.209 * b, 0.006 * b}, {}, {}, 1000, b == 0);
    }
    s.begin();
    s.scale = 1;
    const double seconds = is_long_run() ? 0.5 : 0.2;
    s.advance_to(seconds);
    CHECK(s.crossings == 0);
    const double gap = cloth ? 0.004 : 0.009;
    BarrierRun barrier{s.model, s.system, none, 2.5e-4, gap, 1e8, s.settings.gravity};
    for (double t = 0; t < seconds - 1e-9; t += barrier.h) {
      barrier.step();
      for (glm::dvec3& v : barrier.v) v *= std::exp(-s.settings.damping * barrier.h);
    }
    for (std::size_t b = 1; b < s.model.bodies.size(); ++b) {
      const Body& body = s.model.bodies[b];
      const double start = s.mean(body, s.model.positions).y, ours = start - s.centre(b).y,
                   right = start - s.mean(body, barrier.x).y;
      MESSAGE("cloth ", cloth, ", body ", b, ": sank by ", ours, " m, with barriers by ", right);
      CHECK(right > 0.002);
      CHECK(std::abs(ours - right) < 0.05 * right + 0.05 * gap * double(b));  // surfaces rest at 0.95 of their offset
    }
    CHECK(find_crossings(s.model, barrier.x, false).pairs == 0);
  }
}

TEST_CASE("offset contact: three cloths bear a block, and nothing goes through") {
  Stage s;
  Material cloth = s.settings;
  cloth.material = "none", cloth.constraints = "stretch,isobend", cloth.constraint_damping = 1e-3;
  cloth.compliance[index_of<Stretch>] = 1e-2, cloth.compliance[index_of<Isobend>] = 1e3;
  s.floor(0.2);
  TetMesh sheet = make_sheet({0.36, 0.36}, {8, 8});
  sheet.thickness = 0.002;
  for (int k = 0; k < 3; ++k) s.add(sheet, {0.003 * k, 0.0022 + 0.0022 * k, -0.002 * k}, {}, {}, 300).material = cloth;
  s.add(make_block(glm::dvec3(0.2), glm::ivec3(3)), {0, 0.1092, 0}, {}, {}, 2000);
  s.scale = 16 * 9.81 * 0.1;
  s.begin();
  s.advance_to(is_long_run() ? 0.5 : 0.06);
  const Body& block = s.model.bodies[4];
  double lowest = 1;
  for (std::size_t i = block.first_vertex; i < s.model.positions.size(); ++i) lowest = std::min(lowest, s.run->x[i].y);
  MESSAGE("block ", lowest, " created ", s.created(), " truncated ", s.truncated(), " nearest ",
          s.run->pairs.counts().nearest, " h ", s.h);
  CHECK(lowest > 0.003);  // a fall that nothing stopped would have taken 17 mm
  CHECK(lowest < 0.0095);
  s.check(1e-3, 1e-2);
}

TEST_CASE("offset contact: two blocks slide on each other as Coulomb has it (long)") {
  Stage s;
  s.settings.friction = 0.3;
  s.floor(1);
  s.add(make_block({0.6, 0.1, 0.3}, {12, 2, 6}), {0, 0.058, 0});
  s.add(make_block({0.2, 0.1, 0.2}, {4, 2, 4}), {-0.15, 0.167, 0}, {1.5, 0, 0});
  for (std::size_t i = s.model.bodies[1].first_vertex; i < s.model.bodies[2].first_vertex; ++i)
    if (s.model.rest.positions[i].y < -0.049) s.model.inverse_masses[i] = 0;
  s.scale = 4 * 9.81 * 0.1 + 4.5;
  s.begin();
  const glm::dvec3 from = s.centre(2);
  s.advance_to(is_long_run() ? 0.9 : 0.3);
  const double seconds = is_long_run() ? 1.5 / (0.3 * 9.81) : 0.3, moved = s.centre(2).x - from.x;
  const double right = 1.5 * seconds - 0.5 * 0.3 * 9.81 * seconds * seconds;
  MESSAGE("moved ", moved, ", right ", right, ", created ", s.created(), " truncated ", s.truncated());
  CHECK(std::abs(moved - right) < 0.02 * right);
  s.check();
}

TEST_CASE("offset contact: what an impact loses goes with the mesh, and bars exchange their speeds as it is refined") {
  double last = 0;
  for (const int cells : {2, 4, 8}) {
    CAPTURE(cells);
    Stage s;
    s.settings.gravity = 0, s.settings.poisson_ratio = 0, s.settings.constraint_damping = 0;
    for (const double side : {-1.0, 1.0})
      s.add(make_block({0.4, 0.1, 0.1}, {cells, std::max(1, cells / 4), std::max(1, cells / 4)}, true),
            {0.3 * side, 0, 0}, {-side, 0, 0});
    s.scale = 4;  // J, of two bars of 4 kg at 1 m/s
    s.begin();
    s.advance_to(0.25);
    // What vertices of the faces carry towards each other is lost; in the limit each bar has the other's speed.
    const double left = 1 + (s.energy_now() - s.first_energy) / s.scale, rebound = s.velocity(1).x;
    MESSAGE(cells, " cells: energy left ", left, " rebound ", rebound);
    CHECK(left > 1 - 1.0 / cells);
    CHECK(left <= 1 + 1e-6);
    CHECK(s.created() < 1e-6);
    CHECK(s.crossings == 0);
    CHECK(rebound > last + 0.05);
    last = rebound;
  }
  CHECK(last > 0.85);
}
