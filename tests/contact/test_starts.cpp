// Starts: what begins inside something else is moved out by the shortest way, or refused by name.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "sim/contact/convex.h"
#include "sim/contact/moving_obstacle.h"
#include "sim/contact/obstacle_kinds.h"
#include "sim/contact/starts.h"
#include "sim/error.h"
#include "sim/measure/overlap.h"
#include "tests/long_run.h"

using namespace tetpbd;

namespace {

double unit(std::mt19937& random) { return double(random()) / 4294967296.0; }
glm::dvec3 within(std::mt19937& random, double reach) {
  const double x = unit(random), y = unit(random), z = unit(random);
  return reach * (2.0 * glm::dvec3(x, y, z) - 1.0);
}

// A block of this size whose lowest corner is at `low`, turned about its middle.
void add_block(Model& model, const std::string& name, const glm::dvec3& low, double size = 1, int cells = 4,
               const glm::dvec3& degrees = glm::dvec3(0), bool hold_bottom = false) {
  TetMesh mesh = make_block(glm::dvec3(size), glm::ivec3(cells));
  std::vector<std::uint32_t> fixed;
  const Bounds box = bounds(mesh.positions);
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v)
    if (hold_bottom && mesh.positions[v].y < box.low.y + 1e-9) fixed.push_back(v);
  for (glm::dvec3& p : mesh.positions) p = rotation_of(degrees) * (p - box.centre()) + low + glm::dvec3(0.5 * size);
  add_body(model, name, mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), fixed);
}

Obstacle ball(const glm::dvec3& centre, double radius) {
  Obstacle o;
  o.kind = find_obstacle_kind("sphere"), o.centre = centre, o.radius = radius;
  return o;
}
Obstacle box(const glm::dvec3& centre, const glm::dvec3& half) {
  Obstacle o;
  o.kind = find_obstacle_kind("box"), o.centre = centre, o.half = half;
  return o;
}

Settings without_ground() {
  Settings settings;
  settings.ground = false;
  return settings;
}

// m, of the vertex that is deepest in an obstacle.
double depth(const Model& model, const Settings& settings) {
  double deepest = 0;
  for (const MovingObstacle& o : obstacles_at(model, settings, 0))
    for (const glm::dvec3& x : model.positions) deepest = std::max(deepest, -o.surface_at(x).distance);
  return deepest;
}

}  // namespace

TEST_CASE("starts: two tets are as deep in each other as it takes to part them") {
  const ConvexCell a{{glm::dvec3(0, 0, 0), {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 4};
  const auto moved = [&](const glm::dvec3& by) {
    ConvexCell b = a;
    for (glm::dvec3& corner : b.corners) corner += by;
    return b;
  };
  CHECK(overlap_depth(a, moved({1, 0, 0})) == 0);  // a corner on a corner
  CHECK(overlap_depth(a, moved({2, 2, 2})) == 0);
  const ConvexCell below{{glm::dvec3(0, 0, 0), {0, 1, 0}, {1, 0, 0}, {0, 0, -1}}, 4};
  CHECK(overlap_depth(a, below) == 0);  // a whole face in common is no overlap
  const ConvexCell up{{glm::dvec3(0, 0, 0.1), {0, 1, 0.1}, {1, 0, 0.1}, {0, 0, -0.9}}, 4};
  CHECK(overlap_depth(a, up) == doctest::Approx(0.1));
  CHECK(exit_distance(up, a, {0, 0, -1}) == doctest::Approx(0.1));
  CHECK(exit_distance(up, a, glm::normalize(glm::dvec3(0, 0.6, -0.8))) == doctest::Approx(0.125));
  std::mt19937 random(seed_of_run(3));
  for (int trial = 0; trial < 200; ++trial) {  // along any way that is long enough the two are apart, and not before
    ConvexCell p{.corners = {}, .count = 4}, q{.corners = {}, .count = 4};
    for (std::size_t c = 0; c < 4; ++c) p.corners[c] = within(random, 1), q.corners[c] = within(random, 1);
    const double deep = overlap_depth(p, q);
    if (deep == 0) continue;
    const glm::dvec3 way = glm::normalize(within(random, 1));
    const double far = exit_distance(p, q, way);
    CHECK(far >= deep - 1e-12);
    const auto along = [&](double t) {
      ConvexCell r = p;
      for (glm::dvec3& corner : r.corners) corner += t * way;
      return overlap_depth(r, q);
    };
    CHECK(along(far) < 1e-12);
    CHECK(along(far - 1e-6) > 0);
  }
}

TEST_CASE("starts: a body in the ground is raised by how deep it is, and one that touches stays") {
  for (const double deep : {0.0, 1e-9, 0.002, 0.02, 0.1}) {
    CAPTURE(deep);
    Model model;
    add_block(model, "cube", {0, -deep, 0});
    const auto before = model.positions;
    const auto motions = separate_starts(model, Settings{});
    REQUIRE(motions.size() == (deep > 1e-8 ? 1u : 0u));
    if (motions.empty()) {
      CHECK(model.positions == before);
      continue;
    }
    CHECK(glm::length(motions[0].motion - glm::dvec3(0, deep, 0)) < 1e-9);
    CHECK(motions[0].work == doctest::Approx(1000 * 9.81 * deep));
    CHECK(motions[0].from == "the ground");
    CHECK(depth(model, Settings{}) < 1e-9);
  }
}

TEST_CASE("starts: out of obstacles, also those that no vertex is in") {
  Model model;
  model.obstacles = {ball({0.5, 0.4, 0.5}, 0.1)};  // inside the cube, nearer to its bottom: 0.5 m up
  add_block(model, "cube", {0, 0, 0});
  const auto motions = separate_starts(model, without_ground());
  REQUIRE(motions.size() == 1);
  CHECK(glm::length(motions[0].motion) == doctest::Approx(0.5).epsilon(0.01));
  CHECK(motions[0].motion.y == doctest::Approx(0.5).epsilon(0.01));
  CHECK(motions[0].from == "obstacle 0 (sphere)");
}

TEST_CASE("starts: what holds vertices stays, and is refused where others are inside") {
  Model bolted;  // only what is fixed is in the box
  bolted.obstacles = {box({0.5, -0.5, 0.5}, {2, 0.55, 2})};
  add_block(bolted, "beam", {0, 0, 0}, 1, 4, glm::dvec3(0), true);
  CHECK(separate_starts(bolted, without_ground()).empty());
  Model deep;
  deep.obstacles = {box({0.5, -0.5, 0.5}, {2, 0.8, 2})};
  add_block(deep, "beam", {0, 0, 0}, 1, 4, glm::dvec3(0), true);
  const auto before = deep.positions;
  try {
    separate_starts(deep, without_ground());
    FAIL("not refused");
  } catch (const Error& error) {
    const std::string text = error.what();
    CHECK(error.exit_status == 2);
    CHECK(text.find("'beam'") != text.npos);
    CHECK(text.find("obstacle 0 (box)") != text.npos);
    CHECK(deep.positions == before);
  }
}

TEST_CASE("starts: bodies in each other are parted, by whole cells as well, and a stack in the ground rises whole") {
  Settings settings = without_ground();
  settings.contact = "bodies";
  for (const glm::dvec3& at : {glm::dvec3(0.44, 0.03, 0.02), glm::dvec3(0.375, 0, 0), glm::dvec3(0.5, 0.125, 0)}) {
    CAPTURE(at.x);
    Model model;
    add_block(model, "a", {0, 0, 0}, 0.5), add_block(model, "b", at, 0.5);
    const auto motions = separate_starts(model, settings);
    const double deep = 0.5 - at.x;
    // Out of the other, and then as far from it as contact keeps them.
    REQUIRE(std::ranges::count_if(motions, [](const auto& m) { return !m.from.empty(); }) == (deep > 0 ? 1 : 0));
    if (deep > 0) CHECK(glm::length(motions[0].motion) == doctest::Approx(deep).epsilon(0.01));
    Settings apart = settings;
    apart.contact = "none";
    CHECK(separate_starts(model, apart).empty());
    CHECK(separate_starts(model, settings).empty());  // nothing is left to move
  }
  Model stack;
  add_block(stack, "lower", {0, -0.02, 0}, 0.5), add_block(stack, "upper", {0, 0.47, 0}, 0.5);
  settings.ground = true;
  const auto motions = separate_starts(stack, settings);
  REQUIRE(motions.size() == 3);
  CHECK(glm::length(motions[0].motion - glm::dvec3(0, 0.02, 0)) < 1e-9);
  CHECK(glm::length(motions[1].motion - glm::dvec3(0, 0.03, 0)) < 1e-4);
}

TEST_CASE("starts: whatever bodies are in at random, nothing is left inside") {
  std::mt19937 random(seed_of_run(11));
  const int trials = is_long_run() ? 200 : 20;
  Settings settings;
  settings.contact = "bodies";
  for (int trial = 0; trial < trials; ++trial) {
    CAPTURE(trial);
    Model model;
    for (int o = int(3 * unit(random)); o > 0; --o)
      model.obstacles.push_back(unit(random) < 0.5 ? ball(within(random, 1), 0.1 + unit(random))
                                                   : box(within(random, 1), within(random, 0.4) + 0.5));
    for (int b = 1 + int(2 * unit(random)); b > 0; --b)
      add_block(model, "body " + std::to_string(b), within(random, 0.5), 0.3 + unit(random), 2, within(random, 180));
    separate_starts(model, settings);
    CHECK(depth(model, settings) < 1e-5);
    const Overlap left = measure_overlap(model, model.positions, false);
    CHECK(left.deepest < 1e-5);
    CHECK(separate_starts(model, settings).empty());
  }
}
