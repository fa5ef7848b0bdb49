// Bodies with materials and friction of their own: each moves as if it were alone with settings that have
// them.

#include "sim/measure/metrics.h"
#include "sim/model/material.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

namespace {

struct Made {
  const char* name;
  Material material;
  double friction;
};

Material of_model(const char* model, double young_modulus, double poisson_ratio, double damping) {
  Material m;
  m.material = model, m.young_modulus = young_modulus, m.poisson_ratio = poisson_ratio;
  m.constraint_damping = damping;
  return m;
}

// Of kinds, each with the compliance, and with k.
Material of_kinds(const char* kinds, double compliance, double k, double damping) {
  Material m;
  m.constraints = kinds, m.constraint_damping = damping;
  m.stiffness.fill(k), m.compliance.fill(compliance);
  return m;
}

const std::vector<Made>& soft_bodies() {
  static const std::vector<Made> all = {{"rubber", of_model("neo-hookean", 2e5, 0.4, 0), 0.1},
                                        {"damped", of_model("neo-hookean", 1e5, 0.3, 0.003), 0.9},
                                        {"springs", of_model("springs", 1e5, 0.3, 0.002), 0.0},
                                        {"kinds", of_kinds("stretch,volume", 2e-6, 1, 0), 0.4}};
  return all;
}
// And those that only corrections have.
std::vector<Made> all_bodies() {
  std::vector<Made> all = soft_bodies();
  all.push_back({"stiff", of_kinds("stretch,bend,volume", 0, 1, 0), 0.6});
  all.push_back({"half", of_kinds("stretch,volume", 0, 0.5, 0), 0.2});
  return all;
}

constexpr double apart = 4;  // m, from one to the next

void add(Model& model, const char* name, double at) {
  TetMesh mesh = make_block({1, 0.7, 0.5}, {3, 2, 2});
  generator.seed(5);
  for (auto& p : mesh.positions) p += noise(0.02);
  finish_tets(mesh, "block");
  std::vector<glm::dvec3> positions = mesh.positions;
  for (auto& p : positions) p = glm::dvec3(p.x + at, 1.05 * p.y + 0.4, p.z);
  add_body(model, name, mesh, 1000, positions, {0.6, -1, 0.2}, {0.1, 0.3, -0.2}, {});
}

std::shared_ptr<Model> together(const std::vector<Made>& bodies) {
  auto model = std::make_shared<Model>();
  for (std::size_t b = 0; b < bodies.size(); ++b) add(*model, bodies[b].name, apart * double(b));
  return model;
}
// With what each body has of its own.
Settings with_bodies(Settings settings, const std::vector<Made>& bodies) {
  for (const Made& body : bodies) settings.bodies.push_back({.material = body.material, .friction = body.friction});
  return settings;
}
std::shared_ptr<Model> alone(const Made& body, std::size_t number) {
  auto model = std::make_shared<Model>();
  add(*model, body.name, apart * double(number));
  return model;
}
Settings of_body(Settings settings, const Made& body) {
  settings.bodies.clear();
  static_cast<Material&>(settings) = body.material;
  settings.friction = body.friction;
  return settings;
}

// m, the farthest that a vertex of body b is from where it is alone.
double difference(const Model& model, std::size_t b, const State& state, const State& own) {
  double most = 0;
  for (std::size_t i = 0; i < own.positions.size(); ++i)
    most = std::max(most, glm::distance(state.positions[model.bodies[b].first_vertex + i], own.positions[i]));
  return most;
}

State part(const Model& model, std::size_t b, const State& state) {
  const Body& body = model.bodies[b];
  const auto first = state.positions.begin() + std::ptrdiff_t(body.first_vertex);
  return {{first, first + std::ptrdiff_t(body.vertices)}, {}};
}

Settings settings_for(const SolverMode& mode) {
  Settings settings;
  settings.mode = mode.name;
  settings.substeps = mode.implicit ? 4 : mode.leapfrog ? 60 : 10;
  settings.iterations = mode.implicit ? 12 : automatic;
  settings.friction = 0.3, settings.mass_splitting = true;
  return settings;
}

State run(Sim& sim, int steps) {
  for (int s = 0; s < steps; ++s) step(sim);
  return read_state(sim);
}

}  // namespace

TEST_CASE_FIXTURE(GlTest, "bodies: each has its material and its friction, in every mode (long)") {
  for (const SolverMode& mode : solver_modes()) {
    CAPTURE(std::string(mode.name));
    auto bodies = mode.forces ? soft_bodies() : all_bodies();
    // What sticks and what slips turns on the last bits there (a test of newton's contact has friction by body).
    for (Made& body : bodies)
      if (mode.implicit) body.friction = 0;
    const auto model = together(bodies);
    const Settings settings = settings_for(mode);
    Settings any = with_bodies(settings, bodies);  // its own material is of no body
    static_cast<Material&>(any) = of_model("neo-hookean", 3e4, 0.2, 0.01);
    const auto created = [&](const std::shared_ptr<const Model>& of, const Settings& with) {
      Sim sim = create_sim(of, with);
      if (mode.implicit) sim.adaptive.readback = {};  // the length of a substep is that of all bodies
      return sim;
    };
    Sim all = created(model, any);
    const State state = run(all, 40);
    const std::size_t every = is_long_run() ? 1 : 2;
    for (std::size_t b = mode.cpu ? 0 : every - 1; b < bodies.size(); b += every) {
      CAPTURE(std::string(bodies[b].name));
      Sim own = created(model, of_body(settings, bodies[b]));
      const double most = difference(*model, b, state, part(*model, b, run(own, 40)));
      CHECK(most < 1e-5);
    }
  }
}

TEST_CASE("bodies: the reference has each one's material and friction") {
  const auto& bodies = soft_bodies();
  const auto model = together(bodies);
  Settings settings = with_bodies({}, bodies);
  static_cast<Material&>(settings) = of_model("neo-hookean", 3e4, 0.2, 0.01);
  const ConstraintSystem system = build_constraints(*model, settings);
  const ReferenceInput input{*model, system, settings, model->inverse_masses};
  const State start{model->positions, model->velocities};
  const double h = 1e-4;
  Leapfrog explicit_run = leapfrog(input, reference_compliances(input), start, h);
  advance(explicit_run, 1000);
  const State state = make_state(explicit_run);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    CAPTURE(std::string(bodies[b].name));
    const auto own_model = alone(bodies[b], b);
    const Settings own_settings = of_body(settings, bodies[b]);
    const ConstraintSystem own_system = build_constraints(*own_model, own_settings);
    const ReferenceInput own{*own_model, own_system, own_settings, own_model->inverse_masses};
    Leapfrog run = leapfrog(own, reference_compliances(own), {own_model->positions, own_model->velocities}, h);
    advance(run, 1000);
    CHECK(difference(*model, b, state, make_state(run)) < 1e-9);
  }
}

TEST_CASE_FIXTURE(GlTest, "bodies: elastic energy is the sum of what each has alone") {
  const auto bodies = all_bodies();
  const auto model = together(bodies);
  const Settings settings = with_bodies(settings_for(*find_solver_mode("node")), bodies);
  const auto elastic = [](Sim& sim) {
    Metrics metrics = create_metrics(*sim.model, sim.system);
    measure(metrics, sim);
    return collect(metrics, true)->elastic;
  };
  Sim all = create_sim(model, settings);
  double sum = 0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Sim own = create_sim(alone(bodies[b], b), of_body(settings, bodies[b]));
    sum += elastic(own);
  }
  CHECK(sum > 1);
  CHECK(elastic(all) == doctest::Approx(sum).epsilon(1e-5));
}

TEST_CASE_FIXTURE(GlTest, "bodies: settings are of those without a material of their own, also live (long)") {
  const std::vector<Made> bodies = {soft_bodies()[0], soft_bodies()[3]};
  const auto model = together(bodies);
  for (const SolverMode& mode : solver_modes()) {
    CAPTURE(std::string(mode.name));
    Settings settings = with_bodies(of_body(settings_for(mode), bodies[1]), {bodies[0]});
    settings.bodies.emplace_back();
    Sim sim = create_sim(model, settings);
    run(sim, 2 * AdaptiveSubsteps::every);  // substeps adapt at every so many steps of the whole run
    settings.compliance.fill(8e-6), settings.friction = 0.7;
    apply_settings(sim, settings);
    Sim fresh = create_sim(model, settings);
    write_state(sim, {model->positions, model->velocities});
    write_state(fresh, {model->positions, model->velocities});
    const State changed = run(sim, 20), made = run(fresh, 20);
    CHECK(difference(*model, 0, changed, made) < 1e-9);
    CHECK(changed.positions == made.positions);
  }
}

TEST_CASE_FIXTURE(GlTest, "bodies: friction between two is the geometric mean of theirs (long)") {
  auto model = std::make_shared<Model>();
  add(*model, "below", 0), add(*model, "above", 0.1);
  for (std::size_t i = model->bodies[1].first_vertex; i < model->positions.size(); ++i)
    model->positions[i].y += 0.8, model->velocities[i] = {1, -2, 0};
  for (const char* name : {"node", "cpu-double", "newton"}) {
    CAPTURE(name);
    const SolverMode& mode = *find_solver_mode(name);
    Settings settings = of_body(settings_for(mode), soft_bodies()[0]);
    settings.contact = "bodies", settings.ground = false;
    const auto centre_after = [&](double world, std::optional<double> below, std::optional<double> above) {
      settings.bodies = {{.friction = below}, {.friction = above}};
      settings.friction = world;
      Sim sim = create_sim(model, settings);
      return run(sim, 30).velocities[model->bodies[1].first_vertex].x;
    };
    const double as_world = centre_after(0.6, {}, {}), as_bodies = centre_after(0, 0.9, 0.4);
    // What sticks turns on the last bits in newton.
    CHECK(as_bodies == doctest::Approx(as_world).epsilon(mode.implicit ? 1e-2 : 1e-3));
    CHECK(std::abs(centre_after(0, {}, {}) - as_world) > 1e-2);
  }
}

TEST_CASE_FIXTURE(GlTest, "bodies: each bounces off the ground, and off another, by its own restitution (long)") {
  auto model = std::make_shared<Model>();
  const TetMesh block = make_block(glm::dvec3(0.4), {2, 2, 2}, true);
  const auto add_block = [&](const glm::dvec3& at, const glm::dvec3& velocity) {
    auto start = block.positions;
    for (glm::dvec3& p : start) p += at;
    add_body(*model, "block", block, 1000, start, velocity, {}, {});
  };
  // Two that fall, far from each other; two that meet in the air.
  add_block({0, 0.45, 0}, {0, -2, 0}), add_block({3, 0.45, 0}, {0, -2, 0});
  add_block({6, 40, 0}, {1, 0, 0}), add_block({6.6, 40, 0}, {-1, 0, 0});
  for (const char* name : {"node", "constraint", "gauss-seidel", "cpu", "cpu-fast"}) {
    CAPTURE(std::string(name));
    Settings settings;
    settings.mode = name, settings.contact = "bodies", settings.substeps = 20;
    settings.bodies = {{.restitution = 0.9}, {.restitution = 0.3}, {.restitution = 1}, {.restitution = 0.49}};
    Sim sim = create_sim(model, settings);
    std::array<double, 2> up{};
    const auto mean = [&](const State& state, std::size_t b) {
      glm::dvec3 sum(0);
      const Body& body = model->bodies[b];
      for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v) sum += state.velocities[v];
      return sum / double(body.vertices);
    };
    for (int s = 0; s < 60; ++s) {
      step(sim);
      const State state = read_state(sim);
      for (std::size_t b = 0; b < 2; ++b) up[b] = std::max(up[b], mean(state, b).y);
    }
    const double hit = std::sqrt(4 + 2 * 9.81 * 0.25);
    CHECK(up[0] == doctest::Approx(0.9 * hit).epsilon(0.03));
    CHECK(up[1] == doctest::Approx(0.3 * hit).epsilon(0.05));
    const State end = read_state(sim);
    CHECK(mean(end, 3).x - mean(end, 2).x == doctest::Approx(2 * 0.7).epsilon(0.03));  // the geometric mean
  }
}

TEST_CASE_FIXTURE(GlTest, "bodies: a mode that cannot have a body's material says which body it is") {
  const auto model = together(all_bodies());
  Settings settings = with_bodies({}, all_bodies());
  settings.mode = "explicit", settings.material = "neo-hookean";
  CHECK_THROWS_WITH(create_sim(model, settings), doctest::Contains("body stiff"));
  Sim sim = create_sim(model, with_bodies(settings_for(*find_solver_mode("node")), all_bodies()));
  CHECK_THROWS_WITH(apply_settings(sim, settings), doctest::Contains("body stiff"));
  settings.mode = "paper", settings.material = "none";
  CHECK_THROWS_WITH(create_sim(model, settings), doctest::Contains("one material"));
}

namespace {

// A column along y of 2 cells across and 8 along, hung by its top; the lower half is region 1.
std::shared_ptr<Model> column(bool with_region) {
  auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block({0.2, 0.8, 0.2}, {2, 8, 2});
  VertexList top;
  // A weight at the lower end, beside which the column's own counts for nothing.
  std::vector<double> factors(mesh.positions.size(), 1e-3);
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    if (mesh.positions[v].y > 0.399) top.push_back(v);
    if (mesh.positions[v].y < -0.399) factors[v] = 1;
  }
  add_body(*model, "column", mesh, 1000, mesh.positions, {}, {}, top, factors);
  for (const Tet& tet : mesh.tets) {
    double y = 0;
    for (const std::uint32_t v : tet) y += mesh.positions[v].y / 4;
    if (with_region) model->regions.push_back(y < 0);
  }
  return model;
}

Settings pulled(double young_modulus) {
  Settings settings;
  settings.mode = "newton", settings.substeps = 1, settings.iterations = 24, settings.damping = 20;
  settings.dt = 0.01, settings.ground = false;
  settings.material = "neo-hookean", settings.young_modulus = young_modulus, settings.poisson_ratio = 0;
  return settings;
}

// Mean y of the vertices near a height at rest.
double height_at(const Model& model, const std::vector<glm::dvec3>& x, double y) {
  double sum = 0;
  int count = 0;
  for (std::size_t v = 0; v < x.size(); ++v)
    if (std::abs(model.rest.positions[v].y - y) < 1e-6) sum += x[v].y, ++count;
  return sum / count;
}

}  // namespace

TEST_CASE_FIXTURE(GlTest, "regions: two blocks in series are strained as theory says (long)") {
  const auto model = column(true);
  Settings settings = pulled(2e4);
  double weight = 0;
  for (std::size_t v = 0; v < model->masses.size(); ++v)
    if (model->inverse_masses[v] > 0) weight += model->masses[v];
  settings.gravity = 1e-3 * 2e4 * 0.04 / weight;  // a thousandth of strain in the soft half
  for (const std::string mode : {"newton", "explicit"}) {
    CAPTURE(mode);
    settings.mode = mode;
    if (!solver_mode(settings).implicit) settings.iterations = automatic, settings.substeps = 40;
    settings.bodies = {{.regions = {{.young_modulus = 2e6}}}};
    Sim sim = create_sim(model, settings);
    const State state = run(sim, 150);
    const double middle = height_at(*model, state.positions, 0), end = height_at(*model, state.positions, -0.4);
    CHECK(-middle / 0.4 == doctest::Approx(1e-3).epsilon(0.01));
    CHECK((middle - end - 0.4) / 0.4 == doctest::Approx(1e-5).epsilon(0.02));
    Metrics metrics = create_metrics(sim);
    const double half = 0.2 * 0.2 * 0.4;  // m^3
    CHECK(measure_now(metrics, sim).elastic == doctest::Approx(0.5 * half * (2e4 * 1e-6 + 2e6 * 1e-10)).epsilon(0.02));
    settings.bodies[0].regions[0].young_modulus = 2e5;  // live
    apply_settings(sim, settings);
    const State softer = run(sim, 150);
    const double now = height_at(*model, softer.positions, 0) - height_at(*model, softer.positions, -0.4);
    CHECK((now - 0.4) / 0.4 == doctest::Approx(1e-4).epsilon(0.02));
  }
}

TEST_CASE_FIXTURE(GlTest,
                  "regions: of the body's own moduli change nothing, and a whole body is a region of others (long)") {
  for (const std::string mode : {"newton", "explicit", "node", "constraint", "cpu"})
    for (const std::string material : {"neo-hookean", "springs"}) {
      CAPTURE(mode);
      CAPTURE(material);
      Settings settings = pulled(3e4);
      settings.mode = mode, settings.material = material, settings.poisson_ratio = 0.3;
      settings.constraint_damping = 1e-3;
      if (!solver_mode(settings).implicit) settings.iterations = settings.substeps = automatic;
      const auto moved = [&](const std::shared_ptr<const Model>& model) {
        Sim sim = create_sim(model, settings);
        return run(sim, 10).positions;
      };
      settings.bodies = {{.regions = {{.young_modulus = 3e4}}}};
      const auto without = moved(column(false));
      CHECK(moved(column(true)) == without);
      auto whole = std::make_shared<Model>(*column(true));
      std::ranges::fill(whole->regions, std::uint8_t(1));
      settings.young_modulus = 1e6;
      CHECK(moved(whole) == without);
    }
}

TEST_CASE("regions: what has none of a material's moduli is refused by name") {
  const auto model = column(true);
  Settings settings = pulled(1e4);
  settings.bodies = {{.regions = {{.poisson_ratio = 0.4}}}};
  check_settings(*model, settings);
  settings.element = "smoothed";
  CHECK_THROWS_WITH(check_settings(*model, settings), doctest::Contains("body column"));
  settings.element = "linear", settings.material = "none", settings.mode = "node";
  CHECK_THROWS_WITH(check_settings(*model, settings), doctest::Contains("the body has none"));
  settings.material = "springs", settings.poisson_ratio = 0.3;
  settings.bodies[0].regions[0].poisson_ratio = 0.1;
  CHECK_THROWS_WITH(check_settings(*model, settings), doctest::Contains("a region of body column"));
}
