#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "app/commands.h"
#include "app/export.h"
#include "app/files.h"
#include "app/lab/auto_solver.h"
#include "app/lab/verdict.h"
#include "app/window/lanes.h"
#include "app/window/probe.h"
#include "render/renderer.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"
#include "sim/model/material.h"
#include "sim/reference/reference.h"
#include "sim/state_file.h"

namespace tetpbd {

namespace {

/// Draws what a run asked for and writes it.
struct FrameWriter {
  const RunOptions& options;
  const Sim& sim;
  double dt;    ///< s
  double size;  ///< m, of the bodies
  const Motion* right;
  long video_every;  ///< steps
  Target target;
  Renderer renderer;
  Frame frame;
  float azimuth = frame.camera.azimuth;  ///< at the start
  std::vector<CameraKey> path{};
  std::optional<Video> video{};
  long drawn = 0;                 ///< step of the last frame
  Buffer answers{}, distances{};  ///< of the colour motion

  FrameWriter(const Scene& scene, const Sim& all, const RunOptions& run, const Motion* motion)
      : options(run),
        sim(all),
        dt(scene.settings.dt),
        size(sim.model->size),
        right(motion),
        video_every(run.video_every > 0 ? run.video_every : steps_per_frame(dt)),
        target(make_target(run.size[0], run.size[1], run.samples)),
        renderer(make_renderer(*sim.model)),
        frame(make_frame(sim, scene_camera(scene, *sim.model, float(run.size[0]) / float(run.size[1])), run.view,
                         target)) {
    const double rate = std::clamp(1 / (double(video_every) * dt), 1.0, 120.0);  // of real time
    if (run.view.colour == Colour::motion && !right)
      throw Error("the reference motion is not known", "--colour motion", "find it with tetpbd reference first");
    if (run.view.colour == Colour::residual && any_material(scene.settings, compliant))
      throw Error("constraints with compliance give way as they should", "--colour residual",
                  "take --colour energy or stretch");
    if (run.view.colour == Colour::energy && sim.yielding)
      throw Error("energies of bodies that yield are not drawn", "--colour energy", "take --colour stretch");
    if (run.view.colour == Colour::energy && !sim.model->regions.empty())
      throw Error("energies of regions are not drawn", "--colour energy", "take --colour stretch or --export vtk");
    if (run.view.colour == Colour::energy && !any_material(scene.settings, has_energy))
      throw Error("there is no material", "--colour energy", "give one, as in --material neo-hookean");
    if (!run.camera_path.empty()) path = read_camera_path(run.camera_path);
    if (!run.video.empty()) video.emplace(run.video, run.size[0], run.size[1], rate);
  }

  void move_camera(long s) {
    Camera& camera = frame.camera;
    if (!path.empty()) {
      camera = camera_at(path, double(s) * dt);
      return;
    }
    if (options.turntable > 0) camera.azimuth = azimuth + float(360 * double(s) * dt / options.turntable);
    frame.options.follow = true;  // where the bodies are is found with the light's view of them
    bind_view(renderer, frame);
    frame.options.follow = false;
    const auto centre = poll_centre(renderer, true);
    if (centre && options.view.follow) follow(camera, *centre, float(double(s - drawn) * dt));
    if (centre && !options.view.follow) keep_in_view(camera, *centre, float(target.width) / float(target.height));
    drawn = s;
  }

  void draw_frame(long s) {
    const bool png = options.png_every > 0 && s % options.png_every == 0;
    const bool film = video && s % video_every == 0;
    // Of the last step that is kept up to this one.
    if (frame.options.colour == Colour::motion && send_answers(*right, s, answers)) {
      measure_distances(renderer, frame.positions, answers.id(), size, distances);
      frame.values = distances.id();
    }
    if (!png && !film) return;
    update(frame, sim);
    move_camera(s);
    if (*frame.options.scale().title && !frame.options.hold_range)
      frame.options.range() = fitted_range(frame.options.scale(), read_values(renderer, frame));
    draw(renderer, frame);
    const Image image = read_rgba(target);
    if (png) write_png(options.out / fmt::format("frame_{:05}.png", s), image);
    if (film) video->add(image);
  }
};

// What is not finite is written as null.
ordered_json vector(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

ordered_json times(const std::vector<double>& ms) {
  if (ms.empty()) return nullptr;
  return {{"median", median(ms)}, {"p05", percentile(ms, 0.05)}, {"p95", percentile(ms, 0.95)}};
}

// The scene's own keys, of all sections.
ordered_json settings_json(Scene scene, const Settings& settings) {
  scene.settings = settings;
  const ordered_json whole = scene_json(scene);
  ordered_json result = whole["solver"];
  result.update(whole["world"]);
  for (const char* key : {"bodies", "duration"}) result[key] = whole[key];
  return result;
}

// Of all bodies from files: the thinnest part, which of those without a lattice is found here, and the largest gap.
Fit fit_of(const Model& model) {
  Fit all;
  const auto take_thinnest = [&](double depth, const glm::dvec3& at) {
    if (depth <= std::fmin(depth, all.thinnest)) all.thinnest = depth, all.thinnest_at = at;
  };
  SurfaceMesh boundary{model.rest.positions, {}};
  for (const auto& [number, what, fit] : model.fills) {
    take_thinnest(fit.thinnest, fit.thinnest_at);
    if (fit.gap >= std::fmax(fit.gap, all.gap)) all.gap = fit.gap, all.edge = fit.edge;
    const Body& body = model.bodies[number];
    const auto first = model.rest.surface.begin() + std::ptrdiff_t(body.first_triangle);
    if (std::isnan(fit.thinnest))
      boundary.triangles.insert(boundary.triangles.end(), first, first + std::ptrdiff_t(body.triangles));
  }
  const Depth found = thinnest_part(boundary);
  take_thinnest(found.depth, found.at);
  return all;
}

// What each body, fixture and attachment is and does at the end.
void put_bodies(ordered_json& j, const Sim& sim) {
  const State state = read_state(sim);
  j["bodies"] = bodies_json(sim, state);
  for (const BodyFill& fill : sim.model->fills)
    if (!fill.what.empty()) j["fills"].push_back({{"body", sim.model->bodies[fill.body].name}, {"what", fill.what}});
  for (const StartMotion& m : sim.model->start_motions)
    j["start_motions"].push_back({{"body", m.body}, {"from", m.from}, {"motion", vector(m.motion)}, {"work", m.work}});
  for (const Fixture& fixture : sim.model->fixtures)
    j["fixtures"].push_back({{"body", sim.model->bodies[fixture.body].name},
                             {"fixed", fixture.region},
                             {"lag", lag_of(sim, fixture, state)}});
  for (std::size_t n = 0; n < sim.model->attachments.size(); ++n)
    j["attachments"].push_back(attachment_json(sim, n, state));
}

// What the mode and contact found to be needed.
void put_solver(ordered_json& j, Sim& sim) {
  const AdaptiveSubsteps& watch = adaptive_values(sim);
  if (solver_mode(sim.settings).leapfrog)
    j["watch"] = {{"longest_substep_at_rest", sim.longest_substep},
                  {"most_substeps", watch.most_substeps},
                  {"mass_scaling",
                   {{"added", sim.mass_scaling.added},
                    {"vertices", sim.mass_scaling.vertices},
                    {"longer", sim.mass_scaling.gain}}}};
  if (solver_mode(sim.settings).implicit)
    j["watch"] = {{"largest_residual", watch.largest_residual},
                  {"least_health", watch.least_health},
                  {"most_substeps", watch.most_substeps}};
  if (sim.pairs) {
    const PairNumbers pairs = touched(sim);
    j["contact"] = {{"touches", pairs.touches},     {"detections", pairs.detections},    {"pairs", pairs.listed_pairs},
                    {"truncated", pairs.truncated}, {"truncated_velocity", pairs.taken}, {"nearest", pairs.nearest}};
  }
  if (!sim.solver.stiffness_shares.empty()) j["stiffness_share"] = sim.solver.stiffness_shares;
}

ordered_json energy_json(const RunErrors& errors, const Measurement& last) {
  ordered_json j = {{"start", errors.last ? errors.start_energy : std::nan("")},
                    {"final", last.energy()},
                    {"max", errors.last ? errors.max_energy : std::nan("")},
                    {"final_kinetic", last.kinetic},
                    {"final_potential", last.potential},
                    {"elastic", last.elastic},
                    {"total", last.total},
                    {"work", errors.ledger.work},
                    {"dissipated", errors.ledger.dissipated()},
                    {"created", errors.ledger.created},
                    {"scale", errors.ledger.scale}};
  if (const auto why = errors.ledger.not_judged) j["not_judged"] = *why;
  return j;
}

ordered_json statistics_json(const Scene& scene, Sim& sim, const Capabilities& device, const MeasuredRun& run,
                             const ordered_json& hash, const std::optional<SolverChoice>& choice,
                             const Verdict& verdict) {
  ordered_json j;
  j["scene"] = scene.name;
  j["settings"] = settings_json(scene, sim.settings);
  j["settings"]["iterations"] = sim.plan.iterations, j["settings"]["substeps"] = sim.plan.substeps;
  if (choice) j["solver_choice"] = solver_choice_json(*choice);
  j["mesh"] = mesh_json(report(sim.model->rest), std::reduce(sim.model->masses.begin(), sim.model->masses.end()),
                        solver_mode(sim.settings).leapfrog
                            ? sim.longest_substep
                            : longest_stable_step({*sim.model, sim.system, sim.settings, sim.inverse_masses}),
                        fit_of(*sim.model));
  put_bodies(j, sim);
  j["device"] = device_json(device);
  j["timing"] = {{"steps", sim.steps},
                 {"gpu_ms_per_step", times(run.gpu_ms)},
                 {"wall_ms_per_step", times(run.wall_ms)},
                 {"fps", double(sim.steps) / run.seconds}};
  if (scene.copies > 1) {
    j["timing"]["copies"] = scene.copies;
    j["timing"]["copy_steps_per_second"] = scene.copies * double(sim.steps) / run.seconds;
  }
  put_solver(j, sim);
  const RunErrors& errors = run.errors;
  const Measurement last = errors.last.value_or(nothing_measured());
  j["error"] = error_json(errors);
  j["error"].update(distance_json("motion", run.motion, run.errors.finite));
  j["momentum"] = {{"linear_drift", errors.linear_drift},
                   {"angular_drift", errors.angular_drift},
                   {"linear", vector(last.momentum)},
                   {"angular", vector(last.angular_momentum)}};
  j["energy"] = energy_json(errors, last);
  const GuardCounts guards = guard_counts(sim);
  for (std::size_t g = 0; g < GUARDS; ++g) j["guards"][guard_names[g]] = guards[g];
  for (const auto& [name, count] : dropped(sim)) j["dropped"][name] = count;
  j["finite"] = errors.finite;
  if (errors.finite) j["verdict"] = verdict_json(verdict);
  j["non_finite"] = non_finite_json(errors.non_finite);
  j["state_hash"] = hash;
  return j;
}

// The tet whose volume is farthest from that at rest, now.
std::string worst_tet(const Sim& sim) {
  const Model& model = *sim.model;
  if (model.rest.tets.empty()) return "no tets";
  const auto x = read_state(sim).positions;
  const auto error = [&](std::size_t t) {
    const auto [a, b, c, d] = model.rest.tets[t];
    return tet_values(model, t, {x[a], x[b], x[c], x[d]}, {}).volume;
  };
  std::pair<float, std::size_t> worst;
  for (std::size_t t = 0; t < model.rest.tets.size(); ++t)
    if (const float e = error(t); std::abs(e) > std::abs(worst.first)) worst = {e, t};
  return fmt::format("worst tet at the end {:+.2f} % (number {})", 100 * worst.first, worst.second);
}

void print_summary(const Scene& scene, const RunOptions& options, Sim& sim, const MeasuredRun& run,
                   const ordered_json& statistics, const std::string& renderer, bool good) {
  fmt::print("{}: {} steps on {}, largest volume loss {}{:.2f} %, {}{:.3f} ms a step; {}\n", scene.name, sim.steps,
             renderer, options.measure_every > 1 ? "of measured steps " : "", run.errors.max_volume_loss_percent,
             good ? worst_tet(sim) + ", " : "", median(run.wall_ms), (options.out / "stats.json").string());
  if (scene.copies > 1)
    fmt::print("{} copies: {:.4g} steps a second of one\n", scene.copies,
               statistics["timing"]["copy_steps_per_second"].get<double>());
  for (const auto& [name, count] : dropped(sim))
    fmt::print("left out: {} {} (docs/guide.md, stats.json)\n", count, name);
  for (const ordered_json& fixture : statistics.value("fixtures", ordered_json::array()))
    if (const double lag = fixture["lag"]; good && lag > 1e-3 * sim.model->size)
      fmt::print("held back: fixed.{} of body '{}' is {:.3g} m behind its place\n", fixture["fixed"].get<int>(),
                 fixture["body"].get<std::string>(), lag);
  for (const ordered_json& held : statistics.value("attachments", ordered_json::array()))
    if (held["broken"])
      fmt::print("let go: '{}' of '{}', which pulled too much\n", held["body"].get<std::string>(),
                 held["to"].get<std::string>());
}

// Whether the checkpoint before it is there, from which the same bits lead to that step.
bool return_to_good_state(Sim& sim, long step) {
  if (!restore_checkpoint(sim)) return false;
  run_to_end(sim, nullptr, step - sim.steps);
  return !check_finite(sim, true);
}

}  // namespace

int run_headless(Scene scene, const RunOptions& options) {
  make_output_folder(options.out);
  const auto model = build_model(scene);
  HeadlessContext context(options.gpu);
  const auto choice = choose_and_say(scene, model);
  const long steps = options.steps > 0 ? options.steps : duration_in_steps(scene);
  scene.duration = double(steps) * scene.settings.dt;
  scene.camera = scene_camera(scene, *model, float(options.size[0]) / float(options.size[1]));
  write_file(options.out / "scene.json", json_text(scene_json(scene), 2) + "\n");
  Tuning tuning = tuning_from_environment();
  tuning.count_guards = true;
  Sim sim = create_sim(model, scene.settings, tuning);
  warm_up(sim);
  if (!options.from_state.empty() && !load_state(sim, options.from_state))
    print_error(
        fmt::format("tetpbd: {}: it was saved with other settings: goes on from positions and velocities alone\n",
                    printable(options.from_state.string())));
  Metrics metrics = create_metrics(sim);
  const auto right = right_motion(*model, sim.settings, options.reference);
  std::optional<FrameWriter> frames;
  if (options.png_every > 0) remove_frames(options.out, ".png");
  if (options.png_every > 0 || !options.video.empty()) frames.emplace(scene, sim, options, right ? &*right : nullptr);
  std::optional<GrowingFile> csv;
  if (options.csv_every > 0) csv.emplace(options.out / "stats.csv").add(csv_header());

  std::optional<Export> files;
  if (options.positions_every > 0 || !options.exports.empty()) files.emplace(sim, options);

  MeasuredRun run;
  {
    Progress progress("stepping", steps, options.progress);
    RunPlan plan{.measure_every = options.measure_every, .check_crossings = options.check_crossings, .standard = right};
    plan.measured = [&](const Measurement& measurement, const RunErrors& errors) {
      if (csv && measurement.step % options.csv_every == 0) csv->add(csv_row(measurement, errors));
    };
    plan.stepped = [&](long s) {
      progress.update(s);
      if (frames) frames->draw_frame(s);
      if (files && s % files->every == 0) add_frame(*files, sim);
    };
    if (!check_finite(sim)) plan.stepped(0);
    run = run_to_end(sim, &metrics, steps, plan);
  }
  if (frames && frames->video) frames->video->close();
  if (files) close(*files, sim);
  const auto& found = run.errors.non_finite;
  const bool good = !found || return_to_good_state(sim, found->step - 1);
  const ordered_json hash = hash_json(good ? std::optional(state_hash(sim)) : std::nullopt);
  if (!options.save_state.empty() && good && !interrupted()) save_state(sim, options.save_state);
  const Verdict verdict = judge(run.errors, sim);
  auto statistics = statistics_json(scene, sim, context.capabilities(), run, hash, choice, verdict);
  statistics["error"]["measured_every"] = options.measure_every;
  if (files)
    statistics["frames"] = {
        {"count", files->count}, {"every", files->every}, {"seconds", double(files->every) * scene.settings.dt}};
  write_file(options.out / "stats.json", json_text(statistics, 2) + "\n");
  if (csv) csv->close();
  if ((options.positions || options.positions_every > 0) && good) write_arrays(sim, options.out);
  print_summary(scene, options, sim, run, statistics, context.capabilities().renderer, good);
  if (interrupted())
    throw Error("interrupted", fmt::format("at step {} of {}", sim.steps, steps), "what was finished is written", 1);
  if (found) throw error_of(*found);
  fmt::print("{}\n", verdict_line(verdict));
  return verdict.level() == Verdict::wrong || (options.strict && verdict.level() != Verdict::right) ? 1 : 0;
}

int print_explanation(Scene scene, int gpu, long steps) {
  const auto model = build_model(scene);
  HeadlessContext context(gpu);
  choose_and_say(scene, model);
  Sim sim = create_sim(model, scene.settings);
  warm_up(sim);
  long before = 0;
  if (!on_cpu(sim)) {
    run_to_end(sim, nullptr, steps);
    before = sim.steps, sim.recorder.timing = true;
    run_to_end(sim, nullptr, 10, {.most_seconds = 10});
  }
  const Explanation e = explain(sim, int(sim.steps - before));
  fmt::print("{}: mode {}, {} vertices, {} tets", scene.name, sim.settings.mode, model->positions.size(),
             model->rest.tets.size());
  for (std::size_t k = 0; k < sim.system.lists.size(); ++k)
    if (sim.system.present[k]) fmt::print(", {} {}", sim.system.lists[k].count(), constraint_kinds[k].name);
  fmt::print("\n\n{:<52}{:>14}\n", "buffer", "bytes");
  for (const auto& buffer : e.buffers) fmt::print("{:<52}{:>14}\n", buffer.name, buffer.bytes);
  fmt::print("{:<52}{:>14}  ({:.1f} a tet)\n\n", "all", e.bytes,
             double(e.bytes) / double(std::max<std::size_t>(1, model->rest.tets.size())));
  fmt::print("{:<52}{:>12}{:>10}{:>14}{:>10}{:>8}\n", "kernel", "work-groups", "per step", "bytes each", "µs each",
             "GB/s");
  for (const auto& d : e.dispatches)
    fmt::print("{:<52}{:>12}{:>10}{:>14}{:>10}{:>8}\n", d.name, d.work_groups, d.per_step, d.bytes,
               d.ms ? fmt::format("{:.1f}", 1e3 * *d.ms) : "",
               d.ms ? fmt::format("{:.3g}", 1e-6 * double(d.bytes) / *d.ms) : "");
  fmt::print("{:<52}{:>12}{:>10}{:>14}{:>10.1f}\n", "all, in a step", "", e.dispatches_per_step, e.bytes_per_step,
             1e3 * e.ms_per_step);
  if (e.dispatches.empty()) fmt::print("mode {} steps on the CPU and uploads positions\n", sim.settings.mode);
  return 0;
}

int print_info(int gpu) {
  fmt::print("tetpbd {} ({} build)\n", TETPBD_VERSION, TETPBD_BUILD);
  const auto devices = list_devices();
  for (std::size_t i = 0; i < devices.size(); ++i) fmt::print("--gpu {}: {}\n", i, devices[i]);
  HeadlessContext context(gpu);
  const Capabilities& c = context.capabilities();
  fmt::print("OpenGL vendor:   {}\nOpenGL renderer: {}{}\nOpenGL version:  {}\nGLSL version:    {}\n", c.vendor,
             c.renderer, c.software ? " (software: a CPU, not a GPU)" : "", c.version, c.shading_language);
  fmt::print("storage blocks:  {} a compute stage, {} bytes each at most\n", c.storage_blocks, c.storage_bytes);
  fmt::print("work-groups:     {} invocations, {} bytes of shared memory\nMSAA:            {} samples\n",
             c.work_group_invocations, c.shared_bytes, c.samples);
  fmt::print("extensions used: none beyond OpenGL 4.3 core, but to ask for free memory\nmodels:          {}\n",
             models_folder().string());
  fmt::print("shaders:         {}\n", shader_folder().empty() ? "embedded" : shader_folder());
  fmt::print(
      "licences:        tetpbd MIT; TetGen, a program of its own, AGPL-3+; "
      "Stanford models: see models/README.md\n");
  return 0;
}

}  // namespace tetpbd
