// Random scenes of bodies thrown at each other: blocks, rods of long triangles, thin plates, sheets and bunnies, light
// and heavy, slow and at 50 m/s. Nothing crosses.
#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <random>

#include "app/scene.h"
#include "sim/measure/crossings.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"

using namespace tetpbd;
using nlohmann::json;

namespace {

class RandomScene {
 public:
  explicit RandomScene(std::uint64_t seed) : random_(seed) {}

  json make() {
    with_sheets_ = chance(0.25);
    const int count = 2 + int(number(0, is_long_run() ? 8.99 : 2.99));
    reach_ = 0.2 * std::cbrt(count) + 0.2;
    fast_ = chance(0.35);
    json scene;
    const double young_modulus = pick({1e4, 1e5, 1e6});
    for (int b = 0; b < count; ++b) {
      json body = shape();
      place(body);
      if (!with_sheets_)
        body["material"] = {{"model", "neo-hookean"}, {"young_modulus", young_modulus}, {"poisson_ratio", 0.4}};
      scene["bodies"].push_back(body);
    }
    scene["world"] = {{"ground", chance(0.6)}, {"friction", pick({0, 0.3, 0.8})}};
    if (chance(0.3)) scene["world"]["contact"] = "self";
    scene["solver"] = {{"dt", pick({0.002, 0.005})}, {"mode", chance(0.5) ? "node" : "explicit"}};
    if (with_sheets_)
      scene["solver"].update({{"mode", "node"},
                              {"constraints", {"stretch", "isobend", "volume"}},
                              {"compliance_stretch", 1e-6},
                              {"compliance_volume", 1e-9},
                              {"compliance_isobend", 1e3},
                              {"constraint_damping", 1e-3}});
    return scene;
  }

 private:
  double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  bool chance(double part) { return number(0, 1) < part; }
  double pick(std::vector<double> from) { return from[std::size_t(number(0, double(from.size()) - 1e-9))]; }
  int whole(std::initializer_list<int> from) { return from.begin()[int(number(0, double(from.size()) - 1e-9))]; }
  json three(double low, double high) { return {number(low, high), number(low, high), number(low, high)}; }

  json shape() {
    const double kind = number(0, with_sheets_ ? 6 : 4);
    if (kind < 1.5)
      return {{"block", {{"size", three(0.08, 0.35)}, {"cells", {whole({1, 2, 3}), whole({1, 2, 4}), whole({1, 3})}}}}};
    if (kind < 2.5) {
      const double width = pick({0.02, 0.04});
      return {{"block", {{"size", {width, number(0.4, 0.8), width}}, {"cells", {1, whole({1, 3, 10}), 1}}}}};
    }
    if (kind < 3.5 || (kind < 4 && !is_long_run()))
      return {{"block", {{"size", {0.3, 0.015, 0.25}}, {"cells", {whole({2, 6}), 1, whole({2, 5})}}}}};
    if (kind < 4) return {{"mesh", "bunny_coarse.obj"}, {"height", number(0.15, 0.4)}};
    const int cells = whole({5, 12});
    return {{"sheet", {{"size", {0.5, 0.5}}, {"cells", {cells, cells}}}}, {"thickness", pick({0.001, 0.004})}};
  }

  void place(json& body) {
    const glm::dvec3 at(number(-reach_, reach_), number(0.05, 2 * reach_), number(-reach_, reach_));
    glm::dvec3 velocity(number(-3, 3), number(-3, 3), number(-3, 3));
    if (fast_ && chance(0.5)) velocity = -50.0 * glm::normalize(at);  // at the others
    body["position"] = {at.x, at.y, at.z}, body["velocity"] = {velocity.x, velocity.y, velocity.z};
    body["rotation"] = three(0, 360), body["spin"] = three(-8, 8);
    const bool is_sheet = body.contains("sheet");
    body["density"] = chance(0.7) || is_sheet ? pick({100, 500, 1000, 2000}) : pick({20, 40000});
  }

  std::mt19937_64 random_;
  bool with_sheets_ = false, fast_ = false;
  double reach_ = 1;  // m
};

}  // namespace

TEST_CASE("random contact: bodies of all shapes, masses and speeds do not cross (long)") {
  GlTest gl;
  const std::uint64_t first = seed_of_run(1);
  const auto file = std::filesystem::temp_directory_path() / ("tetpbd_random_" + std::to_string(getpid()) + ".json");
  long touches = 0, scenes = 0;
  for (std::uint64_t seed = first; seed < first + (is_long_run() ? 200 : 6); ++seed) {
    const std::string text = RandomScene(seed).make().dump();
    CAPTURE(seed);
    CAPTURE(text);
    std::ofstream(file) << text;
    const Scene scene = load_scene(file.string());
    std::filesystem::remove(file);
    const auto model = build_model(scene);
    const bool self = scene.settings.contact == "self";
    if (find_crossings(*model, model->positions, self).pairs > 0) continue;  // no room to move them apart
    ++scenes;
    Sim sim = create_sim(model, scene.settings);
    for (int s = 0; s < (is_long_run() ? 60 : 12); ++s) {
      step(sim);
      REQUIRE_FALSE(check_finite(sim, true));
      REQUIRE(find_crossings(*model, read_state(sim).positions, self).pairs == 0);
    }
    touches += long(touched(sim).touches);
  }
  MESSAGE(scenes, " scenes, ", touches, " touches");
  CHECK(scenes > 3);
  CHECK(touches > 0);
}
