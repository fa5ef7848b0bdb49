// Gradients of every constraint formula against finite differences, in float and double, at three mesh
// scales.
#include <doctest/doctest.h>

#include <random>

#include "sim/model/constraints.h"

using namespace tetpbd;

namespace {

template <class Kind>
void check_gradients(double scale) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  constexpr int n = Kind::row.arity;
  int checked = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::array<glm::dvec3, std::size_t(n)> x;
    for (auto& p : x) p = scale * glm::dvec3(unit(generator), unit(generator), unit(generator));
    auto start = x;
    const double rest = Kind::template evaluate<double>(start.data(), 0.0).C * 0.9;
    const auto exact = Kind::template evaluate<double>(x.data(), rest);
    if (exact.C == -1 || exact.C == 1) continue;  // the clamp of bending: constant there
    glm::dvec3 sum(0);
    double largest = 0;
    for (int j = 0; j < n; ++j) sum += exact.gradient[j], largest = std::max(largest, glm::length(exact.gradient[j]));
    CHECK(glm::length(sum) <= 1e-12 * largest);  // translation changes nothing
    for (int j = 0; j < n; ++j)
      for (int a = 0; a < 3; ++a) {
        const double step = 1e-6 * scale;
        auto low = x, high = x;
        low[std::size_t(j)][a] -= step, high[std::size_t(j)][a] += step;
        const double difference = (Kind::template evaluate<double>(high.data(), rest).C -
                                   Kind::template evaluate<double>(low.data(), rest).C) /
                                  (2 * step);
        // Needles make an angle's second derivative huge; a relative error of 1e-4 of the largest gradient
        // still finds any wrong term.
        CHECK(std::abs(exact.gradient[j][a] - difference) <= 1e-4 * largest);
      }
    // Float agrees with double up to the conditioning of the shape.
    std::array<glm::vec3, std::size_t(n)> y;
    for (int j = 0; j < n; ++j) y[std::size_t(j)] = glm::vec3(x[std::size_t(j)]);
    const auto rough = Kind::template evaluate<float>(y.data(), float(rest));
    for (int j = 0; j < n; ++j) CHECK(glm::length(glm::dvec3(rough.gradient[j]) - exact.gradient[j]) <= 2e-3 * largest);
    ++checked;
  }
  CHECK(checked > 50);
}

}  // namespace

TEST_CASE_TEMPLATE("gradients match finite differences", Kind, Stretch, Bend, Volume) {
  for (double scale : {1e-3, 1.0, 1e3}) {
    CAPTURE(scale);
    check_gradients<Kind>(scale);
  }
}

TEST_CASE("gradients of attachments and fibres match finite differences") {
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  int taut = 0;
  const auto check = [&]<class Kind>(Kind, const std::array<double, 5>& rest) {
    std::array<glm::dvec3, 4> x;
    for (auto& p : x) p = glm::dvec3(unit(generator), unit(generator), unit(generator));
    const auto value = [&](std::array<glm::dvec3, 4> at) { return Kind::evaluate(at.data(), rest.data()); };
    const auto exact = value(x);
    glm::dvec3 sum(0);
    double largest = 1e-9;
    for (const glm::dvec3& g : exact.gradient) sum += g, largest = std::max(largest, glm::length(g));
    CHECK(glm::length(sum) < 1e-12 * largest);
    if (exact.C != 0) ++taut;
    for (std::size_t j = 0; j < 4 && exact.C != 0; ++j)
      for (int a = 0; a < 3; ++a) {
        auto low = x, high = x;
        low[j][a] -= 1e-6, high[j][a] += 1e-6;
        CHECK(std::abs(exact.gradient[j][a] - (value(high).C - value(low).C) / 2e-6) <= 1e-4 * largest);
      }
    // Neither depends on where the frame is, and a turn moves C of all three coordinates as a vector.
    for (auto& p : x) p += glm::dvec3(3, -2, 1);
    CHECK(value(x).C == doctest::Approx(exact.C).epsilon(1e-9));
  };
  for (int trial = 0; trial < 200; ++trial) {
    check(Attach{}, {unit(generator), unit(generator), 0.3 * unit(generator), double(trial % 3), 0});
    check(Fibre{}, {unit(generator), unit(generator), unit(generator), 0.8, 0});
  }
  CHECK(taut > 250);
}

TEST_CASE("the parts of a viscous tet resist all rates of strain alike, and no turning") {
  std::mt19937 generator(9);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int trial = 0; trial < 100; ++trial) {
    std::array<glm::dvec3, 4> x;
    for (auto& p : x) p = glm::dvec3(unit(generator), unit(generator), unit(generator));
    const double six = glm::dot(glm::cross(x[1] - x[0], x[2] - x[0]), x[3] - x[0]);
    if (six < 0.2) continue;
    glm::dmat3 L;
    for (int c = 0; c < 3; ++c) L[c] = glm::dvec3(unit(generator), unit(generator), unit(generator));
    const glm::dmat3 D = 0.5 * (L + glm::transpose(L));
    const double trace = D[0][0] + D[1][1] + D[2][2];
    const glm::dmat3 shear = D - glm::dmat3(trace / 3);
    double squares = 0;
    for (int part = 0; part < 6; ++part) {
      const std::array<double, 2> rest = {double(part), six / 6};
      const auto c = Viscous::evaluate(x.data(), rest.data());
      double rate = 0, turning = 0;
      for (std::size_t j = 0; j < 4; ++j) {
        rate += glm::dot(c.gradient[j], L * x[j]);
        turning += glm::dot(c.gradient[j], glm::cross(glm::dvec3(1, 2, -3), x[j]));
      }
      CHECK(std::abs(turning) < 1e-9);
      if (part < 5) squares += rate * rate;
      if (part == 5) CHECK(rate == doctest::Approx(trace));
    }
    double expected = 0;
    for (int c = 0; c < 3; ++c) expected += glm::dot(shear[c], shear[c]);
    CHECK(squares == doctest::Approx(expected));
  }
}

TEST_CASE("every constraint kind has a formula that is zero at rest and the value expected of a hand-made change") {
  std::array<glm::dvec3, 2> edge = {glm::dvec3(0), glm::dvec3(3, 4, 0)};
  CHECK(Stretch::evaluate<double>(edge.data(), 4.0).C == doctest::Approx(1.0));
  // Two triangles on the edge z: one wing along x, the other at 90 degrees.
  std::array<glm::dvec3, 4> hinge = {glm::dvec3(1, 0, 0.5), glm::dvec3(-1, 0, 0.5), glm::dvec3(0, 0, 0),
                                     glm::dvec3(0, 0, 1)};
  CHECK(Formulas<double>{}.hinge_angle(hinge.data()) == doctest::Approx(0.0));
  hinge[1] = {0, 1, 0.5};
  CHECK(std::abs(Formulas<double>{}.hinge_angle(hinge.data())) == doctest::Approx(std::acos(-1.0) / 2));
  const double quarter = Formulas<double>{}.hinge_angle(hinge.data());
  hinge[1].y = -1;
  CHECK(Formulas<double>{}.hinge_angle(hinge.data()) == doctest::Approx(-quarter));  // the sign that arccos loses
  CHECK(Bend::evaluate<double>(hinge.data(), -quarter + 0.25).C == doctest::Approx(-0.25));
  CHECK(Bend::evaluate<double>(hinge.data(), -quarter + 2.0).C == doctest::Approx(-1.0));  // clamped to 1 rad
  // Angles wrap: 175 and -175 degrees are 10 degrees apart.
  const double pi = std::acos(-1.0);
  const double a = 175.0 / 180 * pi;
  for (double sign : {-1.0, 1.0}) {
    hinge[1] = {std::cos(pi - a), sign * std::sin(pi - a), 0.5};
    const double turned = Formulas<double>{}.hinge_angle(hinge.data());
    CHECK(std::abs(turned) == doctest::Approx(a));
    CHECK(std::abs(Bend::evaluate<double>(hinge.data(), -turned).C) == doctest::Approx(10.0 / 180 * pi));
  }
  std::array<glm::dvec3, 4> tet = {glm::dvec3(0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  CHECK(Volume::evaluate<double>(tet.data(), 0.0).C == doctest::Approx(1.0 / 6));
  tet[3].z = -1;
  CHECK(Volume::evaluate<double>(tet.data(), 1.0 / 6).C == doctest::Approx(-1.0 / 3));  // inverted: signed
}

TEST_CASE("one projection of one constraint meets it") {
  std::array<glm::dvec3, 4> tet = {glm::dvec3(0), glm::dvec3(1.1, 0, 0), glm::dvec3(0, 1, 0.1), glm::dvec3(0, 0.2, 1)};
  double w[4] = {1, 2, 0.5, 1};
  const double rest = 0.15;
  for (int k = 0; k < 4; ++k) {
    const auto c = Volume::evaluate<double>(tet.data(), rest);
    const double lambda = Formulas<double>{}.multiplier(c, w, 1, 1e9, 0, 1).lambda;
    for (std::size_t j = 0; j < 4; ++j) tet[j] += lambda * w[j] * c.gradient[j];
  }
  CHECK(Volume::evaluate<double>(tet.data(), rest).C == doctest::Approx(0).epsilon(1e-9));
}

TEST_CASE("degenerate shapes give finite corrections") {
  std::array<glm::vec3, 4> x{};
  float w[4] = {1, 1, 1, 1};
  for (int shape = 0; shape < 3; ++shape) {
    for (std::size_t j = 0; j < 4; ++j)
      x[j] = shape == 0 ? glm::vec3(0) : glm::vec3(float(j), 0, 0) * (shape == 1 ? 1.0f : 1e-20f);
    const auto tet = Volume::evaluate<float>(x.data(), 0.1f);
    const auto hinge = Bend::evaluate<float>(x.data(), 0.3f);
    CHECK(std::isfinite(Formulas<float>{}.multiplier(tet, w, 1, 1, 0, 1).lambda));
    CHECK(std::isfinite(Formulas<float>{}.multiplier(hinge, w, 1, 1, 0, 1).lambda));
    const auto edge = Stretch::evaluate<float>(x.data(), 0.1f);
    float two[2] = {1, 1};
    CHECK(std::isfinite(Formulas<float>{}.multiplier(edge, two, 1, 1, 0, 1).lambda));
  }
  // Of an edge that is 5 too short only the lighter end's correction is over the limit: both are shortened
  // alike.
  const std::array<glm::dvec3, 2> ends = {glm::dvec3(0), glm::dvec3(1, 0, 0)};
  double two[2] = {3, 2};
  auto moved = ends;
  const auto edge = Stretch::evaluate<double>(moved.data(), 6);
  Formulas<double> formulas;
  CHECK(formulas.multiplier(edge, two, 1, 10, 0, 1).lambda == doctest::Approx(1));
  CHECK(formulas.multiplier(edge, two, 1, 2.5, 0, 1).lambda * two[0] == doctest::Approx(2.5));
  CHECK(formulas.multiplier(edge, two, 1, 2.5, 0, 1).guards == GUARD_LIMIT);
  CHECK(formulas.multiplier(edge, two, 1, 10, 0, 1).guards == 0);
  auto none = edge;
  none.C = std::nan("");
  CHECK(formulas.multiplier(none, two, 1, 10, 0, 1).lambda == 0);
  CHECK(formulas.multiplier(none, two, 1, 10, 0, 1).guards == GUARD_NOT_FINITE);
}

TEST_CASE("guards: what triggers them, and where vertices without a direction go") {
  Formulas<double> formulas;
  const std::uint32_t id[4] = {7, 3, 12, 5}, swapped[2] = {3, 7};
  std::array<glm::dvec3, 2> edge = {glm::dvec3(1), glm::dvec3(1)};
  const auto stretch = Stretch::evaluate<double>(edge.data(), 0.5, id);
  CHECK(stretch.guards == GUARD_DIRECTION);
  CHECK(glm::length(stretch.gradient[0]) == doctest::Approx(1));
  CHECK(stretch.gradient[0] == -stretch.gradient[1]);
  // The same pair named the other way round parts the same way; another pair does not.
  CHECK(Stretch::evaluate<double>(edge.data(), 0.5, swapped).gradient[0] == -stretch.gradient[0]);
  CHECK(glm::length(Stretch::evaluate<double>(edge.data(), 0.5, id + 1).gradient[0] - stretch.gradient[0]) > 0.01);

  std::array<glm::dvec3, 4> line;
  for (int j = 0; j < 4; ++j) line[std::size_t(j)] = glm::dvec3(j, 0, 0);
  const double rest = 0.1;
  const auto tet = Volume::evaluate<double>(line.data(), rest, id);
  double w[4] = {1, 2, 3, 0};
  CHECK(tet.guards == GUARD_COLLAPSED);
  glm::dvec3 sum(0);
  for (const auto& g : tet.gradient) sum += g;
  CHECK(glm::length(sum) < 1e-12);
  const double lambda = formulas.multiplier(tet, w, 1, 1, 0, 1).lambda;
  for (int j = 0; j < 4; ++j) CHECK(glm::length(lambda * w[j] * tet.gradient[j]) < 3 * std::cbrt(rest));
  line[2].y = 0.01;  // a sliver of a triangle: a gradient again, under the floor
  const auto open = Volume::evaluate<double>(line.data(), rest, id);
  CHECK(open.guards == 0);
  CHECK(formulas.multiplier(open, w, 1, 1e9, 0, 1).guards == GUARD_FLOOR);
  std::array<glm::dvec3, 4> point{};
  CHECK(Bend::evaluate<double>(point.data(), 0.0, id).guards == GUARD_HINGE);
  std::array<glm::dvec3, 4> hinge = {glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 0),
                                     glm::dvec3(0, 0, 1)};
  const double angle = formulas.hinge_angle(hinge.data());
  CHECK(Bend::evaluate<double>(hinge.data(), angle - 0.9, id).guards == 0);
  CHECK(Bend::evaluate<double>(hinge.data(), angle - 1.1, id).guards == GUARD_ANGLE);
}
