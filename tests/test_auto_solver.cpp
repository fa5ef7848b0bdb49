// --solver auto and the named solvers.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>

#include "app/auto_solver.h"
#include "app/scene.h"
#include "sim/gl/context.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

Scene falling(const SceneOverrides& overrides) {
  Scene scene = load_scene("beam", overrides);
  scene.bodies[0].fixed.clear();
  scene.bodies[0].block->cells = {6, 4, 4};
  scene.bodies[0].block->size = {1, 0.7, 0.7};
  scene.bodies[0].position = {0, 0.1, 0};
  return scene;
}

}  // namespace

TEST_CASE("a solver by name puts its settings in place of the scene's; flags go on top") {
  const Settings paper = load_scene("bunny-drop", {.solver = "paper"}).settings;
  CHECK(paper.iterations == 25);
  CHECK(paper.substeps == 1);
  CHECK(paper.omega == 1.5);
  const Settings substeps =
      load_scene("bunny-drop", {.solver = "substeps", .parameters = {{"substeps", "7"}}}).settings;
  CHECK(substeps.iterations == 1);
  CHECK(substeps.substeps == 7);
  CHECK_THROWS(load_scene("bunny-drop", {.solver = "hard"}));
  CHECK_THROWS(load_scene("bunny-drop", {.solver = "paper", .budget_ms = 1.0}));
  CHECK_THROWS(load_scene("bunny-drop", {.solver = "auto", .parameters = {{"substeps", "7"}}}));
  CHECK(load_scene("bunny-drop", {.budget_ms = 2.0}).budget_ms == 2.0);
  CHECK(*load_scene("bunny-drop", {.solver = "auto", .parameters = {{"dt", "0.01"}}}).budget_ms ==
        doctest::Approx(1));
  CHECK_FALSE(load_scene("bunny-drop").budget_ms);
}

TEST_CASE("auto takes what loses least volume, and as many substeps as the budget holds") {
  GlTest gl;
  Scene scene = falling({.budget_ms = 4.0});
  const auto model = build_model(scene);
  scene.duration = 0.4;
  const auto choice = choose_for(scene, model);
  REQUIRE(choice);
  CHECK_FALSE(scene.budget_ms);
  CHECK(scene.settings == choice->settings());
  CHECK(choice->trials.size() == 3);  // averaged, with more over-relaxation, with masses split
  CHECK(choice->trials[2].settings.mass_splitting);
  for (const SolverTrial& trial : choice->trials) {
    CHECK(trial.settings.iterations == 1);
    CHECK(trial.settings.substeps >= 1);
    CHECK(trial.ms > 0);
    CHECK(0.99 * choice->trials[choice->best].loss_percent <=
          trial.loss_percent + 1e-4);  // nothing lost: any
  }
  CHECK(describe(*choice).find("of 4 ms a step") != std::string::npos);
  CHECK(solver_choice_json(*choice)["trials"].size() == 3);

  // What over-relaxation would change is not tried with it.
  Settings soft = scene.settings;
  soft.compliance[index_of<Volume>] = 1e-6, soft.omega = 1.5;
  CHECK(choose_solver(model, soft, 1, 3).trials.size() == 1);
  // No budget is too small for one substep, and a hundred times the budget holds more.
  CHECK(choose_solver(model, scene.settings, 1e-6, 2).settings().substeps == 1);
  const SolverChoice early = choose_solver(model, scene.settings, 100, 2);
  CHECK(early.settings().substeps > 4);
  CHECK(early.lost_nothing);  // it has not hit the ground: the first is taken
  CHECK(early.best == 0);
  CHECK(describe(early).find("none lost volume in 2 steps") != std::string::npos);
}
