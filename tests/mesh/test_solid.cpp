// Inside and outside of surfaces: winding numbers and crossings, distance fields.
#include <doctest/doctest.h>

#include <cmath>

#include "sim/mesh/distance_field.h"
#include "sim/mesh/solid.h"
#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

namespace {

const doctest::skip needs_openvdb(!can_make_distance_fields());

}  // namespace

TEST_CASE("solid: inside, nearest points and crossings") {
  const SurfaceMesh box = cube();
  const Solid solid(box);
  CHECK(solid.winding({0.3, 0.4, 0.6}) == doctest::Approx(1));
  CHECK(std::abs(solid.winding({1.3, 0.4, 0.6})) < 1e-3);
  const auto near = solid.nearest({0.3, 0.4, 1.5});
  CHECK(near.distance == doctest::Approx(0.5));
  CHECK(near.point.z == doctest::Approx(1));
  CHECK(solid.nearest({3, 0, 0}, 0.5).distance == 0.5);
  std::vector<Solid::Crossing> found;
  solid.find_crossings({-1, 0.4, 0.3}, {2, 0.41, 0.32}, found);
  REQUIRE(found.size() == 2);
  CHECK(found[0].at == doctest::Approx(1.0 / 3));
  CHECK(found[0].jump == 1);
  CHECK(found[1].jump == -1);
  CHECK(solid.winding_at({0.5, 0.45, 0.35}, {-1, 0.4, 0.3}, 0) == 1);
  CHECK(solid.sees({0.1, 0.2, 0.3}, 1, {0.9, 0.8, 0.7}));
  CHECK_FALSE(solid.sees({0.1, 0.2, 0.3}, 1, {1.2, 0.8, 0.7}));
  const SurfaceMesh two = joined(cube(), cube({0.5, 0.2, 0.2}));
  const Solid both(two);
  CHECK(both.winding({0.7, 0.5, 0.5}) == doctest::Approx(2));
  CHECK(both.sees({0.1, 0.5, 0.5}, 1, {1.4, 0.52, 0.51}));  // through the walls inside
}

TEST_CASE("distance field: signed of what is closed, a sheet's of what is not" * needs_openvdb) {
  const Folder folder;
  const auto at = [](const DistanceField& f, const glm::dvec3& p) {
    const glm::ivec3 i((p - f.origin) / f.spacing + 0.5);
    return double(f.values.at(std::size_t((i.z * f.size.y + i.y) * f.size.x + i.x)));
  };
  const DistanceField field = distance_field(cube({10, 0, 0}), 20);
  CHECK(field.size == glm::ivec3(27));
  CHECK(field.spacing == doctest::Approx(0.05));
  CHECK(field.origin.x == doctest::Approx(9.85));
  CHECK(at(field, {10.5, 0.5, 0.5}) == doctest::Approx(-0.5));
  CHECK(at(field, {10.2, 0.5, 0.5}) == doctest::Approx(-0.2));
  CHECK(at(field, {11.1, 0.5, 0.5}) == doctest::Approx(0.1));
  CHECK(at(field, {11.1, 1.1, 1.1}) == doctest::Approx(0.1 * std::sqrt(3)));
  const DistanceField again = distance_field(cube({10, 0, 0}), 20);
  CHECK(again.values == field.values);
  CHECK(!fs::is_empty(folder.cache()));
  SurfaceMesh inward = cube();
  for (Triangle& t : inward.triangles) std::swap(t[0], t[1]);
  CHECK(at(distance_field(inward, 20), {0.5, 0.5, 0.5}) == doctest::Approx(-0.5));

  const DistanceField sheet = distance_field(rectangle(2, 1), 20);
  CHECK(at(sheet, {1, 0.5, 0}) == doctest::Approx(-0.05));
  CHECK(at(sheet, {1, 0.5, 0.2}) == doctest::Approx(0.15));
  SurfaceMesh lost = cube();
  lost.positions[3].x = NAN;
  CHECK(contains(error_of([&] { distance_field(lost, 20, "lost.obj"); }), "not finite numbers: 1 vertex"));
}
