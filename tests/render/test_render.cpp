// What the renderer draws, by pixels of small images on whatever EGL offers.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/gtc/packing.hpp>
#include <limits>

#include "app/window/probe.h"
#include "render/layout.h"
#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/model/material.h"
#include "sim/reference/smoothed.h"
#include "tests/gl_test.h"
#include "tests/render/render_stage.h"

namespace colour_maps {
using glm::clamp, glm::mix, glm::vec3, std::abs, std::cos, std::sin;
#include "shaders/render/colour.glsl"
}  // namespace colour_maps

using namespace tetpbd;

namespace {

float encoded(float linear) {
  return 255.0f * (linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f);
}

// Red over blue of what a map gives, in the image's codes; lighting changes both alike, more or less.
bool is_warm(const glm::vec3& c) { return c.x > 1.6f * c.z; }
bool is_cold(const glm::vec3& c) { return c.z > 1.6f * c.x; }

}  // namespace

TEST_CASE("render: a block covers the pixels that the camera predicts") {
  Stage stage;
  stage.move(0.8, {0.3, 0.2, 0});
  // The picture first: NVIDIA 580 draws the old contents when a buffer is read, then written, before its
  // first use as attributes.
  const Image image = stage.image(), empty = stage.empty();
  glm::vec2 low{1e9f}, high{-1e9f};
  for (const Position& p : stage.positions.read_all<Position>()) {
    const glm::vec3 seen = project(stage.frame.camera, p.high, width, height);
    low = glm::min(low, glm::vec2(seen));
    high = glm::max(high, glm::vec2(seen));
  }
  const Difference body = difference(image, empty);
  CHECK(std::abs(float(body.low.x) - low.x) < 2.5f);
  CHECK(std::abs(float(body.low.y) - low.y) < 2.5f);
  CHECK(std::abs(float(body.high.x + 1) - high.x) < 2.5f);
  CHECK(std::abs(float(body.high.y + 1) - high.y) < 2.5f);
  // Upright and lit from above: the block is moved up, and the background is lighter at the bottom.
  CHECK(brightness(pixel(image, 2, height - 3)) > brightness(pixel(image, 2, 3)) + 5);
  CHECK(image.rgba[3] == 255);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: the lit top is brighter than the side turned away") {
  Stage stage;
  stage.frame.options.smooth_normals = false;
  stage.frame.camera.azimuth = -130;  // the light comes from azimuth 52
  stage.frame.camera.elevation = 35;
  for (bool shadow : {false, true}) {
    stage.frame.options.shadow = shadow;
    const Image image = stage.image();
    const float top = brightness(pixel(image, project(stage.frame.camera, {0, 0.5f, 0}, width, height)));
    const float side = brightness(pixel(image, project(stage.frame.camera, {-0.5f, 0, 0}, width, height)));
    CHECK(top > side + 35);
    // No acne: the lit top is even.
    for (float x : {-0.4f, -0.2f, 0.0f, 0.2f, 0.4f})
      for (float z : {-0.4f, 0.0f, 0.4f}) {
        const float here = brightness(pixel(image, project(stage.frame.camera, {x, 0.5f, z}, width, height)));
        CHECK(std::abs(here - top) < 12);
      }
  }
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: a shadow falls on the ground away from the light, and only there") {
  Stage stage;
  stage.move(0.5, {0, 0.6, 0});
  stage.frame.ground = 0.0f;
  stage.frame.options.grid = false;
  stage.frame.camera.azimuth = 130;  // the light comes from azimuth 52
  stage.frame.camera.elevation = 50;
  stage.frame.camera.distance = 5;
  const Image lit = stage.image();
  stage.frame.options.shadow = true;
  const Image shadowed = stage.image();
  const auto darker = [&](const glm::vec3& p) {
    const glm::vec3 at = project(stage.frame.camera, p, width, height);
    return brightness(pixel(lit, at)) - brightness(pixel(shadowed, at));
  };
  const glm::vec3 away = -glm::vec3(0.4558f, 0, 0.3500f) / 0.8184f * 0.6f;  // where the block's centre falls
  CHECK(darker(away) > 25);
  CHECK(std::abs(darker(-2.0f * away)) < 3);
  CHECK(std::abs(darker({1.0f, 0, -1.0f})) < 3);
  // Seen from below, the ground does not hide the block.
  stage.frame.camera.elevation = -40;
  const Image below = stage.image();
  CHECK(difference(below, stage.empty()).count > 300);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: the grid has lines where metres are") {
  Stage stage;
  stage.frame.ground = -0.5f;
  stage.frame.camera.elevation = 70;
  const Image with = stage.image();
  stage.frame.options.grid = false;
  const Image without = stage.image();
  const glm::vec3 on = project(stage.frame.camera, {1.0f, -0.5f, 0.25f}, width, height);
  float darkest = 0;
  for (int dx = -1; dx <= 1; ++dx)
    darkest = std::max(darkest, brightness(pixel(without, int(on.x) + dx, int(on.y))) -
                                    brightness(pixel(with, int(on.x) + dx, int(on.y))));
  CHECK(darkest > 8);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: wire shows edges, tets show gaps, flat differs from smooth") {
  Stage stage;
  const Image smooth = stage.image();
  CHECK_FALSE(stage.renderer.tets);  // only what is drawn exists
  CHECK_FALSE(stage.renderer.shadow.depth);
  CHECK(stage.renderer.values.empty());
  stage.frame.options.smooth_normals = false;
  const Image flat = stage.image(), empty = stage.empty();
  CHECK(difference(smooth, flat).count == 0);  // a block is all edges
  const int solid = difference(flat, empty).count;

  stage.frame.options.look = Look::wire;
  const Image wire = stage.image();
  const auto& camera = stage.frame.camera;
  // The middle of a face of a cell's edge, against the middle of a triangle.
  const float edge = brightness(pixel(wire, project(camera, {1.0f / 6, 0.0f, 0.5f}, width, height)));
  const float face = brightness(pixel(wire, project(camera, {0.05f, 0.05f, 0.5f}, width, height)));
  const float face2 = brightness(pixel(wire, project(camera, {-0.06f, 0.06f, 0.5f}, width, height)));
  CHECK(edge < std::max(face, face2) - 30);

  stage.frame.options.look = Look::tets;
  stage.frame.options.shrink = 0.5;
  const Image tets = stage.image();
  CHECK(difference(tets, flat).count > solid / 4);
  CHECK(difference(tets, empty).count < solid);
  stage.frame.options.cut_axis = 0;
  stage.frame.options.cut = 0.5;
  const int half = difference(stage.image(), empty).count;
  CHECK(half < difference(tets, empty).count);
  CHECK(half > 0);
  // Of a block's half a flat face is left, along any axis, in every look.
  for (const Look look : {Look::surface, Look::wire, Look::tets})
    for (const int axis : {0, 1, 2, 3}) {
      stage.frame.options = {.look = look, .shadow = false, .shrink = 0, .cut = 0.5, .cut_axis = axis};
      const glm::vec3 n = stage.frame.options.cut_normal = glm::normalize(glm::vec3(1, 2, 3));
      const glm::vec3 normal = axis == 3 ? n : glm::vec3(axis == 0, axis == 1, axis == 2);
      stage.frame.camera.azimuth = axis == 0 ? 60 : 20;
      stage.frame.camera.elevation = axis == 1 ? 60 : 20;
      const Image cut = stage.image();
      const glm::vec3 side = glm::normalize(glm::cross(normal, glm::vec3(0.3f, 0.4f, -0.2f)));
      for (const float at : {-0.31f, -0.07f, 0.02f, 0.29f}) {
        const glm::vec3 seen = project(stage.frame.camera, at * side, width, height);
        CHECK(glm::distance(pixel(cut, seen), pixel(empty, seen)) > 12);
      }
      stage.frame.options.cut = 1;
      CHECK(difference(stage.image(), cut).count > 500);
    }
  stage.frame.options = {.look = Look::tets, .smooth_normals = false, .shadow = false};
  stage.frame.camera = Camera{.distance = 4};
  stage.frame.options.cut = -0.1;
  CHECK(difference(stage.image(), empty).count == 0);
  stage.frame.options.cut = 1;
  stage.frame.options.explode = 0.5;
  const Difference exploded = difference(stage.image(), empty), together = difference(flat, empty);
  CHECK(exploded.high.x - exploded.low.x > together.high.x - together.low.x);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: volume and stretch errors reach the ends of their scales") {
  Stage stage;
  const glm::vec3 middle{width * 0.5f, height * 0.5f, 0};
  for (Look look : {Look::surface, Look::tets}) {
    stage.frame.options.look = look;
    stage.frame.options.shrink = 0;
    stage.frame.options.legend = false;
    for (Colour colour : {Colour::volume, Colour::stretch}) {
      stage.frame.options.colour = colour;
      stage.move(1.3);
      CHECK(is_warm(pixel(stage.image(), middle)));
      stage.move(0.7);
      CHECK(is_cold(pixel(stage.image(), middle)));
      stage.move(1.0);
      const glm::vec3 rest = pixel(stage.image(), middle);
      CHECK_FALSE(is_warm(rest));
      CHECK_FALSE(is_cold(rest));
    }
  }
  // The numbers behind the colours: 1.1^3 - 1 and 0.1.
  stage.frame.options.look = Look::surface;
  stage.move(1.1);
  stage.frame.options.colour = Colour::volume;
  stage.image();
  stage.frame.options.colour = Colour::stretch;
  stage.image();
  const auto volume = stage.renderer.values.at(Colour::volume).values.read_all<float>();
  const auto stretch = stage.renderer.values.at(Colour::stretch).values.read_all<float>();
  for (const Triangle& triangle : stage.mesh.surface)
    for (std::uint32_t v : triangle) {
      CHECK(volume[v] == doctest::Approx(0.331).epsilon(1e-4));
      CHECK(stretch[v] == doctest::Approx(0.1).epsilon(1e-4));
    }
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: velocity colours, and the legend's bar is the colour map") {
  Stage stage;
  std::vector<Velocity> velocities(stage.mesh.positions.size());
  for (Velocity& v : velocities) v.high = {0, -5, 0};
  const Buffer buffer("velocities", velocities);
  stage.frame.velocities = buffer.id();
  stage.frame.options.legend = false;
  stage.frame.options.colour = Colour::velocity;
  const Image plain = stage.image();
  const glm::vec3 fast = pixel(plain, width / 2, height / 2);
  CHECK(fast.x > 1.6f * fast.z);  // yellow
  CHECK(fast.y > 1.6f * fast.z);
  CHECK_FALSE(stage.renderer.legend);
  for (Colour colour : {Colour::velocity, Colour::volume}) {
    stage.frame.options.colour = colour;
    stage.frame.options.legend = false;
    const Image without = stage.image();
    stage.frame.options.legend = true;
    const Image with = stage.image();
    const Difference legend = difference(with, without);
    CHECK(legend.count > 500);
    CHECK(legend.low.x > width / 3);
    CHECK(legend.high.x < width - 10);
    // Both ends of the bar, which begins 10 pixels inside the panel and ends as far above its lower edge.
    const int x = legend.low.x + 10 + 5;
    const auto expect = [&](int y, float value, float low, float high) {
      const glm::vec3 want = colour_maps::scale_colour(int(colour), value, low, high);
      const glm::vec3 have = pixel(with, x, y);
      for (int i = 0; i < 3; ++i) CHECK(std::abs(have[i] - encoded(want[i])) < 20);
    };
    const float low = colour == Colour::velocity ? 0.0f : -0.2f, high = colour == Colour::velocity ? 5.0f : 0.2f;
    const int bottom = legend.high.y - 13, top = bottom - int(0.42 * height) + 1;
    expect(bottom, low, low, high);
    expect(top, high, low, high);
    expect((bottom + top) / 2, 0.5f * (low + high), low, high);
  }
  stage.frame.options.colour = Colour::plain;
  const Image bare = stage.image();
  stage.frame.caption = "Gauss-Seidel";
  const Difference caption = difference(stage.image(), bare);
  CHECK(caption.count > 60);
  CHECK(caption.high.y < 40);
  CHECK(caption.low.x < 30);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: energy, distances, values that come back, rings around vertices") {
  Stage stage;
  const double mu = 3e4, lambda = 5e4;
  const auto neo_hookean = [&](double stretch) {  // Smith's, less its value at rest
    const double m = 4.0 / 3 * mu, l = lambda + 5.0 / 6 * mu, alpha = 1 + 0.75 * m / l;
    const auto energy = [&](double s) {
      const double I = 3 * s * s, J = s * s * s;
      return 0.5 * (m * (I - 3) + l * (J - alpha) * (J - alpha) - m * std::log(I + 1));
    };
    return energy(stretch) - energy(1);
  };
  const auto springs = [&](double s) {
    return 1.25 * mu * 6 * (s - 1) * (s - 1) + 0.5 * (lambda - mu) * (s * s * s - 1) * (s * s * s - 1);
  };
  stage.frame.options.worst = true;
  stage.frame.options.colour = Colour::energy;
  for (const Look look : {Look::surface, Look::tets})
    for (const double stretch : {1.1, 0.8, 1.0})
      for (const int kind : {1, 2}) {
        stage.frame.options.look = look;
        stage.frame.materials = {glm::vec4(mu, lambda, kind, 0)};
        stage.move(stretch);
        stage.image();
        const auto values = poll_values(stage.renderer, true);
        REQUIRE(values);
        for (const float value : *values)  // inside, too
          CHECK(double(value) ==
                doctest::Approx(kind == 1 ? neo_hookean(stretch) : springs(stretch)).epsilon(1e-3).scale(10));
        CHECK_FALSE(poll_values(stage.renderer, true));
      }
  stage.frame.options.colour = Colour::residual;
  for (const auto& [kinds, expected] : {std::pair(1.0f, 0.1), {2.0f, 0.331}, {3.0f, 0.331}}) {
    stage.frame.materials = {glm::vec4(0, 0, 0, kinds)};
    stage.move(1.1);
    stage.image();
    const auto values = poll_values(stage.renderer, true);
    REQUIRE(values);
    for (const float value : *values) CHECK(double(value) == doctest::Approx(expected).epsilon(1e-3));
  }
  stage.move(1.0);
  const Buffer answers("answers", positions_of(stage.mesh, 1.0, {0.25, 0, 0}));
  Buffer distances;
  measure_distances(stage.renderer, stage.positions.id(), answers.id(), 2.0, distances);
  for (const float apart : distances.read_all<float>()) CHECK(apart == doctest::Approx(0.125));
  stage.frame.options = {.look = Look::surface, .colour = Colour::motion, .shadow = false, .legend = false};
  const Image unknown = stage.image();
  stage.frame.values = distances.id();
  const glm::vec3 far = pixel(stage.image(), width / 2, height / 2);
  CHECK(brightness(far) > brightness(pixel(unknown, width / 2, height / 2)) + 30);
  const Image without = stage.image();
  stage.frame.worst = {0};  // behind: seen all the same
  stage.frame.camera.azimuth = 45;
  stage.frame.worst.clear();
  const Image turned = stage.image();
  stage.frame.worst = {0};
  const Difference ring = difference(stage.image(), turned);
  const glm::vec3 at = project(stage.frame.camera, glm::vec3(stage.mesh.positions[0]), width, height);
  CHECK(ring.count > 40);
  CHECK(std::abs(float(ring.low.x + ring.high.x) * 0.5f - at.x) < 2);
  stage.frame.worst.clear();
  stage.frame.tet = 0;  // inside, too
  const Difference edges = difference(stage.image(), turned);
  CHECK(edges.count > 100);
  glm::vec2 low(INFINITY), high(-INFINITY);
  for (const std::uint32_t v : stage.mesh.tets[0]) {
    const glm::vec2 corner(project(stage.frame.camera, glm::vec3(stage.mesh.positions[v]), width, height));
    low = glm::min(low, corner), high = glm::max(high, corner);
  }
  CHECK(glm::all(glm::lessThan(glm::abs(glm::vec2(edges.low) - low), glm::vec2(6))));
  CHECK(glm::all(glm::lessThan(glm::abs(glm::vec2(edges.high) - high), glm::vec2(6))));
  stage.frame.tet = std::uint32_t(stage.mesh.tets.size() - 1);
  CHECK(difference(stage.image(), turned).low != edges.low);
  stage.frame.tet.reset();
  CHECK(difference(without, unknown).count > 500);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: smoothed tets are coloured by the averages around vertices") {
  Stage stage;
  constexpr double mu = 3e4, lambda = 5e4, s = 0.4, m = 4.0 / 3 * mu, l = lambda + 5.0 / 6 * mu;
  const Averages averages = average_tets(stage.mesh, m, l, s);
  const std::size_t count = stage.mesh.positions.size();
  std::vector<glm::dvec3> x = stage.mesh.positions;
  // Bent, swollen at one end, so that some tets are beyond what averages alone resist.
  for (glm::dvec3& p : x) p = p * (1 + 0.25 * (p.x + 0.5)) + glm::dvec3(0, 0.2 * p.x * p.x, 0.1 * p.y);
  const auto shear = [](const glm::dmat3& F, double J) {
    const double I = glm::dot(F[0], F[0]) + glm::dot(F[1], F[1]) + glm::dot(F[2], F[2]);
    return (I - 3) / 2 - 0.75 * (J - 1) - 0.5 * std::log((I + 1) / 4);
  };
  std::vector<double> volume(count), own(count);
  for (const Tet& tet : stage.mesh.tets) {
    const auto sides = [&](const auto& at) {
      return glm::dmat3(at[tet[1]] - at[tet[0]], at[tet[2]] - at[tet[0]], at[tet[3]] - at[tet[0]]);
    };
    const glm::dmat3 rest = sides(stage.mesh.positions), F = sides(x) * glm::inverse(rest);
    const double J = glm::determinant(F), beyond = J - std::clamp(J, 0.7, 1.3);
    for (const std::uint32_t v : tet) {
      volume[v] += glm::determinant(rest);
      own[v] += glm::determinant(rest) * (s * m * shear(F, J) + l / 2 * beyond * beyond);
    }
  }
  std::vector<Position> moved(count);
  for (std::size_t v = 0; v < count; ++v) moved[v].high = glm::vec3(x[v]);
  stage.positions.write(0, moved.size() * sizeof(Position), moved.data());
  stage.frame.materials = {glm::vec4(mu, lambda, 3, s)};
  stage.frame.options.worst = true;
  for (const Colour colour : {Colour::volume, Colour::energy}) {
    stage.frame.options.colour = colour;
    stage.image();
    const auto values = poll_values(stage.renderer, true);
    REQUIRE(values);
    double least = INFINITY, most = 0;
    for (std::size_t v = 0; v < count; ++v) {
      const Average at = average_at(averages, v, x);
      const double stored = (1 - s) * m * shear(at.F, glm::determinant(at.F)) + l / 2 * (at.J - 1) * (at.J - 1);
      const double right = colour == Colour::volume ? at.J - 1 : own[v] / volume[v] + stored;
      CHECK(double((*values)[v]) == doctest::Approx(right).epsilon(1e-4).scale(colour == Colour::volume ? 0.1 : 100));
      CHECK(double(average_energy(averages, v, x, stage.frame.materials[0])) ==
            doctest::Approx(stored).epsilon(1e-4).scale(100));
      least = std::min(least, right), most = std::max(most, right);
    }
    CHECK(most > 2 * least);
  }
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: the graph's edges, dots where vertices touch, arrows of velocity, numbers as colours") {
  Stage stage;
  const Image solid = stage.image(), empty = stage.empty();
  stage.frame.options.look = Look::graph;
  const Difference lines = difference(stage.image(), empty);
  CHECK(lines.count > 500);
  CHECK(lines.count < difference(solid, empty).count);
  stage.frame.options.cut = 0.5;
  CHECK(difference(stage.image(), empty).count < 0.8 * lines.count);

  stage.frame.options = {.shadow = false, .grid = false, .contacts = true};
  stage.frame.camera.elevation = -30;  // from below
  stage.frame.ground = -0.5f;
  const Image touching = stage.image();
  stage.frame.ground = -0.51f;
  stage.frame.options.contacts = false;
  const Image above = stage.image();
  stage.frame.options.contacts = true;
  CHECK(difference(stage.image(), above).count == 0);
  const glm::vec3 dot = pixel(touching, project(stage.frame.camera, {0.5f / 3, -0.5f, 0.5f / 3}, width, height));
  CHECK(dot.x > 2 * dot.z);

  stage.frame.camera.elevation = 18;
  stage.frame.ground.reset();
  std::vector<Velocity> velocities(stage.mesh.positions.size());
  for (Velocity& v : velocities) v.high = {0, 3, 0};
  const Buffer buffer("velocities", velocities);
  stage.frame.velocities = buffer.id();
  const Difference before = difference(stage.image(), empty);
  stage.frame.options.arrows = true;  // 0.3 m up
  const Difference with = difference(stage.image(), empty);
  const float raised = project(stage.frame.camera, {0, 0.5f, 0}, width, height).y -
                       project(stage.frame.camera, {0, 0.8f, 0}, width, height).y;
  CHECK(std::abs(float(before.low.y - with.low.y) - raised) < 0.3f * raised);

  stage.frame.options = {.colour = Colour::patch, .shadow = false};
  std::vector<float> numbers(stage.mesh.positions.size());
  stage.frame.camera.azimuth = 0;
  for (std::size_t v = 0; v < numbers.size(); ++v) numbers[v] = float(stage.mesh.positions[v].x > 0);
  const Buffer values("numbers", numbers);
  stage.frame.values = values.id();
  const Image patches = stage.image();
  const auto hue = [&](float x) {
    return glm::normalize(pixel(patches, project(stage.frame.camera, {x, 0, 0.5f}, width, height)));
  };
  CHECK(glm::distance(hue(-0.4f), hue(0.4f)) > 0.1f);
  CHECK(glm::distance(hue(0.3f), hue(0.4f)) < 0.05f);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: colour maps are even") {
  const auto luminance = [](const glm::vec3& c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; };
  for (int i = 0; i < 20; ++i) {
    const float t = float(i) / 20, next = t + 0.05f;
    CHECK(luminance(colour_maps::sequential_colour(t)) < luminance(colour_maps::sequential_colour(next)));
    for (float sign : {-1.0f, 1.0f})
      CHECK(luminance(colour_maps::diverging_colour(sign * t)) > luminance(colour_maps::diverging_colour(sign * next)));
  }
}

TEST_CASE("render: edges stay sharp, and only they") {
  Stage stage;
  stage.image();
  const auto corners = stage.renderer.corners.values.read_all<SurfaceCorner>();
  REQUIRE(corners.size() == 3 * stage.mesh.surface.size());
  const auto normal = [](const SurfaceCorner& c) {
    return glm::vec3(glm::unpackSnorm2x16(c.normal_xy), glm::unpackSnorm2x16(c.normal_z_body).x);
  };
  for (std::size_t c = 0; c < corners.size(); ++c) {  // of a block: a face's own
    const std::size_t t = c - c % 3;
    const glm::vec3 face = glm::normalize(
        glm::cross(corners[t + 1].position - corners[t].position, corners[t + 2].position - corners[t].position));
    CHECK(glm::distance(normal(corners[c]), face) < 1e-3f);
    CHECK(corners[c].position == glm::vec3(stage.mesh.positions[stage.mesh.surface[c / 3][c % 3]]));
  }
  // Bent by 30 degrees, a flat piece is round: both sides have one normal where they meet.
  auto bent = stage.positions.read_all<Position>();
  for (Position& p : bent)
    if (p.high.x + p.low.x > 0.2f) p.high.y += std::tan(0.52f) * (p.high.x + p.low.x - 1.0f / 6);
  stage.positions.write(0, stage.positions.bytes(), bent.data());
  const Image smooth = stage.image();
  const auto round = stage.renderer.corners.values.read_all<SurfaceCorner>();
  for (std::size_t c = 0; c < round.size(); ++c) {
    const glm::vec3 p = round[c].position, n = normal(round[c]);
    if (std::abs(p.x - 1.0f / 6) < 1e-3f && std::abs(p.z) < 0.4f && p.y > 0.4f && n.y > 0.8f)
      CHECK(n.x == doctest::Approx(-std::sin(0.26f)).epsilon(0.15));
  }
  stage.frame.options.smooth_normals = false;
  CHECK(difference(stage.image(), smooth, 2).count > 100);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: ranges follow the values, but for a few, to round numbers") {
  const ColourScale& volume = colour_scales[std::size_t(Colour::volume)];
  std::vector<float> values(1000, -0.013f);
  values[3] = 0.9f, values[4] = std::numeric_limits<float>::quiet_NaN();
  const ColourRange fitted = fitted_range(volume, values);
  CHECK(fitted.high == doctest::Approx(0.02));
  CHECK(fitted.low == doctest::Approx(-0.02));
  CHECK(fitted_range(volume, std::vector<float>(10, 1e-7f)).high == doctest::Approx(2e-4));  // noise
  const ColourRange speed = fitted_range(colour_scales[std::size_t(Colour::velocity)], {0, 3, 5});
  CHECK(speed.low == 0);
  CHECK(speed.high == doctest::Approx(5));
  Stage stage;
  stage.frame.options.colour = Colour::stretch;
  stage.move(1.1);
  for (const float value : read_values(stage.renderer, stage.frame)) CHECK(value == doctest::Approx(0.1f));
  stage.frame.options.colour = Colour::plain;
  CHECK(read_values(stage.renderer, stage.frame).empty());
  CHECK(gl_error_count() == 0);
}

TEST_CASE("camera: keeps a point in view, goes through its keys") {
  Camera camera;
  const glm::vec3 target = camera.target;
  keep_in_view(camera, {0.1f, 0.2f, 0.1f}, 1.5f);
  CHECK(camera.target == target);
  keep_in_view(camera, {40, -7, 12}, 1.5f);
  const glm::vec3 seen = project(camera, {40, -7, 12}, 300, 200);
  CHECK(std::min(seen.x, 300 - seen.x) > 30);
  CHECK(std::min(seen.y, 200 - seen.y) > 20);
  CHECK(glm::distance(eye(camera), glm::vec3(40, -7, 12)) > 0.4f * camera.distance);
  const std::vector<CameraKey> path{{1, {}}, {2, {{1, 0, 0}, 4, 90, 20, 35}}, {4, {{3, 0, 0}, 4, 270, 20, 35}}};
  for (const CameraKey& key : path) {
    CHECK(camera_at(path, key.time).azimuth == doctest::Approx(key.camera.azimuth));
    CHECK(camera_at(path, key.time).target == key.camera.target);
  }
  CHECK(camera_at(path, 0).target == path[0].camera.target);
  CHECK(camera_at(path, 9).target == path[2].camera.target);
  CHECK(camera_at(path, 3).azimuth == doctest::Approx(180).epsilon(0.1));
  // No jerk: as fast before a key as after it.
  const auto x = [&](double time) { return double(camera_at(path, time).target.x); };
  CHECK(x(2) - x(1.999) == doctest::Approx(x(2.001) - x(2)).epsilon(0.02));
}

TEST_CASE("render: several bodies have hues of their own, marked vertices dots") {
  TetMesh two = cut_block(glm::dvec3(0.6), 2, {-0.5, 0, 0});
  const TetMesh other = cut_block(glm::dvec3(0.6), 2, {0.5, 0, 0});
  const auto first = std::uint32_t(two.positions.size());
  two.positions.insert(two.positions.end(), other.positions.begin(), other.positions.end());
  for (Triangle face : other.surface) two.surface.push_back({face[0] + first, face[1] + first, face[2] + first});
  for (Tet tet : other.tets) two.tets.push_back({tet[0] + first, tet[1] + first, tet[2] + first, tet[3] + first});
  Stage stage(two);
  stage.renderer = make_renderer(two, {0, first});
  stage.frame.camera.azimuth = 0;
  const Image image = stage.image();
  const glm::vec3 left = pixel(image, project(stage.frame.camera, {-0.5f, 0, 0.3f}, width, height));
  const glm::vec3 right = pixel(image, project(stage.frame.camera, {0.5f, 0, 0.3f}, width, height));
  CHECK(left.x > left.z + 20);
  CHECK(right.z > right.x + 20);
  const std::vector<std::uint32_t> grabbed{first - 1};
  stage.frame.grabbed = grabbed;
  const Difference dot = difference(stage.image(), image);
  const glm::vec3 at = project(stage.frame.camera, glm::vec3(two.positions[first - 1]), width, height);
  CHECK(dot.count > 40);
  CHECK(dot.count < 200);
  CHECK(std::abs(float(dot.low.x + dot.high.x) * 0.5f - at.x) < 2);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: samples smooth edges, two viewports share a target") {
  Stage stage(cut_block(glm::dvec3(1.0), 3), 4);
  const Image smooth = stage.image();
  const Target single = make_target(width, height, 0);
  stage.frame.target = single.framebuffer.id();
  draw(stage.renderer, stage.frame);
  const Image hard = read_rgba(single);
  const Difference edges = difference(smooth, hard);
  CHECK(stage.target.samples > 0);
  CHECK(edges.count > 40);
  CHECK(edges.count < width * height / 10);

  // Left half only: the right one stays as it was.
  stage.frame.viewport = {0, 0, width / 2, height};
  stage.frame.camera.azimuth = 80;
  draw(stage.renderer, stage.frame);
  CHECK(difference(read_rgba(single), hard).high.x < width / 2);
  CHECK_THROWS_AS(make_target(0, 10), Error);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: a vertex that is not finite spills nothing") {
  Stage stage;
  const Image whole = stage.image(), empty = stage.empty();
  const Difference body = difference(whole, empty);
  auto positions = stage.positions.read_all<Position>();
  for (Look look : {Look::surface, Look::wire, Look::tets})
    for (float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1e30f}) {
      auto broken = positions;
      broken.back().high.y = bad;
      stage.positions.write(0, stage.positions.bytes(), broken.data());
      stage.frame.options.look = look;
      stage.frame.options.shadow = true;
      const std::vector<std::uint32_t> pinned{std::uint32_t(broken.size() - 1)};
      stage.frame.pinned = pinned;
      const Difference rest = difference(stage.image(), empty);
      CHECK(rest.count > body.count / 2);
      CHECK(rest.low.x >= body.low.x);
      CHECK(rest.low.y >= body.low.y);
      CHECK(rest.high.x <= body.high.x);
      CHECK(rest.high.y <= body.high.y);
    }
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: drawing twice gives the same bits, shaders reload") {
  Stage stage;
  stage.frame.options.shadow = true;
  stage.frame.ground = -0.5f;
  Model model;
  Obstacle& wall = model.obstacles.emplace_back();
  wall.normal = {0, 0, 1}, wall.centre = {0, 0, -1.5};
  stage.frame.model = std::make_shared<const Model>(model);
  const Image first = stage.image();
  CHECK(stage.image().rgba == first.rgba);
  reload_shaders(stage.renderer);
  CHECK(stage.image().rgba == first.rgba);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: frames come back without waiting, in order, the same") {
  Stage stage(cut_block(glm::dvec3(1.0), 2), 2);
  ReadBack frames;
  CHECK_FALSE(frames.poll(true));
  std::vector<Image> expected;
  for (int i = 0; i < 5; ++i) {
    stage.frame.camera.azimuth = float(20 * i);
    draw(stage.renderer, stage.frame);
    frames.push(stage.target);
    expected.push_back(read_rgba(stage.target));
  }
  CHECK(frames.pending() == 5);
  for (const Image& image : expected) {
    const auto arrived = frames.poll(true);
    REQUIRE(arrived);
    CHECK(arrived->width == width);
    CHECK(arrived->rgba == image.rgba);
  }
  CHECK_FALSE(frames.poll());
  // The window's way: as it is, with nothing converted.
  const Target copy = make_target(width, height);
  present(stage.target, copy.framebuffer.id(), 0, 0);
  CHECK(read_rgba(copy).rgba == expected.back().rgba);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: the middle of the bodies comes back once it is known, with and without a shadow") {
  Stage stage;
  stage.image();
  CHECK_FALSE(poll_centre(stage.renderer, true));  // nobody asked
  stage.frame.options.follow = true;
  for (const bool shadow : {false, true}) {
    stage.frame.options.shadow = shadow;
    stage.move(0.5, {1, 2, -3});
    stage.image();
    const auto centre = poll_centre(stage.renderer, true);
    REQUIRE(centre);
    CHECK(glm::distance(*centre, glm::vec3(1, 2, -3)) < 1e-5f);
    CHECK_FALSE(poll_centre(stage.renderer, true));
  }
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: block layouts are what the shaders see") {
  Stage stage;
  stage.frame.options.shadow = true;
  stage.image();
  const auto block_bytes = [](const Program& program, const char* name) {
    const GLuint index = glGetProgramResourceIndex(program.id(), GL_UNIFORM_BLOCK, name);
    REQUIRE(index != GL_INVALID_INDEX);
    const GLenum property = GL_BUFFER_DATA_SIZE;
    GLint bytes = 0;
    glGetProgramResourceiv(program.id(), GL_UNIFORM_BLOCK, index, 1, &property, 1, nullptr, &bytes);
    return std::size_t(bytes);
  };
  CHECK(block_bytes(stage.renderer.passes.at("surface").program, "ViewBlock") == sizeof(View));
  CHECK(block_bytes(stage.renderer.passes.at("surface").program, "LightBlock") == sizeof(Light));
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: an obstacle's surface is where its distance is zero, and faces outward") {
  const double pi = 3.14159265, r = 0.3, l = 0.5, ball = 4 * pi / 3 * r * r * r;
  for (const auto& [name, right] : {std::pair{"sphere", ball},
                                    {"capsule", ball + 2 * pi * r * r * l},
                                    {"box", 8 * 0.4 * 0.2 * 0.3},
                                    {"cylinder", 2 * pi * r * r * l},
                                    {"height-field", 0.0}}) {
    for (const bool found : {false, true}) {  // from the distance, as of kinds without triangles of their own
      const bool heights = name == std::string("height-field");
      if (found && heights) continue;
      CAPTURE(name);
      CAPTURE(found);
      Obstacle o;
      ObstacleKind kind = *find_obstacle_kind(name);
      if (found) kind.picture = nullptr;
      o.kind = &kind;
      o.radius = r, o.half_length = l, o.half = {0.4, 0.2, 0.3};
      if (heights) set_heights(o, {{0.2, 0.5, 1}, {0.4, 0.6, 0.3}, {0.1, 0, 0.5}, {0.3, 0.3, 0.2}});
      const auto corners = tessellate(o);
      const MovingObstacle exact = moving_obstacle(o, 0, 0);
      double volume = 0, farthest = 0;
      for (std::size_t c = 0; c < corners.size(); c += 3) {
        const glm::dvec3 p[] = {glm::dvec3(corners[c].position), glm::dvec3(corners[c + 1].position),
                                glm::dvec3(corners[c + 2].position)};
        volume += glm::dot(p[0], glm::cross(p[1], p[2])) / 6;
        for (const glm::dvec3& x : p)
          if (!heights || x.y > -0.19) farthest = std::max(farthest, std::abs(exact.surface_at(x).distance));
      }
      CHECK(farthest < 0.01);  // edges of boxes and cylinders are a little round
      if (!heights) CHECK(volume == doctest::Approx(right).epsilon(0.02));
    }
  }
}

TEST_CASE("render: all planes are drawn that a step has room for") {
  Stage stage;
  stage.frame.options.shadow = true;
  stage.frame.camera = {.target = {0, 0.5f, 0}, .distance = 5, .azimuth = -60, .elevation = 30};
  Model model;
  for (int k = 0; k + 1 < MAX_OBSTACLES; ++k) {
    Obstacle& wall = model.obstacles.emplace_back();
    wall.normal = {0, 1, 0}, wall.centre.y = -50 - k;
  }
  stage.frame.model = std::make_shared<const Model>(model);
  const Image before = stage.image();
  model.obstacles.back().centre.y = -0.5;
  stage.frame.model = std::make_shared<const Model>(model);
  CHECK(difference(stage.image(), before, 5).count > 1000);
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: obstacles are seen, where they stand by then, and cast shadow on bodies and ground") {
  Stage stage;
  stage.move(0.5, {0, 0.3, 0});
  stage.frame.ground = 0.0f;
  stage.frame.camera = {.target = {0, 0.5f, 0}, .distance = 5, .azimuth = -60, .elevation = 30};
  stage.frame.options.shadow = true, stage.frame.options.grid = false;
  const Image without = stage.image();
  Model model;
  Obstacle& plate = model.obstacles.emplace_back();
  plate.kind = find_obstacle_kind("box");
  plate.half = {0.5, 0.05, 0.5}, plate.centre = {0.6, 1.2, 0.45}, plate.velocity = {0, 2, 0};
  stage.frame.model = std::make_shared<const Model>(model);
  const Image with = stage.image();
  const auto seen = [&](const Image& image, const glm::vec3& p) {
    return brightness(pixel(image, project(stage.frame.camera, p, width, height)));
  };
  CHECK(pixel(with, project(stage.frame.camera, {0.6f, 1.25f, 0.45f}, width, height)).z >
        pixel(with, project(stage.frame.camera, {0.6f, 1.25f, 0.45f}, width, height)).x + 5);
  CHECK(seen(with, {0, 0.55f, 0}) < seen(without, {0, 0.55f, 0}) - 20);        // the body's top
  CHECK(seen(with, {0.3f, 0, 0.35f}) < seen(without, {0.3f, 0, 0.35f}) - 20);  // the ground
  stage.frame.time = 10;
  CHECK(difference(stage.image(), without, 20).count < 300);  // the light's map is coarser
  CHECK(gl_error_count() == 0);
}

TEST_CASE("render: a driver that takes few work-groups in a row gives the same picture and the same pick") {
  const auto look = [](std::size_t row) {
    Stage stage;
    stage.renderer.recorder.row = row;
    stage.move(0.5, {0, 0.3, 0});
    stage.frame.ground = 0.0f;
    stage.frame.options.colour = Colour::volume;
    stage.frame.options.shadow = true;
    return stage.image().rgba;
  };
  const auto wide = look(65535);
  CHECK(look(1) == wide);
  CHECK(look(2) == wide);
}

TEST_CASE("colours of energy are of each body's own material") {
  GlTest gl;
  auto model = std::make_shared<Model>();
  const TetMesh block = make_block(glm::dvec3(1), {2, 2, 2});
  for (const double side : {-1.0, 1.0}) {
    auto start = block.positions;
    for (glm::dvec3& p : start) p = glm::dvec3(1.1 * p.x + 2 * side, p.y, p.z);
    add_body(*model, "block", block, 1000, start, {}, {}, {});
  }
  Settings settings;
  settings.mode = "explicit", settings.ground = false;
  Material soft;
  soft.material = "neo-hookean", soft.young_modulus = 1e4;
  Material firm = soft;
  firm.material = "springs", firm.young_modulus = 5e4;
  settings.bodies = {{.material = soft}, {.material = firm}};
  Sim sim = create_sim(model, settings);
  Renderer renderer = make_renderer(*model);
  const Target target = make_target(64, 64, 0);
  ViewOptions view;
  view.colour = Colour::energy;
  const Frame frame = make_frame(sim, Camera(), view, target);
  const std::vector<float> values = read_values(renderer, frame);
  REQUIRE(values.size() == model->positions.size());
  std::vector<double> sum(values.size()), count(values.size());  // the mean of the tets around each vertex
  const auto& x = model->positions;
  for (std::size_t t = 0; t < model->rest.tets.size(); ++t) {
    const auto [a, b, c, d] = model->rest.tets[t];
    const auto of = tet_values(*model, t, {x[a], x[b], x[c], x[d]}, tet_energy_material(*model, settings, t));
    for (const std::uint32_t v : {a, b, c, d}) sum[v] += double(of.energy), count[v] += 1;
  }
  for (std::size_t v = 0; v < values.size(); ++v) {
    CHECK(sum[v] > 10);
    CHECK(double(values[v]) == doctest::Approx(sum[v] / count[v]).epsilon(1e-3));
  }
}
