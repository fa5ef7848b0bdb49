// The judge of contact: exact signs, and pairs of triangles that cut each other against what is known.
#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "sim/measure/crossings.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

Model two_triangles(const std::array<glm::dvec3, 3>& a, const std::array<glm::dvec3, 3>& b) {
  Model model;
  for (const auto& corners : {a, b}) {
    TetMesh mesh;
    mesh.positions.assign(corners.begin(), corners.end());
    mesh.surface = {{0, 1, 2}}, mesh.thickness = 0.001;
    add_body(model, "sheet", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  }
  return model;
}
std::size_t pairs_of(const Model& model, bool self = false) {
  return find_crossings(model, model.positions, self).pairs;
}

}  // namespace

TEST_CASE("crossings: signs are exact where rounding gets them wrong") {
  const glm::dvec3 a(0.1, 0.2, 0.3), b(12.7, 3.1, 4.9), c(5.3, 17.9, 2.1);
  CHECK(orientation(a, b, c, a + glm::dvec3(0, 0, 1)) == 1);
  CHECK(orientation(a, b, c, a - glm::dvec3(0, 0, 1)) == -1);
  CHECK(orientation(a, b, c, b) == 0);
  // Of points whose coordinates are multiples of 2^-40, within 2^20: the sign by integers of 128 bits.
  std::mt19937 random(7);
  const auto draw = [&](std::int64_t most) { return std::int64_t(random() % std::uint64_t(2 * most)) - most; };
  int wrong = 0, flat = 0;
  for (int n = 0; n < 20000; ++n) {
    std::array<std::array<std::int64_t, 3>, 4> p;
    for (auto& q : p)
      for (auto& k : q) k = draw(1 << 20);
    // The last lies in the plane of the others, or beside it by one unit.
    const std::int64_t s = draw(8), t = draw(8), beside = std::int64_t(n % 3) - 1;
    for (std::size_t k = 0; k < 3; ++k) p[3][k] = p[0][k] + s * (p[1][k] - p[0][k]) + t * (p[2][k] - p[0][k]);
    p[3][std::size_t(n) % 2] += beside;
    __extension__ typedef __int128 Wide;
    std::array<std::array<Wide, 3>, 3> e;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t k = 0; k < 3; ++k) e[i][k] = p[i + 1][k] - p[0][k];
    const Wide volume = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) +
                        e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
                        e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
    const int right = volume > 0 ? 1 : volume < 0 ? -1 : 0;
    flat += right == 0;
    std::array<glm::dvec3, 4> x;
    for (std::size_t i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) x[i][k] = std::ldexp(double(p[i][std::size_t(k)]), -18);
    wrong += orientation(x[0], x[1], x[2], x[3]) != right;
  }
  CHECK(wrong == 0);
  CHECK(flat > 5000);
}

TEST_CASE("crossings: triangles that cut, touch, or pass each other by the least that a double tells") {
  const std::array<glm::dvec3, 3> flat{glm::dvec3(0, 0, 0), {1, 0, 0}, {0, 0, 1}};
  const auto standing = [](double from, double to) {
    return std::array<glm::dvec3, 3>{glm::dvec3(0.2, from, 0.2), {0.3, to, 0.2}, {0.2, to, 0.3}};
  };
  const Model cut = two_triangles(flat, standing(-0.1, 0.5));
  const Crossings found = find_crossings(cut, cut.positions, false);
  CHECK(found.pairs == 1);
  CHECK(found.first == std::array<std::uint32_t, 2>{0, 1});
  double length = 2 + std::sqrt(2.0);
  length += 2 * std::hypot(0.1, 0.6) + std::hypot(0.1, 0.1);
  CHECK(found.depth == doctest::Approx(0.1 / (length / 6)));
  CHECK(pairs_of(two_triangles(standing(-0.1, 0.5), flat)) == 1);
  CHECK(pairs_of(two_triangles(flat, standing(1e-300, 0.5))) == 0);
  CHECK(pairs_of(two_triangles(flat, standing(0, 0.5))) == 0);  // touches
  CHECK(pairs_of(two_triangles(flat, standing(-1e-300, 0.5))) == 1);
  CHECK(pairs_of(two_triangles(flat, flat)) == 0);  // in one plane
  Model held = cut;
  held.inverse_masses.assign(held.inverse_masses.size(), 0);
  CHECK(pairs_of(held) == 0);
}

TEST_CASE("crossings: a body cuts itself where its mesh is folded, and only with self") {
  TetMesh mesh = make_block(glm::dvec3(1, 0.1, 0.1), {10, 1, 1});
  Model model;
  add_body(model, "rod", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  CHECK(pairs_of(model, true) == 0);
  for (glm::dvec3& p : model.positions)  // a coil, whose ends are in each other
    p = glm::dvec3((0.15 + p.y) * std::cos(7 * p.x), (0.15 + p.y) * std::sin(7 * p.x), p.z);
  CHECK(pairs_of(model, true) > 5);
  CHECK(pairs_of(model) == 0);
}
