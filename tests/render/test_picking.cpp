// The camera's arithmetic, and rays through its pixels that meet the surface.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "render/picking.h"
#include "tests/render/render_stage.h"

using namespace tetpbd;

TEST_CASE("camera: pixels, rays and framing agree") {
  Camera camera;
  camera.target = {1, 2, 3};
  orbit(camera, 40, 20);
  CHECK(glm::length(eye(camera) - camera.target) == doctest::Approx(camera.distance));
  const glm::vec3 point{1.3f, 2.2f, 2.9f};
  const glm::vec3 seen = project(camera, point, width, height);
  const Ray ray = pixel_ray(camera, seen.x, seen.y, width, height);
  const glm::vec3 towards = point - ray.origin;
  CHECK(glm::length(glm::cross(ray.direction, towards)) < 1e-4f);
  CHECK(glm::length(ray.direction) == doctest::Approx(1.0f));

  const glm::vec3 middle = project(camera, camera.target, width, height);
  CHECK(middle.x == doctest::Approx(width * 0.5));
  CHECK(middle.y == doctest::Approx(height * 0.5));
  const glm::vec3 before = camera.target;
  pan(camera, 30, -12, height);
  const glm::vec3 panned = project(camera, before, width, height);
  CHECK(panned.x == doctest::Approx(width * 0.5 + 30).epsilon(1e-3));
  CHECK(panned.y == doctest::Approx(height * 0.5 - 12).epsilon(1e-3));

  const glm::vec3 low{-1, 0, -4}, high{3, 1, 0.5f};
  for (float aspect : {0.5f, 1.0f, 2.5f}) {
    frame_box(camera, low, high, aspect, 1.1f);
    const int w = int(200 * aspect), h = 200;
    float reach = 0;
    for (int i = 0; i < 8; ++i) {
      const glm::vec3 p =
          project(camera, {i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z}, w, h);
      reach = std::max({reach, std::abs(p.x / float(w) - 0.5f) * 2, std::abs(p.y / float(h) - 0.5f) * 2});
    }
    CHECK(reach == doctest::Approx(1 / 1.1f).epsilon(0.02));
  }
  orbit(camera, 0, 500);
  CHECK(camera.elevation == 89.0f);
}

TEST_CASE("camera: it follows as far in many short steps as in one long one") {
  Camera few, many;
  const glm::vec3 goal{3, -1, 2};
  follow(few, goal, 0.4f);
  for (int i = 0; i < 40; ++i) follow(many, goal, 0.01f);
  CHECK(glm::distance(few.target, many.target) < 1e-4f);
  CHECK(glm::distance(few.target, goal) < 0.3f * glm::length(goal));
  CHECK(glm::distance(few.target, goal) > 0.2f * glm::length(goal));
}

TEST_CASE("picking: the first triangle along a ray and its nearest corner") {
  Stage stage;
  Picker picker = make_picker(stage.mesh);
  CHECK_FALSE(poll(picker, true));
  stage.move(1.0, {0.25, 0, 0});
  const auto positions = stage.positions.read_all<Position>();
  const auto x = [&](std::uint32_t v) { return positions[v].high; };
  int hits = 0;
  for (int py = 4; py < height; py += 24)
    for (int px = 3; px < width; px += 27) {
      const Ray ray = pixel_ray(stage.frame.camera, float(px), float(py), width, height);
      request(picker, stage.positions.id(), ray);
      const auto pick = poll(picker, true);
      REQUIRE(pick);
      // The reference: the planes of the block in double precision.
      const glm::dvec3 o(ray.origin), d(ray.direction), low{-0.25, -0.5, -0.5}, high{0.75, 0.5, 0.5};
      const glm::dvec3 a = (low - o) / d, b = (high - o) / d;
      const double enter = std::max({std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)});
      const double leave = std::min({std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)});
      CHECK(pick->hit == (enter < leave));
      if (!pick->hit) continue;
      ++hits;
      CHECK(pick->distance == doctest::Approx(enter).epsilon(1e-5));
      const Triangle& triangle = stage.mesh.surface[pick->element];
      const glm::vec3 point = ray.origin + pick->distance * ray.direction;
      const glm::vec3 normal =
          glm::normalize(glm::cross(x(triangle[1]) - x(triangle[0]), x(triangle[2]) - x(triangle[0])));
      CHECK(std::abs(glm::dot(normal, point - x(triangle[0]))) < 1e-5f);
      CHECK(glm::dot(normal, ray.direction) < 0);
      CHECK(std::count(triangle.begin(), triangle.end(), pick->vertex) == 1);
      for (std::uint32_t v : triangle)
        CHECK(glm::distance(x(pick->vertex), point) <= glm::distance(x(v), point) + 1e-6f);
    }
  CHECK(hits > 5);
  // Behind the eye there is nothing, and a question that was replaced is not answered.
  request(picker, stage.positions.id(), {{0, 0, 4}, {0, 0, -1}});
  request(picker, stage.positions.id(), {{0, 0, 4}, {0, 0, 1}});
  CHECK_FALSE(poll(picker, true)->hit);
  CHECK_FALSE(poll(picker, true));
  CHECK(gl_error_count() == 0);
}

TEST_CASE("picking: what a cut shows, and tetrahedra shrunk and apart") {
  Stage stage;
  Picker picker = make_picker(stage.mesh);
  Frame& frame = stage.frame;
  const auto pick = [&](const Ray& ray) {
    request(picker, stage.renderer, frame, ray);
    return *poll(picker, true);
  };
  const auto holds = [&](std::uint32_t tet, const glm::vec3& p) {  // whether it is in it, as it is at rest
    const auto x = [&](int i) { return glm::vec3(stage.mesh.positions[stage.mesh.tets[tet][std::size_t(i)]]); };
    const glm::vec3 c = glm::inverse(glm::mat3(x(1) - x(0), x(2) - x(0), x(3) - x(0))) * (p - x(0));
    return std::min({c.x, c.y, c.z, 1 - c.x - c.y - c.z}) > -1e-4f;
  };
  const Ray down{{0.12f, 3, 0.21f}, {0, -1, 0}};
  CHECK_FALSE(pick(down).inside);
  for (const Look look : {Look::surface, Look::tets})
    for (const double cut : {0.2, 0.5, 0.77}) {
      frame.options = {.look = look, .shadow = false, .shrink = 0, .cut = cut, .cut_axis = 1};
      const Pick found = pick(down);
      REQUIRE(found.hit);
      CHECK(found.inside);
      const float height = float(cut) - 0.5f;
      CHECK(3 - found.distance == doctest::Approx(height).epsilon(1e-4).scale(1e-3));
      CHECK(holds(found.element, {0.12f, height, 0.21f}));
      CHECK(std::ranges::count(stage.mesh.tets[found.element], found.vertex) == 1);
    }
  frame.options = {.look = Look::tets, .shadow = false, .shrink = 0};
  CHECK(pick(down).distance == doctest::Approx(2.5));
  frame.options.shrink = 0.9;  // between them
  int hits = 0, all = 0;
  for (float x = -0.45f; x < 0.5f; x += 0.07f)
    for (float z = -0.43f; z < 0.5f; z += 0.07f) hits += pick({{x, 3, z}, {0, -1, 0}}).hit, ++all;
  CHECK(hits > 0);
  CHECK(hits < all / 2);
  frame.options.shrink = 0, frame.options.explode = 1;
  hits = 0;
  for (float x = 0.6f; x < 1; x += 0.03f) hits += pick({{x, 3, 0.2f}, {0, -1, 0}}).hit;
  CHECK(hits > 0);
  CHECK(gl_error_count() == 0);
}
