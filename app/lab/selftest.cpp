// `tetpbd info --selftest`: whether this device and driver compute what they should, and how fast.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands.h"
#include "app/lab/auto_solver.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

struct Checks {
  int all = 0;
  std::vector<std::string> failed{};
  void add(const std::string& what, double value, double most) {
    const bool good = value <= most;  // not where it is NaN
    fmt::print("{} {}: {:.2g}, at most {:.2g}\n", good ? "ok  " : "FAIL", what, value, most);
    std::fflush(stdout);
    if (interrupted()) throw Interrupted();
    ++all;
    if (!good) failed.push_back(what);
  }
};

/// A block that turns as it falls and lands; soft ones are of jelly.
Scene falling_block(bool soft) {
  Scene scene = load_scene("beam");
  BodyDescription& body = scene.bodies[0];
  body.fixed.clear();
  body.block = {.size = {1, 0.7, 0.7}, .cells = {6, 4, 4}, .mirror = false};
  body.position = {0, 0.1, 0}, body.rotation = {10, 20, 30};
  if (soft) scene.settings.material = "neo-hookean", scene.settings.young_modulus = 2e5;
  return scene;
}

State state_after(const std::shared_ptr<const Model>& model, Settings settings, const char* mode, long steps) {
  set_mode(settings, mode, "selftest");
  Sim sim = create_sim(model, settings);
  run_to_end(sim, nullptr, steps);
  return read_state(sim);
}

double largest_distance(const State& a, const State& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.positions.size(); ++i) {
    const double apart = glm::distance(a.positions[i], b.positions[i]);
    if (!(apart <= most) && most == most) most = apart;  // NaN stays
  }
  return most;
}

/// One constraint, which all modes solve alike, and one step of many, which both Jacobi modes do.
void check_steps(Checks& checks) {
  Scene scene = falling_block(false);
  scene.settings.iterations = 5, scene.settings.substeps = 1;
  const auto block = build_model(scene);
  checks.add("a step of node against constraint, m",
             largest_distance(state_after(block, scene.settings, "node", 1),
                              state_after(block, scene.settings, "constraint", 1)),
             1e-6);
  scene.bodies[0].block.reset();
  scene.bodies[0].tet = {{{0, 0, 0}, {1, 0, 0}, {0, 0, -1}, {0.2, 0.9, -0.3}}};
  scene.bodies[0].position.y = 1, scene.bodies[0].deform = "stretch:1.05";
  scene.settings.mass_splitting = false;
  scene.settings.constraints = "volume", scene.settings.iterations = 1, scene.settings.omega = 1;
  const auto tet = build_model(scene);
  const State right = state_after(tet, scene.settings, "cpu-double", 1);
  for (const char* mode : {"node", "constraint", "gauss-seidel", "cpu", "cpu-fast"})
    checks.add(fmt::format("a step of {} against cpu-double, m", mode),
               largest_distance(state_after(tet, scene.settings, mode, 1), right), 1e-6);
}

/// Against what is right, which a CPU finds in double precision.
void check_motions(Checks& checks) {
  for (const bool soft : {false, true}) {
    const Scene scene = falling_block(soft);
    const auto model = build_model(scene);
    constexpr long steps = 60;
    const ConstraintSystem system = build_constraints(*model, scene.settings);
    const Motion right = find_motion({*model, system, scene.settings, model->inverse_masses}, steps);
    for (const SolverMode& mode : solver_modes()) {
      if (!soft && mode.forces) continue;
      Settings settings = scene.settings;
      set_mode(settings, mode.name, "selftest");
      if (mode.implicit) settings.substeps = 2, settings.iterations = 8;
      const MeasuredRun run = run_model(model, settings, steps, &right, false);
      const double most = !soft ? 0.01 : mode.leapfrog ? 1e-4 : 0.02;
      checks.add(
          fmt::format("{}, {}: distance from the reference motion over the size", soft ? "soft" : "hard", mode.name),
          run.errors.finite ? run.motion->final : std::nan(""), most);
    }
  }
}

void check_bits(Checks& checks) {
  for (const bool soft : {false, true}) {
    SceneOverrides overrides;
    if (soft) overrides.parameters = {{"material", "neo-hookean"}, {"young_modulus", "1e6"}};
    const Scene scene = load_scene("bunny-drop", overrides);
    const auto model = build_model(scene);
    for (const std::string mode : {soft ? "explicit" : "node", soft ? "newton" : "constraint", "gauss-seidel"}) {
      Settings settings = scene.settings;
      set_mode(settings, mode, "selftest");
      settings.substeps = 4;
      Sim sim = create_sim(model, settings);
      std::uint64_t hashes[2];
      for (std::uint64_t& hash : hashes) {
        reset(sim);
        run_to_end(sim, nullptr, 10);
        hash = state_hash(sim);
      }
      checks.add(fmt::format("{}: runs of 10 that have other bits than the first", mode), hashes[0] != hashes[1], 0);
    }
  }
}

/// Steps a second beside the error: of a hard body, and of a soft one by both ways to step it.
std::vector<std::string> speeds(Checks& checks) {
  std::vector<std::string> said;
  const auto run = [&](const std::string& what, const std::shared_ptr<const Model>& model, const Settings& settings,
                       const Motion& right, double most) {
    const MeasuredRun measured = run_model(model, settings, right.kept.back(), &right);
    const double error = measured.errors.finite ? measured.motion->final : std::nan("");
    checks.add(what + ": distance from the reference motion", error, most);
    said.push_back(fmt::format("{} {:.3g} ms {:.1e}", what, step_ms(measured), error));
  };
  const bool slow = is_software_renderer();
  const Scene hard = load_scene("bunny-drop");
  const auto bunny = build_model(hard);
  run("bunny-drop node 20x1", bunny, hard.settings, *rigid_motion(*bunny, hard.settings, slow ? 100 : 160), 1e-3);
  Scene soft = load_scene(
      "soft-beam", {.parameters = {{"material", "neo-hookean"}, {"young_modulus", "1e6"}, {"mode", "explicit"}}});
  const auto beam = build_model(soft);
  Settings fine = soft.settings;
  fine.stability = 0.1, fine.mass_scaling = 0;
  Sim finest = create_sim(beam, fine);
  const Motion right = motion_of_run(finest, slow ? 20 : 80);
  run("soft-beam explicit", beam, soft.settings, right, 1e-4);
  apply_preset(soft.settings, solver_presets(), "newton");
  run("soft-beam newton 1x4", beam, soft.settings, right, 0.01);
  return said;
}

}  // namespace

int run_selftest(int gpu) {
  Checks checks;
  {
    HeadlessContext context(gpu, true);
    const Capabilities& device = context.capabilities();
    fmt::print("{}, OpenGL {}{}\n", device.renderer, device.version,
               device.software ? ": a SOFTWARE renderer on the CPU" : "");
    count_gl_errors(print_gl_error);
    const int before = gl_error_count();
    check_steps(checks);
    check_motions(checks);
    check_bits(checks);
    checks.add("OpenGL errors", gl_error_count() - before, 0);
  }
  HeadlessContext context(gpu);
  const auto said = speeds(checks);
  const ordered_json limits = launch_and_bandwidth_limits(context.capabilities().software);
  fmt::print(
      "\nto share, ms a step and the error:\ntetpbd {} | {} | {} | {} | dispatch {:.2f} us | copy {:.0f} "
      "GB/s | {} of {} checks\n",
      TETPBD_VERSION, context.capabilities().renderer, context.capabilities().version, fmt::join(said, " | "),
      number(limits, "dispatch_us"), number(limits, "copy_gb_s"), std::size_t(checks.all) - checks.failed.size(),
      checks.all);
  if (!checks.failed.empty())
    throw Error("this device does not compute what it should", fmt::format("{}", fmt::join(checks.failed, "; ")),
                "try a newer driver, and report the lines above", 1);
  return 0;
}

}  // namespace tetpbd
