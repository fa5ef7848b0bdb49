// Compliance and constraint damping (XPBD): closed forms, the GPU against double, and a beam whose sag and
// frequency do not depend on the solver's settings.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "sim/error.h"
#include "sim/sim.h"
#include "sim/solvers/colours.h"
#include "sim/solvers/cpu_pbd.h"
#include "tests/gl_test.h"
#include "tests/reference/reference_steps.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

constexpr double pi = 3.14159265358979323846;

// A mass on a spring along x, the other end fixed at the origin, 1 m at rest; built by hand.
struct Spring {
  Model model;
  ConstraintSystem system;
  Settings settings = samples::quick("node", 25);
  State state;
  explicit Spring(double mass) {
    model.rest.positions = model.positions = {glm::dvec3(0), glm::dvec3(1, 0, 0)};
    model.masses = {0, mass}, model.inverse_masses = {0, 1 / mass};
    model.size = 1;
    system.lists.resize(std::size_t(kind_count));
    system.present = {true, false, false};
    system.at_vertex = {1, 1};
    system.lists[0].arity = 2;
    system.lists[0].vertices = {0, 1}, system.lists[0].rest = {1};
    settings.ground = false, settings.gravity = 0;
    settings.constraints = "stretch";
    state = {model.positions, {glm::dvec3(0), glm::dvec3(0)}};
  }
  double step(Sweep sweep) {  // the stretch after it
    CpuPbd<double> pbd(model, system);
    pbd.step(state, settings, model.inverse_masses, sweep);
    return glm::length(state.positions[1]) - 1;
  }
};

// Irregular, so that vertices have different numbers of constraints and masses.
std::shared_ptr<const Model> block_model(glm::ivec3 cells, double height, const std::string& deformation,
                                         const std::vector<std::uint32_t>& fixed = {}) {
  TetMesh mesh = make_block(glm::dvec3(1.0, 0.7, 0.5), cells);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    auto& p = mesh.positions[i];
    p += 0.02 * glm::dvec3(std::sin(12.9 * double(i)), std::sin(78.2 * double(i)), std::sin(37.7 * double(i)));
    p.y += 0.37 + height;
    p.x += 0.15 * p.y * p.y;
  }
  finish_tets(mesh, "block");
  auto model = std::make_shared<Model>();
  auto start = mesh.positions;
  deform(start, mesh, deformation, 1);
  add_body(*model, "block", mesh, 1000, start, glm::dvec3(0.5, 0, 0), glm::dvec3(0, 2, 1), fixed);
  return model;
}

Settings soft(const std::string& mode, int iterations, int substeps, double tau = 0) {
  Settings s;
  s.iterations = 25, s.substeps = 1;
  s.mode = mode, s.iterations = iterations, s.substeps = substeps;
  s.compliance[index_of<Stretch>] = 1e-6, s.compliance[index_of<Bend>] = 1e-4, s.compliance[index_of<Volume>] = 1e-10;
  s.constraint_damping = tau;
  return s;
}

double distance(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, glm::length(a[i] - b[i]));
  return largest;
}

State jacobi_after(const Sim& sim) {
  State state = read_state(sim);
  CpuPbd<double>(*sim.model, sim.system).step(state, sim.settings, sim.inverse_masses, Sweep::jacobi);
  return state;
}

// A beam clamped at one end, 0.6 m long, that sags visibly.
struct Beam {
  Model model;
  ConstraintSystem system;
  Settings settings = samples::quick("node", 25);
  std::vector<glm::dvec3> equilibrium;
  double sag = 0;
  Beam() {
    TetMesh mesh = make_block({0.6, 0.1, 0.1}, {6, 1, 1});
    finish_tets(mesh, "beam");
    std::vector<std::uint32_t> fixed;
    for (std::uint32_t i = 0; i < mesh.positions.size(); ++i)
      if (mesh.positions[i].x < -0.29) fixed.push_back(i);
    add_body(model, "beam", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), fixed);
    settings.ground = false;
    settings.compliance[index_of<Stretch>] = 5e-5, settings.compliance[index_of<Bend>] = 1e-2,
    settings.compliance[index_of<Volume>] = 1e-8;
    system = build_constraints(model.rest, settings.constraints);
    const Compliances alpha = {settings.compliance[index_of<Stretch>], settings.compliance[index_of<Bend>],
                               settings.compliance[index_of<Volume>]};
    equilibrium =
        static_equilibrium({model, system, settings, model.inverse_masses}, model.positions, alpha).state.positions;
    sag = -tip(equilibrium);
  }
  // Height of the free end's middle.
  double tip(const std::vector<glm::dvec3>& x) const {
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < x.size(); ++i)
      if (model.positions[i].x > 0.29) sum += x[i].y - model.positions[i].y, ++count;
    return sum / count;
  }
  State at(const std::vector<glm::dvec3>& positions) const {
    State state{positions, std::vector<glm::dvec3>(positions.size())};
    for (std::size_t i = 0; i < positions.size(); ++i)
      if (model.inverse_masses[i] > 0) state.velocities[i].y = 0.5 * settings.gravity * plan_for(settings).h;
    return state;
  }
};

// The mean of the tip over a time from the reference's equilibrium, over the reference's sag; and the time
// between the first two passes of it when let go straight: half a period.
struct Swing {
  double sag, half_period;
};
template <class Step>  // steps a state
Swing swing(const Beam& beam, Step&& step) {
  State state = beam.at(beam.equilibrium);
  const double dt = beam.settings.dt;
  double low = 0, high = -1;
  for (double t = 0; t < 0.5; t += dt) {
    step(state);
    low = std::min(low, beam.tip(state.positions)), high = std::max(high, beam.tip(state.positions));
  }
  state = beam.at(beam.model.positions);
  double before = beam.sag, first = 0;
  for (double t = dt; t < 2; t += dt) {
    step(state);
    const double now = beam.tip(state.positions) + beam.sag;
    if ((now < 0) != (before < 0)) {
      const double crossing = t - dt + dt * before / (before - now);
      if (first > 0) return {-0.5 * (low + high) / beam.sag, crossing - first};
      first = crossing;
    }
    before = now;
  }
  return {};
}

}  // namespace

TEST_CASE("a spring takes the step of implicit Euler, damped or not, in one iteration or many") {
  for (const Sweep sweep : {Sweep::jacobi, Sweep::gauss_seidel})
    for (const double tau : {0.0, 0.03})
      for (const int iterations : {1, 4}) {
        CAPTURE(int(sweep));
        CAPTURE(tau);
        CAPTURE(iterations);
        const double mass = 0.7, alpha = 2e-4, stretched = 0.05, speed = 3;
        Spring spring(mass);
        Settings& s = spring.settings;
        s.compliance[index_of<Stretch>] = alpha, s.constraint_damping = tau, s.iterations = iterations, s.omega = 1;
        spring.state.positions[1].x += stretched, spring.state.velocities[1].x = speed;
        const double h = s.dt, inertia = mass / (h * h), k = 1 / alpha, c = tau / alpha / h;
        const double expected = (inertia * (stretched + h * speed) + c * stretched) / (inertia + k + c);
        CHECK(spring.step(sweep) == doctest::Approx(expected).epsilon(1e-12));
        CHECK(spring.state.velocities[1].x == doctest::Approx((expected - stretched) / h).epsilon(1e-10));
      }
}

TEST_CASE("a hanging mass stretches its spring by compliance times weight") {
  for (const int iterations : {1, 10})
    for (const int substeps : {1, 7}) {
      const double mass = 0.7, alpha = 2e-4;
      Spring spring(mass);
      Settings& s = spring.settings;
      s.compliance[index_of<Stretch>] = alpha, s.iterations = iterations, s.substeps = substeps, s.omega = 1;
      s.gravity = 9.81, s.damping = 30;
      spring.state.positions[1] = {0, -1, 0};
      double stretch = 0;
      for (int step = 0; step < 1000; ++step) stretch = spring.step(Sweep::jacobi);
      // Damping multiplies what gravity adds, too: the weight is less by a factor exp(-damping h).
      const double h = s.dt / substeps;
      CHECK(stretch == doctest::Approx(alpha * mass * s.gravity * std::exp(-s.damping * h)).epsilon(1e-9));
    }
}

TEST_CASE("constraint damping makes an oscillation decay at the rate of its dashpot") {
  // m u'' + (tau / alpha) u' + u / alpha = 0: u falls as exp(-w^2 tau t / 2). Implicit Euler's own damping is
  // that of tau = h.
  const double mass = 0.7, alpha = 2e-4, w = 1 / std::sqrt(alpha * mass), period = 2 * pi / w;
  for (const double tau : {0.0, 0.02 / w, 0.1 / w}) {
    Spring spring(mass);
    Settings& s = spring.settings;
    s.compliance[index_of<Stretch>] = alpha, s.constraint_damping = tau, s.iterations = 1, s.omega = 1;
    s.dt = period / 2000;
    spring.state.positions[1].x += 0.01;
    const double rate = w * w * (tau + s.dt) / 2;
    const double turning = std::sqrt(w * w - rate * rate);                     // of the damped oscillation
    const int half_life = int(std::log(2) / rate * turning / (2 * pi) + 0.5);  // in whole periods, at least 1
    const int periods = std::max(half_life, 1);
    const double time = periods * 2 * pi / turning;
    double now = 0, before = 0;
    for (double t = 0; t < time; t += s.dt) before = now, now = spring.step(Sweep::gauss_seidel);
    const double velocity = (now - before) / s.dt;  // u at the turning point is known to its square only
    CHECK(std::hypot(now, velocity / w) == doctest::Approx(0.01 * std::exp(-rate * time)).epsilon(0.01));
  }
}

TEST_CASE("constraint damping does not resist turning") {
  Spring spring(0.7);
  Settings& s = spring.settings;
  s.compliance[index_of<Stretch>] = 1e-7, s.constraint_damping = 0.1, s.iterations = 20;
  spring.state.velocities[1].y = 3;
  // A rate of grad C . (x - x at the start) would hold it 2 mm short: tau times half v^2 h.
  for (int step = 0; step < 200; ++step) CHECK(std::abs(spring.step(Sweep::gauss_seidel)) < 1e-4);
}

TEST_CASE("one GPU step with compliance is the double CPU step") {
  GlTest gl;
  for (const char* mode : {"node", "constraint"})
    for (const double tau : {0.0, 2e-3})
      for (const int iterations : {1, 4})
        for (glm::ivec3 cells : {glm::ivec3(1, 1, 1), glm::ivec3(4, 3, 2), glm::ivec3(8, 6, 4)}) {
          CAPTURE(mode);
          CAPTURE(tau);
          CAPTURE(iterations);
          CAPTURE(cells.x);
          Sim sim = create_sim(block_model(cells, -0.01, "stretch:1.1", {1, 3}), soft(mode, iterations, 3, tau));
          for (int s = 0; s < 3; ++s) step(sim);  // what the last step left must not matter
          const State expected = jacobi_after(sim), before = read_state(sim);
          step(sim);
          const State after = read_state(sim);
          CHECK(distance(after.positions, expected.positions) < 2e-6 * sim.model->size);
          CHECK(distance(after.velocities, expected.velocities) < 2e-3);
          CHECK(distance(after.positions, before.positions) > 1e-3);
        }
}

TEST_CASE("modes node and constraint give the same bits with compliance, however they are cut") {
  GlTest gl;
  const auto model = block_model({8, 6, 4}, 0.01, "stretch:1.1");
  for (const double tau : {0.0, 2e-3}) {
    std::uint64_t bits = 0;
    const auto check = [&](const char* mode, const Tuning& tuning) {
      CAPTURE(mode);
      CAPTURE(tuning.patch);
      Sim sim = create_sim(model, soft(mode, 3, 2, tau), tuning);
      for (int s = 0; s < 5; ++s) step(sim);
      if (!bits) bits = state_hash(sim);
      CHECK(state_hash(sim) == bits);
    };
    for (unsigned patch : {0, 1, 64}) check("constraint", {.patch = patch});
    for (unsigned patch : {0, 1, 7, 64}) check("node", {.patch = patch});
    check("node", {.group = 256, .patch = 200});
  }
}

TEST_CASE(
    "mode cpu-fast with compliance is Gauss-Seidel in double in the order of colours, as is mode cpu in "
    "theirs") {
  GlTest gl;
  for (const char* mode : {"cpu-fast", "cpu"})
    for (const char* deformation : {"stretch:1.1", "flatten"})  // guards trigger in the second
      for (const double tau : {0.0, 2e-3}) {
        CAPTURE(mode);
        CAPTURE(deformation);
        CAPTURE(tau);
        Sim sim = create_sim(block_model({8, 6, 4}, -0.01, deformation, {1, 3}), soft(mode, 4, 2, tau));
        ConstraintSystem system = sim.system;
        if (std::string(mode) == "cpu-fast")
          for (ConstraintList& list : system.lists) list = coloured(list, sim.model->positions.size()).list;
        CpuPbd<double> pbd(*sim.model, system);
        State state = read_state(sim);
        pbd.step(state, sim.settings, sim.inverse_masses, Sweep::gauss_seidel);
        step(sim);
        const bool flat = std::string(deformation) == "flatten";
        CHECK(distance(read_state(sim).positions, state.positions) < (flat ? 1e-3 : 1e-5));
      }
}

TEST_CASE("compliance and damping keep momentum") {
  GlTest gl;
  for (const char* mode : {"node", "constraint", "gauss-seidel", "cpu-fast"}) {
    CAPTURE(mode);
    Settings settings = soft(mode, 5, 2, 2e-3);
    settings.gravity = 0, settings.ground = false;
    Sim sim = create_sim(block_model({4, 3, 2}, 1, "stretch:1.2"), settings);
    const auto momentum = [&] {
      glm::dvec3 sum(0);
      const State state = read_state(sim);
      for (std::size_t i = 0; i < state.velocities.size(); ++i) sum += sim.model->masses[i] * state.velocities[i];
      return sum;
    };
    const glm::dvec3 before = momentum();
    for (int s = 0; s < 100; ++s) step(sim);
    CHECK(glm::length(momentum() - before) < 1e-3 * glm::length(before));
  }
}

// At a base where the solver converges, with 4 times the iterations, with 4 times the substeps and with twice
// dt it is the same beam. How it ends where iterations do not converge, sag and half a period over the
// reference's (dt 5 ms):
//   substeps x iterations   Gauss-Seidel   Jacobi
//   1 x 5                   1.08  1.12     does not come up within 2 s
//   1 x 25                  1.00  1.00     2.39  2.31
//   1 x 100                 1.00  1.00     1.18  1.22
//   10 x 1                  1.015 1.018    1.50  1.49
//   10 x 5 (base of G-S)    1.000 1.000    1.008 1.010
//   10 x 25 (Jacobi's)      1.000 1.000    1.000 1.000
//   40 x 1                  1.001 1.002    1.032 1.037
//   160 x 1                 1.000 1.001    1.002 1.003
TEST_CASE("a beam's sag and frequency are those of its compliance, whatever the settings") {
  GlTest gl;
  Beam beam;
  const auto set = [&](double dt, int substeps, int iterations) {
    beam.settings.dt = dt, beam.settings.substeps = substeps, beam.settings.iterations = iterations;
  };
  const ReferenceInput input{beam.model, beam.system, beam.settings, beam.model.inverse_masses};
  set(1e-3, 1, 1);
  const Swing reference = swing(beam, [&](State& state) {
    const Compliances alpha = {beam.settings.compliance[index_of<Stretch>], beam.settings.compliance[index_of<Bend>],
                               beam.settings.compliance[index_of<Volume>]};
    state = implicit_euler_step(input, state, alpha).state;
  });
  MESSAGE("sag " << 100 * beam.sag / 0.6 << " % of the length, implicit Euler's half period " << reference.half_period
                 << " s");
  const auto hold = [&](const std::string& mode, const Swing& found) {
    MESSAGE(mode << ", dt " << beam.settings.dt << " s, " << beam.settings.substeps << " substeps, "
                 << beam.settings.iterations << " iterations: sag " << found.sag << ", half a period "
                 << found.half_period / reference.half_period << " times the reference's");
    CHECK(found.sag == doctest::Approx(1).epsilon(0.01));
    CHECK(found.half_period == doctest::Approx(reference.half_period).epsilon(0.01));
  };
  for (const Sweep sweep : {Sweep::gauss_seidel, Sweep::jacobi}) {
    const std::string name = sweep == Sweep::jacobi ? "Jacobi" : "Gauss-Seidel";
    const auto measured = [&](double dt, int substeps, int iterations) {
      set(dt, substeps, iterations);
      CpuPbd<double> pbd(beam.model, beam.system);
      return swing(beam, [&](State& state) { pbd.step(state, beam.settings, beam.model.inverse_masses, sweep); });
    };
    const int base = sweep == Sweep::jacobi ? 25 : 5;
    hold(name, measured(5e-3, 10, base));
    hold(name, measured(5e-3, 10, 4 * base));
    hold(name, measured(5e-3, 40, base));
    hold(name, measured(1e-2, 10, base));
  }
  for (const auto& [mode, iterations] : {std::pair("node", 25), std::pair("cpu-fast", 5)}) {
    set(5e-3, 10, iterations);
    beam.settings.mode = mode;
    Sim sim = create_sim(std::make_shared<Model>(beam.model), beam.settings);
    hold(mode, swing(beam, [&](State& state) {
           if (state.positions == beam.equilibrium || state.positions == beam.model.positions) write_state(sim, state);
           step(sim);
           state = read_state(sim);
         }));
  }
}

TEST_CASE("without compliance nothing is different, and it comes and goes while running") {
  GlTest gl;
  const auto model = block_model({4, 3, 2}, 0.01, "stretch:1.1");
  const auto has = [](Sim& sim, const std::string& name) {
    for (const auto& buffer : explain(sim).buffers)
      if (buffer.name == name) return true;
    return false;
  };
  for (const char* mode : {"node", "constraint", "gauss-seidel", "cpu", "cpu-fast"}) {
    CAPTURE(mode);
    Settings hard = soft(mode, 3, 2);
    hard.compliance.fill(0);
    hard.constraints = "stretch,volume";
    Sim plain = create_sim(model, hard);
    Settings unused = hard;
    unused.compliance[index_of<Bend>] = 1;  // of a kind that is not there
    Sim sim = create_sim(model, unused);
    const std::size_t bytes = explain(plain).bytes;
    CHECK(explain(sim).bytes == bytes);
    step(plain), step(sim);
    CHECK(state_hash(sim) == state_hash(plain));

    const State before = read_state(sim);
    Settings softer = unused;
    softer.compliance[index_of<Stretch>] = 1e-6, softer.constraint_damping = 1e-3;
    apply_settings(sim, softer);
    if (!on_cpu(sim)) CHECK(has(sim, "multipliers"));
    CHECK(distance(read_state(sim).positions, before.positions) < 1e-12);
    step(sim);
    CHECK(distance(read_state(sim).positions, read_state(plain).positions) > 0);
    Sim fresh = create_sim(model, softer);
    write_state(fresh, before);
    step(fresh);
    CHECK(state_hash(fresh) == state_hash(sim));

    apply_settings(sim, hard);
    CHECK(!has(sim, "multipliers"));
    CHECK(explain(sim).bytes == bytes);
    write_state(sim, before), write_state(plain, before);
    step(sim), step(plain);
    CHECK(state_hash(sim) == state_hash(plain));
  }
  Settings paper = soft("paper", 1, 1);
  CHECK_THROWS_AS(create_sim(model, paper), Error);
}
