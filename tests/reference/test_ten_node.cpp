// Ten-node tets against differences of their energy, against linear tets where these are exact, and what the total
// error says of meshes of one beam.
#include "sim/reference/leapfrog.h"
#include "sim/reference/total_error.h"
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

namespace {

struct Ten {
  Halved halved;
  std::vector<TenNodeTet> tets;
  Points x;  // deformed
};
Ten ten_nodes(const Scene& scene, const std::function<glm::dvec3(const glm::dvec3&)>& deformed) {
  Ten ten{halve_edges(scene.model), {}, {}};
  const ConstraintSystem system = build_constraints(ten.halved.model, scene.settings);
  ten.tets = ten_node_tets(system.lists[index_of<NeoHookean>], ten.halved.model.rest.positions);
  for (const glm::dvec3& p : ten.halved.model.rest.positions) ten.x.push_back(deformed(p));
  return ten;
}
double total_energy(const Ten& ten) {
  double sum = 0;
  for (const TenNodeTet& tet : ten.tets) sum += energy(tet, ten.x);
  return sum;
}
Points total_forces(const Ten& ten) {
  Points sum(ten.x.size(), glm::dvec3(0));
  for (const TenNodeTet& tet : ten.tets) {
    const auto own = forces(tet, ten.x);
    for (std::size_t n = 0; n < 10; ++n) sum[tet.nodes[n]] += own[n];
  }
  return sum;
}

// Let go under its weight, over `steps` steps of 5 ms.
Motion motion_of(const Scene& scene, const std::string& method, long steps) {
  return find_motion(scene.input(), steps, method);
}
double total_of(const Scene& scene, const std::shared_ptr<const Truth>& truth, long steps) {
  const Motion own = motion_of(scene, "leapfrog", steps);
  const TotalError total = total_error(truth, scene.model);
  MotionError error;
  for (std::size_t k = 0; k < own.kept.size(); ++k)
    add_state(error, total, scene.model, own.kept[k], {own.positions[k], {}});
  CHECK(error.instants == own.kept.size());
  return error.relative;
}

}  // namespace

TEST_CASE("ten-node tets: forces are the falls of the energy") {
  const Scene scene = beam_of("neo-hookean", {3, 2, 2}, 1e5, 0.45);
  generator.seed(5);
  Ten ten = ten_nodes(scene, [](const glm::dvec3& p) { return p + noise(0.05); });
  const Points all = total_forces(ten);
  double largest = 0;
  for (const glm::dvec3& f : all) largest = std::max(largest, glm::length(f));
  constexpr double reach = 1e-6;
  for (std::size_t i = 0; i < ten.x.size(); i += 3)
    for (int a = 0; a < 3; ++a) {
      const double before = ten.x[i][a];
      ten.x[i][a] = before + reach;
      const double above = total_energy(ten);
      ten.x[i][a] = before - reach;
      const double below = total_energy(ten);
      ten.x[i][a] = before;
      CHECK(std::abs((below - above) / (2 * reach) - all[i][a]) < 1e-7 * largest);
    }
}

TEST_CASE("ten-node tets: what deforms evenly has the energy of linear tets, and no force inside") {
  const Scene scene = beam_of("neo-hookean", {3, 3, 3}, 1e5, 0.3);
  const glm::dmat3 F(1.2, 0.1, -0.2, 0.3, 0.8, 0.1, 0.05, -0.1, 1.1);
  const Ten ten = ten_nodes(scene, [&](const glm::dvec3& p) { return F * p; });
  Points linear;
  for (const glm::dvec3& p : scene.model.rest.positions) linear.push_back(F * p);
  const double right = tetpbd::energy({scene.system, none, std::vector<double>(linear.size(), 0), linear}, linear);
  CHECK(off(total_energy(ten), right) < 1e-12);
  const Points all = total_forces(ten);
  const Bounds box = bounds(ten.halved.model.rest.positions);
  double largest = 0, inside = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const glm::dvec3& p = ten.halved.model.rest.positions[i];
    const bool is_inside = glm::all(glm::greaterThan(p, box.low + 1e-9)) && glm::all(glm::lessThan(p, box.high - 1e-9));
    double& most = is_inside ? inside : largest;
    most = std::max(most, glm::length(all[i]));
  }
  CHECK(largest > 100);
  CHECK(inside < 1e-10 * largest);
}

TEST_CASE("ten-node tets: a halved body keeps mass, fixture and motion") {
  Scene scene = beam_of("neo-hookean", {4, 1, 1}, 1e5, 0.3);
  scene.model.velocities.back() = {1, 2, 3};
  const Halved halved = halve_edges(scene.model);
  double before = 0, after = 0;
  for (const double m : scene.model.masses) before += m;
  for (const double m : halved.model.masses) after += m;
  CHECK(off(after, before) < 1e-12);
  CHECK(halved.model.rest.tets.size() == 8 * scene.model.rest.tets.size());
  CHECK(std::ranges::count(halved.model.inverse_masses, 0.0) == 9);  // the end has 4 corners, 4 sides, 1 diagonal
  CHECK(halved.model.velocities[halved.corner.back()] == glm::dvec3(1, 2, 3));
}

TEST_CASE("total error: meshes of one beam come nearer to ten-node tets, and the scene's own motion hides it") {
  const auto beam = [](const glm::ivec3& cells) {
    Scene scene = beam_of("neo-hookean", cells, 2e5, 0.45);
    scene.settings.gravity = 3;
    return scene;
  };
  const Scene finer = beam({8, 3, 3});
  const long steps = 40;
  const auto truth = std::make_shared<const Truth>(
      Truth{std::make_shared<const Model>(finer.model), motion_of(finer, "ten-node", steps)});
  CHECK(truth->motion.method == "ten-node");
  CHECK(truth->motion.scene != scene_key(finer.input()));
  const double coarse = total_of(beam({4, 1, 1}), truth, steps), middle = total_of(beam({8, 2, 2}), truth, steps),
               fine = total_of(beam({16, 4, 4}), truth, steps);
  MESSAGE("relative total error: ", coarse, " ", middle, " ", fine);
  CHECK(coarse > 1.4 * middle);
  CHECK(middle > 1.5 * fine);
  CHECK(fine > 0.01);  // the solver's own is below 1e-4 here
  // The same elements on other cells say the same.
  const Scene other = beam({6, 2, 2});
  const auto again = std::make_shared<const Truth>(
      Truth{std::make_shared<const Model>(other.model), motion_of(other, "ten-node", steps)});
  CHECK(off(total_of(beam({8, 2, 2}), again, steps), middle) < 0.1);
}

TEST_CASE("total error: other bodies, and constraints without a material, have none") {
  const Scene scene = beam_of("neo-hookean", {4, 1, 1}, 1e5, 0.3);
  Model two = scene.model;
  add_body(two, "another", scene.model.rest, 1000, scene.model.positions, glm::dvec3(0), glm::dvec3(0), {});
  const auto truth = std::make_shared<const Truth>(Truth{std::make_shared<const Model>(two), {}});
  CHECK_THROWS_AS(total_error(truth, scene.model), Error);
  Scene constraints = block_scene();
  CHECK_THROWS_WITH(find_motion(constraints.input(), 1, "ten-node"), doctest::Contains("have no motion on finer"));
}
