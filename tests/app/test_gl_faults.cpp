// What goes wrong on a GPU: states that stop being numbers, and drivers that refuse. Each is provoked and has
// to be said.
#include <doctest/doctest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/files.h"
#include "app/window/session.h"
#include "render/target.h"
#include "sim/sim.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

std::shared_ptr<const Model> block(double size = 1, glm::dvec3 velocity = glm::dvec3(0), double height = 0.2) {
  TetMesh mesh = make_block(glm::dvec3(size, 0.6 * size, 0.5 * size), {5, 3, 2});
  for (auto& p : mesh.positions) p.y += (0.3 + height) * size;
  auto model = std::make_shared<Model>();
  add_body(*model, "block", mesh, 1000, mesh.positions, velocity, glm::dvec3(0), {});
  return model;
}

Settings quick(const std::string& mode) {
  Settings s;
  s.iterations = 25, s.substeps = 1;
  s.mode = mode;
  s.iterations = 3;
  return s;
}

bool is_finite(const State& state) {
  for (const auto* list : {&state.positions, &state.velocities})
    for (const glm::dvec3& v : *list)
      if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) return false;
  return true;
}

std::string what_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// Writes into what the GPU reads, as a faulty kernel would.
void spoil(const Sim& sim, std::uint32_t vertex, bool velocity, float value) {
  const Buffer& buffer = velocity ? sim.velocities : sim.positions;
  buffer.write(vertex * (velocity ? sizeof(Velocity) : sizeof(Position)) + 4, sizeof value, &value);
}

}  // namespace

TEST_CASE("a given state that is not finite is found at once, with its lowest vertex") {
  GlTest gl;
  for (const SolverMode& mode : pbd_modes())
    for (const bool velocity : {false, true})
      for (const double value : {not_a_number, infinity, -infinity, 1e39}) {  // the last is none as a float
        CAPTURE(mode.name);
        CAPTURE(velocity);
        CAPTURE(value);
        Sim sim = create_sim(block(), quick(mode.name));
        for (int s = 0; s < 3; ++s) step(sim);
        const State good = read_state(sim);
        State state = good;
        for (std::size_t v : {61, 17, 40}) (velocity ? state.velocities : state.positions)[v].z = value;
        write_state(sim, state);
        REQUIRE(check_finite(sim));
        CHECK(sim.check.found->vertex == 17);
        CHECK(sim.check.found->step == 3);
        CHECK(has(error_of(*sim.check.found).what(), "at step 3, vertex 17"));
        CHECK(!restore_checkpoint(sim));
        write_state(sim, good);
        CHECK(!check_finite(sim, true));
        step(sim);
        CHECK(!check_finite(sim, true));
      }
}

TEST_CASE("what stops being a number on the GPU is found in its step, and the checkpoint comes back bit for bit") {
  GlTest gl;
  for (const char* mode : {"node", "constraint"})
    for (const bool velocity : {false, true})
      for (const int good_steps : {0, 5, 64, 100, 230}) {
        CAPTURE(mode);
        CAPTURE(velocity);
        CAPTURE(good_steps);
        Settings settings = quick(mode);
        settings.iterations = 1, settings.rigid_contact = false;  // that puts a velocity right
        Sim sim = create_sim(block(), settings);
        const int checkpoint = good_steps / 64 * 64;
        for (int s = 0; s < checkpoint; ++s) step(sim);
        const std::uint64_t hash = state_hash(sim);
        for (int s = checkpoint; s < good_steps; ++s) step(sim);
        CHECK(!check_finite(sim, good_steps == 5));
        spoil(sim, 33, velocity, std::numeric_limits<float>::quiet_NaN());
        for (int s = 0; s < 40; ++s) step(sim);  // nobody asks for a while
        REQUIRE(check_finite(sim, true));
        CHECK(sim.check.found->step == good_steps + 1);
        CHECK(sim.check.found->vertex <= 33);
        REQUIRE(restore_checkpoint(sim));
        CHECK(sim.steps == checkpoint);
        CHECK(state_hash(sim) == hash);
        CHECK(!check_finite(sim, true));
        for (int s = checkpoint; s < good_steps; ++s) step(sim);
        CHECK(!check_finite(sim, true));
      }
}

TEST_CASE("a fixed vertex that is moved nowhere is found too") {
  GlTest gl;
  for (const SolverMode& mode : pbd_modes()) {
    CAPTURE(mode.name);
    Settings settings = quick(mode.name);
    settings.constraints = "";
    Sim sim = create_sim(block(), settings);
    pin(sim, 7);
    step(sim);
    move_pinned(sim, 7, glm::dvec3(0, not_a_number, 0));
    step(sim);
    REQUIRE(check_finite(sim, true));
    CHECK(sim.check.found->step == 2);
    CHECK(sim.check.found->vertex == 7);
    CHECK(restore_checkpoint(sim));
    CHECK(sim.steps == 0);
    CHECK(is_pinned(sim, 7));
    CHECK(is_finite(read_state(sim)));
    CHECK(!check_finite(sim, true));
    step(sim);
    CHECK(!check_finite(sim, true));
  }
}

TEST_CASE("absurd settings either stay numbers or are found, and the last good state comes back") {
  GlTest gl;
  struct Absurd {
    const char* name;
    double size, speed, dt, omega, gravity;
  };
  for (const SolverMode& mode : pbd_modes())
    for (const Absurd& a : {Absurd{"fast", 1, 1e5, 1, 1.5, 9.81},
                            {"heavy", 1, 0, 1, 1.5, 1000},
                            {"omega", 1, 0, 0.005, 4, 9.81},
                            {"large", 1e6, 1e5, 1, 4, 1000},
                            {"huge", 1e11, 0, 0.005, 1.5, 9.81},
                            {"tiny", 1e-12, 1e5, 1, 4, 1000}}) {
      CAPTURE(mode.name);
      CAPTURE(a.name);
      Settings settings = quick(mode.name);
      settings.dt = a.dt, settings.omega = a.omega, settings.gravity = a.gravity;
      Sim sim = create_sim(block(a.size, glm::dvec3(a.speed, -a.speed, 0)), settings);
      for (int s = 0; s < 150; ++s) step(sim);
      const auto found = check_finite(sim, true);
      CHECK(found.has_value() == !is_finite(read_state(sim)));
      if (!found) continue;
      MESSAGE(mode.name << " " << a.name << ": " << error_of(*found).what());
      REQUIRE(restore_checkpoint(sim));
      CHECK(is_finite(read_state(sim)));
      CHECK(sim.steps < found->step);
      CHECK(sim.steps >= found->step - 64);
    }
}

TEST_CASE("a measured run ends with the numbers of the last good step and never shows others as numbers") {
  GlTest gl;
  const auto model = block();
  for (const char* mode : {"node", "cpu"}) {
    Settings settings = quick(mode);
    settings.rigid_contact = false;  // a rigid body has velocities of its own
    Sim sim = create_sim(model, settings);
    Metrics metrics = create_metrics(*model);
    const auto spoil_after_6 = [&](long s) {
      if (s == 6 && std::string(mode) == "cpu") sim.host.velocities[9].x = infinity;
      if (s == 6) spoil(sim, 9, true, std::numeric_limits<float>::infinity());
      return true;
    };
    const MeasuredRun run = run_to_end(sim, &metrics, 50, {.stepped = spoil_after_6});
    REQUIRE(run.errors.non_finite);
    CHECK(run.errors.non_finite->step == 7);
    CHECK(!run.errors.finite);
    REQUIRE(run.errors.last);
    CHECK(run.errors.last->step == 6);
    CHECK(run.errors.last->finite());
    CHECK(std::isfinite(run.errors.max_volume_loss_percent));
    CHECK(run.wall_ms.size() == 6);
    const auto text = non_finite_json(run.errors.non_finite).dump();
    CHECK(has(text, "\"step\":7"));
    Measurement bad = *run.errors.last;
    bad.non_finite = 1;
    bad.kinetic = not_a_number;
    const std::string row = csv_row(bad, run.errors);
    CHECK(!has(row, "nan"));
    CHECK(has(row, ",,,"));
    CHECK(row.ends_with(",0\n"));
  }
  const auto file = std::filesystem::temp_directory_path() / "tetpbd_nan.npy";
  CHECK_THROWS_AS(write_npy(file, {glm::vec3(0), glm::vec3(0, float(not_a_number), 0)}), Error);
  CHECK(!std::filesystem::exists(file));
}

TEST_CASE("nothing that is not finite is drawn, in any look or colour, and none of it is picked") {
  GlTest gl;
  const auto model = block();
  Sim sim = create_sim(model, quick("node"));
  Renderer renderer = make_renderer(model->rest);
  Picker picker = make_picker(model->rest);
  const Target target = make_target(96, 64);
  Frame frame;
  frame.target = target.framebuffer.id();
  frame.viewport = {0, 0, target.width, target.height};
  frame.ground = 0.0f;
  frame.options.legend = false;
  frame_box(frame.camera, {-0.6f, 0, -0.6f}, {0.6f, 1, 0.6f}, 1.5f, 1.2f);
  const std::vector<std::uint32_t> dots{0, 5};
  frame.pinned = dots;
  const auto picture = [&] {
    frame.positions = sim.positions.id();
    frame.velocities = sim.velocities.id();
    draw(renderer, frame);
    return read_rgba(target).rgba;
  };
  for (const Look look : {Look::surface, Look::wire, Look::tets})
    for (const Colour colour : {Colour::plain, Colour::volume, Colour::stretch, Colour::velocity}) {
      frame.options.look = look, frame.options.colour = colour;
      CAPTURE(look_names[std::size_t(look)]);
      CAPTURE(colour_names[std::size_t(colour)]);
      reset(sim);
      const auto good = picture();
      State away = read_state(sim), bad = away;
      for (auto& p : away.positions) p = glm::dvec3(0, 1e8, 0);  // beyond what is drawn: the empty scene
      write_state(sim, away);
      const auto empty = picture();
      CHECK(good != empty);
      for (const double value : {not_a_number, infinity, -infinity}) {
        for (auto& p : bad.positions) p.y = value;
        write_state(sim, bad);
        CHECK(picture() == empty);
        request(picker, sim.positions.id(),
                {eye(frame.camera), glm::normalize(frame.camera.target - eye(frame.camera))});
        CHECK(!poll(picker, true)->hit);
      }
      if (colour != Colour::velocity) continue;
      frame.pinned = {};
      State wild = read_state((reset(sim), sim));
      for (auto& v : wild.velocities) v.x = not_a_number;
      write_state(sim, wild);
      CHECK(picture() == empty);
      frame.pinned = dots;
    }
}

TEST_CASE("free fall goes on exactly when dt, substeps, gravity or the mode change on the way") {
  GlTest gl;
  for (const SolverMode& mode : pbd_modes()) {
    CAPTURE(mode.name);
    Settings settings = quick(mode.name);
    settings.ground = false;
    settings.dt = 0.02;
    Sim sim = create_sim(block(), settings);
    pin(sim, 3);
    const glm::dvec3 held = read_state(sim).positions[3];
    settings.constraints = "";
    apply_settings(sim, settings);  // so that the pinned vertex does not hold the others
    double fallen = 0, speed = 0;
    const auto fall = [&](int steps) {
      for (int s = 0; s < steps; ++s) step(sim);
      const double t = steps * sim.settings.dt, g = sim.settings.gravity;
      fallen += speed * t + 0.5 * g * t * t;
      speed += g * t;
    };
    fall(20);
    settings.dt = 0.001;
    apply_settings(sim, settings);
    fall(50);
    settings.substeps = 7, settings.dt = 0.03;
    apply_settings(sim, settings);
    fall(10);
    settings.gravity = -3;
    apply_settings(sim, settings);
    fall(10);
    settings.mode = std::string(mode.name) == "cpu" ? "node" : "cpu", settings.substeps = 1;
    apply_settings(sim, settings);
    fall(10);
    const State state = read_state(sim);
    double worst = 0;
    for (std::size_t i = 0; i < state.positions.size(); ++i)
      if (i != 3)
        worst = std::max(worst, glm::length(state.positions[i] - sim.model->positions[i] + glm::dvec3(0, fallen, 0)));
    CHECK(worst < 1e-5 * fallen);
    CHECK(glm::length(state.positions[3] - held) < 1e-6);
    CHECK(glm::length(state.velocities[3]) == 0);
  }
}

TEST_CASE("limits of a driver are named with what is needed and what there is") {
  GlTest gl;
  CHECK(capabilities().storage_blocks >= 8);
  CHECK(has(what_of([&] { create_sim(block(), quick("node"), {.storage = 100}); }), "a storage buffer is too large: "));
  CHECK(has(what_of([&] { make_target(100000, 10); }), "bad image size: 100000x10"));
  const auto model = block();
  Sim sim = create_sim(model, quick("node"));
  Metrics metrics = create_metrics(*model);
  metrics.recorder.storage = 100;
  CHECK(has(what_of([&] { measure(metrics, sim); }), "a storage buffer is too large: 'positions' of "));
  Renderer renderer = make_renderer(model->rest);
  renderer.recorder.storage = 100;
  const Target target = make_target(32, 32);
  Frame frame;
  frame.positions = sim.positions.id(), frame.target = target.framebuffer.id();
  frame.viewport = {0, 0, 32, 32};
  CHECK(has(what_of([&] { draw(renderer, frame); }), "a storage buffer is too large: 'surface "));
}

TEST_CASE("a copy of the state may be larger than a storage block, for kernels see parts of it alone") {
  GlTest gl;
  Sim sim = create_sim(block(), quick("node"));
  REQUIRE(sim.check.checkpoint.bytes() > sim.positions.bytes());
  for (const GLuint block : {0u, 1u, 2u}) {
    GLint buffer = 0;
    GLint64 bytes = 0;
    glGetIntegeri_v(GL_SHADER_STORAGE_BUFFER_BINDING, block, &buffer);
    glGetInteger64i_v(GL_SHADER_STORAGE_BUFFER_SIZE, block, &bytes);
    if (GLuint(buffer) != sim.check.checkpoint.id()) continue;
    CHECK(bytes > 0);  // else all of it
    CHECK(bytes <= GLint64(sim.positions.bytes()) + 256);
  }
}

TEST_CASE("memory that a GPU does not have is refused before a run, with what is needed and what there is") {
  GlTest gl;
  const auto model = block();
  const auto mode_named = [](const char* mode) {
    Settings settings = quick(mode);
    settings.contact = "self";
    if (solver_mode(settings).forces)
      settings.material = "neo-hookean", settings.substeps = settings.iterations = automatic;
    return settings;
  };
  Sim running = create_sim(model, quick("node"));
  step(running);
  struct AsBefore {
    ~AsBefore() { gl_counts().most_bytes = 0; }
  } as_before;
  for (const SolverMode& mode : solver_modes()) {
    CAPTURE(mode.name);
    const GlLive before = gl_live();
    std::int64_t needed = 0;
    {
      const Sim whole = create_sim(model, mode_named(mode.name));
      needed = gl_live().buffer_bytes - before.buffer_bytes;
    }
    for (int part = 0; part < 20; ++part) {
      gl_counts().most_bytes = before.buffer_bytes + needed * part / 20 + 1;
      const std::string what = what_of([&] { create_sim(model, mode_named(mode.name)); });
      CAPTURE(what);
      CHECK(has(what, "out of GPU memory: buffer '"));
      CHECK(has(what, " bytes beside "));
      CHECK(has(what, " are available: "));
      CHECK(gl_live().buffer_bytes == before.buffer_bytes);
      CHECK(gl_live().objects == before.objects);
      if (std::string(mode.name) == "node") continue;
      const auto hash = state_hash(running);
      CHECK(has(what_of([&] { apply_settings(running, mode_named(mode.name)); }), "out of GPU memory: "));
      CHECK(running.settings.mode == "node");
      CHECK(state_hash(running) == hash);
    }
    gl_counts().most_bytes = 0;
    step(running);
    CHECK(!check_finite(running, true));
  }
}

TEST_CASE("a buffer that does not fit is named with its bytes, and the simulation beside it goes on") {
  HeadlessContext context;  // no debug context: that one reports the refusal as a GL error
  Sim sim = create_sim(block(), quick("node"));
  step(sim);
  const std::string what = what_of([] { Buffer("adjacency", std::size_t(1) << 46); });
  CHECK(has(what, "out of GPU memory: buffer 'adjacency' of 70368744177664 bytes"));
  step(sim);
  CHECK(!check_finite(sim, true));
}

TEST_CASE("a GPU that was reset ends the program, whatever it was doing") {
  GlTest gl;
  Sim sim = create_sim(block(), quick("node"));
  step(sim);
  check_finite(sim, true);
  REQUIRE((GLEW_KHR_robustness || GLEW_VERSION_4_5));
  const auto of_driver = __glewGetGraphicsResetStatus;  // GLEW's pointer: no software renderer is ever reset
  for (const GLenum reason : {GL_GUILTY_CONTEXT_RESET, GL_INNOCENT_CONTEXT_RESET, GL_UNKNOWN_CONTEXT_RESET}) {
    static GLenum answer;
    answer = reason;
    __glewGetGraphicsResetStatus = []() -> GLenum { return answer; };
    CHECK_THROWS_AS(check_finite(sim), ContextLost);
    CHECK_THROWS_AS(([&] {
                      for (int s = 0; s < FiniteCheck::checkpoint_every; ++s) step(sim);
                    }()),
                    ContextLost);  // nobody asks
    CHECK(has(what_of([&] { check_context(); }), "the GPU was reset: "));
    Session session;
    CHECK_THROWS_AS(attempt(session, [] { check_context(); }),
                    ContextLost);  // no message: there is no window left
    __glewGetGraphicsResetStatus = of_driver;
  }
  CHECK(!attempt(*std::make_unique<Session>(), [] { throw Error("a", "b", "c"); }));
  check_context();
}

TEST_CASE("shader faults name file and line, or the uniform") {
  GlTest gl;
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / ("tetpbd_shaders_" + std::to_string(getpid()));
  fs::remove_all(folder);
  fs::copy(TEST_MODELS "/../shaders", folder, fs::copy_options::recursive);
  const auto with = [&](const std::string& file, const std::string& from, const std::string& to) {
    std::ifstream stream(folder / file);
    std::string text{std::istreambuf_iterator<char>(stream), {}};
    const std::string before = text;
    const auto at = text.find(from);
    REQUIRE(at != std::string::npos);
    std::ofstream(folder / file) << text.replace(at, from.size(), to);
    set_shader_folder(folder.string());
    std::string what = what_of([] {
      Sim sim = create_sim(block(), quick("constraint"));
      step(sim);
      Renderer renderer = make_renderer(sim.model->rest);
      const Target target = make_target(32, 32);
      Frame frame;
      frame.positions = sim.positions.id();
      frame.target = target.framebuffer.id();
      frame.viewport = {0, 0, 32, 32};
      frame.ground = 0.0f;
      draw(renderer, frame);
    });
    set_shader_folder("");
    std::ofstream(folder / file) << before;
    CHECK(!has(what, "\n"));
    return what;
  };
  CHECK(with("solvers/average.comp", "void main", "void main") == "");
  CHECK(
      has(with("solvers/average.comp", "uint i = group", "uint i = nothing + group"), "shaders/solvers/average.comp:"));
  CHECK(has(with("solvers/average.comp", "\"double_single.glsl\"", "\"pears.glsl\""),
            "no such shader: " + folder.string() + "/pears.glsl"));
  CHECK(has(with("render/plane.frag", "uniform float opacity", "const float opacity = 1.0"),
            "no such uniform: 'opacity' in plane"));
  CHECK(has(with("render/point.glsl", "vec3 edge;", "vec2 edge;"), "surface"));
  CHECK(has(with("render/point_in.glsl", "vec3 edge;", "vec3 edges;"), "shaders/render/body.frag:"));
  const std::string unlinked = with("render/point_in.glsl", "in Point {", "in Punkt {");
  CAPTURE(unlinked);
  if (is_software_renderer()) CHECK(has(unlinked, "shader program does not link: surface: "));  // others may link it
  // A kernel that goes wrong in a certain step: blamed, and the last good state stands.
  {
    std::ifstream stream(folder / "solvers/corrections.glsl");
    std::string text{std::istreambuf_iterator<char>(stream), {}};
    const std::string end = "positions[i] = Position(";
    REQUIRE(has(text, end));
    text.insert(text.find(end), "if (i == 12u && x.high.y < 0.45) x.high.x = sqrt(x.high.y - 1.0);\n  ");
    std::ofstream(folder / "solvers/corrections.glsl") << text;
  }
  set_shader_folder(folder.string());
  for (const char* mode : {"node", "constraint"}) {
    Settings settings = quick(mode);
    settings.constraints = "";
    Sim sim = create_sim(block(), settings);
    long steps = 0;
    while (!check_finite(sim, true) && steps < 200) step(sim), ++steps;
    REQUIRE(sim.check.found);
    CHECK(sim.check.found->vertex == 12);
    CHECK(sim.check.found->step == steps);
    CHECK(steps > 5);
    REQUIRE(restore_checkpoint(sim));
    CHECK(sim.steps == (steps - 1) / 64 * 64);
    CHECK(is_finite(read_state(sim)));
  }
  set_shader_folder("");
  fs::remove_all(folder);
}
