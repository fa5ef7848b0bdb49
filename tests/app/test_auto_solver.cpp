// --solver auto and the named solvers.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "app/lab/auto_solver.h"
#include "app/lab/run.h"
#include "app/scene.h"
#include "app/window/lanes.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"
#include "sim/model/material.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

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

TEST_CASE("a solver by name puts its settings in place of the scene's, flags go on top") {
  const Settings paper = load_scene("bunny-drop", {.solver = "paper"}).settings;
  CHECK(paper.iterations == 25);
  CHECK(paper.substeps == 1);
  CHECK(paper.omega == 1.5);
  const Settings substeps =
      load_scene("bunny-drop", {.solver = "substeps", .parameters = {{"substeps", "7"}}}).settings;
  CHECK(substeps.iterations == 1);
  CHECK(substeps.substeps == 7);
  CHECK(load_scene("bunny-drop", {.solver = "hard"}).settings.substeps == 5);
  CHECK_THROWS(load_scene("bunny-drop", {.solver = "rigid"}));
  CHECK_THROWS(load_scene("bunny-drop", {.solver = "paper", .budget_ms = 1.0}));
  CHECK_THROWS(load_scene("bunny-drop", {.solver = "auto", .parameters = {{"substeps", "7"}}}));
  CHECK(load_scene("bunny-drop", {.budget_ms = 2.0}).budget_ms == 2.0);
  CHECK(*load_scene("bunny-drop", {.solver = "auto", .parameters = {{"dt", "0.01"}}}).budget_ms == doctest::Approx(1));
  CHECK_FALSE(load_scene("bunny-drop").budget_ms);
}

TEST_CASE("a soft body that nobody says the mode of takes explicit where that is cheap, else newton") {
  GlTest gl;
  const auto chosen = [](std::vector<std::pair<std::string, std::string>> parameters) {
    Scene scene = falling({.parameters = std::move(parameters)});
    const auto said = choose_by_rule(scene, *build_model(scene));
    CHECK_FALSE(scene.mode_open);
    const Plan plan = plan_for(scene.settings);
    return fmt::format("{} {}x{} {}", scene.settings.mode, plan.substeps, plan.iterations, said.value_or("-"));
  };
  CHECK(chosen({{"material", "neo-hookean"}, {"young_modulus", "1e4"}}).starts_with("explicit"));
  CHECK(chosen({{"material", "neo-hookean"}, {"young_modulus", "1e11"}}).starts_with("newton 4x16 newton, 4 sub"));
  CHECK(chosen({{"material", "springs"}, {"mode", "node"}, {"substeps", "9"}}) == "node 9x1 -");
  CHECK(chosen({{"material", "springs"}, {"substeps", "9"}}) == "node 9x1 -");
  CHECK(chosen({}).ends_with(" -"));  // nothing has a force
  // Soft enough to be pressed flat by what it falls, unless it is held or there is no ground.
  const auto dropped = [](const char* modulus, bool held, bool ground) {
    Scene scene = falling({.parameters = {{"material", "neo-hookean"}, {"young_modulus", modulus}}});
    scene.bodies[0].position.y = 1, scene.settings.ground = ground;
    if (held) scene.bodies[0].fixed.push_back({{{0, 0.9, 0}, {1, 1, 1}}});
    return *choose_by_rule(scene, *build_model(scene));
  };
  CHECK(dropped("1e4", false, true) == "newton, 4 substeps of 8 iterations: the impact would press the body flat");
  CHECK(dropped("1e4", true, true).starts_with("explicit"));
  CHECK(dropped("1e4", false, false).starts_with("explicit"));
  CHECK(dropped("1e5", false, true).starts_with("explicit"));
  CHECK(load_scene("soft-beam").mode_open);
  CHECK_FALSE(load_scene("soft-beam", {.solver = "newton"}).mode_open);
  CHECK_FALSE(load_scene("bunny-drop").mode_open);
  // What the rule expects is what the mode takes.
  Scene scene = falling({.parameters = {{"material", "neo-hookean"}, {"young_modulus", "1e8"}, {"mode", "explicit"}}});
  const auto model = build_model(scene);
  const Sim sim = create_sim(model, scene.settings);
  CHECK(explicit_substeps(*model, scene.settings) == doctest::Approx(sim.plan.substeps).epsilon(0.08));
}

TEST_CASE("auto takes the most accurate solver, and as many substeps as the budget holds (long)") {
  GlTest gl;
  for (const bool soft : {false, true}) {
    CAPTURE(soft);
    Scene scene = falling({.budget_ms = 4.0});
    scene.duration = 0.4;
    scene.bodies[0].rotation = {10, 20, 30};
    if (soft) scene.settings.material = "neo-hookean", scene.settings.young_modulus = 2e5;
    const Settings own = scene.settings;
    const auto model = build_model(scene);
    const auto choice = choose_for(scene, model);
    REQUIRE(choice);
    CHECK_FALSE(scene.budget_ms);
    CHECK(scene.settings == choice->settings());
    CHECK(choice->judged == (soft ? "finer steps" : "motion"));
    REQUIRE(choice->trials.size() == 5);  // node in its ways, cpu-fast, explicit and newton, the scene's own
    CHECK(choice->trials.back().settings == own);
    CHECK(choice->trials.end()[-2].settings.mode == (soft ? "newton" : "cpu-fast"));
    CHECK(choice->trials[choice->best].fits);
    // Against the reference motion, found anew: 1.3 times the best error that fits, at most.
    const ConstraintSystem system = build_constraints(model->rest, own);
    const Motion right = find_motion({*model, system, own, model->inverse_masses}, choice->steps);
    double chosen = 0, least = 1;
    for (const SolverTrial& trial : choice->trials) {
      CHECK(trial.ms > 0);
      CHECK((!trial.fits || trial.ms <= 1.05 * 4));  // one that was ended as too slow may have a lower median
      if (!trial.fits) continue;
      const MeasuredRun run = run_model(model, trial.settings, choice->steps, &right);
      least = std::min(least, run.motion->rms);
      if (&trial == &choice->trials[choice->best]) chosen = run.motion->rms;
    }
    CHECK(chosen > 0);
    CHECK(chosen <= 1.3 * std::max(least, 5e-5));
    CHECK(describe(*choice).find("of 4 ms a step") != std::string::npos);
    CHECK(describe(*choice).find(soft ? "from finer steps" : "from the reference motion") != std::string::npos);
    CHECK(solver_choice_json(*choice)["trials"].size() == choice->trials.size());
    if (soft) continue;
    // k between 0 and 1 has no reference motion.
    Settings paper = own;
    paper.stiffness[index_of<Volume>] = 0.5;
    CHECK(choose_solver(model, paper, 4, 5).judged == "volume");
    CHECK(choose_solver(model, own, 100, 2).settings().substeps > 4);
    CHECK_THROWS_WITH_AS(choose_solver(model, own, 1e-6, 2), doctest::Contains("nothing fits the budget"), Error);
  }
}

TEST_CASE("auto: says how far it is, and can be cancelled at any time, which changes nothing") {
  GlTest gl;
  Scene scene = falling({.budget_ms = 4.0});
  scene.duration = 0.2;
  const auto model = build_model(scene);
  std::vector<std::pair<std::string, double>> told;
  Scene chosen = scene;
  REQUIRE(choose_for(chosen, model, [&](const std::string& what, double part) { told.emplace_back(what, part); }));
  CHECK(told.size() > 5);  // more than the candidates
  CHECK(told.front().first.starts_with("node, candidate 1 of 5"));
  CHECK(told.front().second == 0);
  CHECK(told.back().first.find("candidate 5 of 5") != std::string::npos);
  for (std::size_t i = 1; i < told.size(); ++i) CHECK(told[i].second <= 1);
  for (const double when : {0.0, 0.3, 0.7}) {
    Scene kept = scene;
    const auto cancel = [&](const std::string&, double part) {
      if (part >= when) throw Interrupted();
    };
    CHECK_THROWS_AS(choose_for(kept, model, cancel), Interrupted);
    CHECK(kept.settings == scene.settings);
    CHECK(kept.budget_ms == scene.budget_ms);
  }
}

TEST_CASE("auto: a lane with a budget takes what fits it (long)") {
  GlTest gl;
  Settings paper;
  paper.iterations = 400, paper.substeps = 1;
  const auto model = samples::block_model({2, 1, 1}, 0.01);
  const Settings chosen = lane_settings(paper, "budget_ms=5", "--lane", model);
  CHECK(chosen.iterations == 1);  // in as many substeps as fit; 400 iterations do not
}

TEST_CASE("each mode has its own substeps and iterations, where nobody asks for others") {
  const auto plan = [](std::vector<std::pair<std::string, std::string>> parameters, std::vector<std::string> set = {}) {
    const Plan p = plan_for(load_scene("beam", {.parameters = std::move(parameters), .set = std::move(set)}).settings);
    return fmt::format("{}x{}", p.substeps, p.iterations);
  };
  CHECK(plan({}) == "20x1");  // the scene's own
  CHECK(plan({{"mode", "constraint"}}) == "20x1");
  CHECK(plan({{"mode", "newton"}}) == "1x4");  // those of a scene for corrections mean nothing to it
  CHECK(plan({{"mode", "newton"}, {"substeps", "2"}}) == "2x4");
  CHECK(plan({{"mode", "newton"}, {"iterations", "8"}}) == "1x8");
  CHECK(plan({{"iterations", "auto"}, {"substeps", "auto"}}, {"solver.mode=newton"}) == "1x4");
  CHECK(plan({}, {"solver.iterations=16", "solver.mode=newton"}) == "1x16");
  CHECK(plan({}, {"solver.mode=cpu"}) == "20x1");
  Settings settings;
  settings.substeps = 23, settings.iterations = 5;
  set_mode(settings, "newton", "test");
  CHECK(plan_for(settings) == Plan{1, 4, settings.dt});
  CHECK(settings.substeps == automatic);
  CHECK(parameter_text(settings, *find_parameter("substeps")) == "auto");
  CHECK_THROWS_WITH_AS(set_parameter(settings, *find_parameter("substeps"), "-1", "test"),
                       doctest::Contains("substeps"), Error);
}
