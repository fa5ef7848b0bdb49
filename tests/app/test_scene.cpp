// Scenes are read strictly, and every shipped one builds and runs in every mode.
#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>

#include "app/scene.h"
#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/measure/metrics.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"

using namespace tetpbd;

namespace {

struct SceneFile {
  std::filesystem::path path;
  explicit SceneFile(const std::string& text, const std::string& ending = ".json")
      : path(std::filesystem::temp_directory_path() / ("tetpbd_scene_" + std::to_string(getpid()) + ending)) {
    std::ofstream(path) << text;
  }
  ~SceneFile() { std::filesystem::remove(path); }
};

std::string error_of(const std::string& text, const SceneOverrides& overrides = {}) {
  const SceneFile file(text);
  try {
    build_model(load_scene(file.path.string(), overrides));
  } catch (const Error& error) {
    CHECK(error.exit_status == 2);
    return error.what();
  }
  return "";
}

const std::string block = R"("bodies": [{"block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "position": [0, 1, 0]}])";

bool has(const std::string& text, const std::string& word) { return text.find(word) != std::string::npos; }

}  // namespace

TEST_CASE("scenes that ask for too much are refused") {
  std::string deep = "1";
  for (int i = 0; i < 40; ++i) deep = "[" + deep + "]";
  CHECK(has(error_of("{" + block + ", \"duration\": " + deep + "}"), "nested too deeply"));
  SceneOverrides overrides;
  overrides.set = {"duration=" + deep};
  CHECK(has(error_of("{" + block + "}", overrides), "nested too deeply"));
  std::string path = "a";
  for (int i = 0; i < 40; ++i) path += ".a";
  overrides.set = {path + "=1"};
  CHECK(has(error_of("{" + block + "}", overrides), "no key needs"));
  CHECK(has(error_of("{" + block + ", \"description\": \"" + std::string(1 << 20, 'x') + "\"}"), "too large"));
  std::string boxes, bodies;
  for (int i = 0; i < 101; ++i) boxes += std::string(i ? "," : "") + R"({"low": [0, 0, 0]})";
  CHECK(has(error_of(R"({"bodies": [{"block": {"cells": [1, 1, 1]}, "fixed": [)" + boxes + "]}]}"), "100 boxes"));
  CHECK(load_scene(SceneFile("{" + block + R"(, "name": "a\n\u001b[2J"})").path.string()).name == "a??[2J");
}

TEST_CASE("wrong scenes are refused with the key and what is allowed") {
  CHECK(error_of("{" + block + "}") == "");
  CHECK(has(error_of("{" + block), "not valid JSON"));
  CHECK(has(error_of("[]"), "object"));
  CHECK(has(error_of("{}"), "'bodies'"));
  CHECK(has(error_of(R"({"bodies": []})"), "'bodies'"));
  CHECK(has(error_of("{" + block + R"(, "sover": {}})"), "'sover' is not known"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"omga": 1}})"), "'solver.omga' is not known"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"omega": 9}})"), "from 0 to 4"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"omega": "big"}})"), "'omega' cannot be big"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"iterations": 2.5}})"), "'iterations'"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"mode": "magic"}})"), "node, constraint, gauss-seidel, cpu"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"constraints": ["stretch", "twist"]}})"), "stretch, bend, volume"));
  CHECK(has(error_of("{" + block + R"(, "solver": {"constraints": ["stretch", "stretch"]}})"), "once"));
  CHECK(has(error_of("{" + block + R"(, "world": {"gravity": null}})"), "'gravity'"));
  CHECK(has(error_of("{" + block + R"(, "world": {"obstacles": [{"point": [0,0,0], "normal": [0,0,0]}]}})"), "normal"));
  CHECK(has(error_of("{" + block + R"(, "camera": {"fov": 1}})"), "camera.fov"));
  CHECK(has(error_of("{" + block + R"(, "duration": -1})"), "duration"));
  CHECK(has(error_of(R"({"bodies": [{"block": {"size": [1, 1], "cells": [2, 2, 2]}}]})"), "three numbers"));
  CHECK(has(error_of(R"({"bodies": [{"block": {"cells": [2, 2, 0]}}]})"), "block.cells"));
  CHECK(has(error_of(R"({"bodies": [{"block": {"cells": [2000, 2000, 2000]}}]})"), "2 million"));
  CHECK(has(error_of(R"({"bodies": [{}]})"), "needs one of"));
  CHECK(has(error_of(R"({"bodies": [{"mesh": "bunny.ply", "block": {}}]})"), "needs one of"));
  CHECK(has(error_of(R"({"bodies": [{"mesh": "no_such.ply"}]})"), "no_such.ply"));
  CHECK(has(error_of(R"({"bodies": [{"mesh": "bunny.ply", "height": 0}]})"), "height"));
  CHECK(has(error_of(R"({"bodies": [{"mesh": "bunny.ply", "colour": 1}]})"), "'bodies.0.colour' is not known"));
}

TEST_CASE("the command line overrides, and its errors name the flag") {
  const std::string scene = "{" + block + "}";
  const SceneFile file(scene);
  SceneOverrides overrides;
  overrides.parameters = {{"omega", "1.25"}, {"constraints", "stretch"}};
  overrides.set = {"bodies.0.density=500", "world.friction=0.1", "name=other"};
  overrides.deform = "flatten";
  const Scene opened = load_scene(file.path.string(), overrides);
  CHECK(opened.settings.omega == 1.25);
  CHECK(opened.settings.constraints == "stretch");
  CHECK(opened.settings.friction == 0.1);
  CHECK(opened.bodies[0].density == 500);
  CHECK(opened.name == "other");
  const auto model = build_model(opened);
  for (const auto& p : model->positions) CHECK(p.y == doctest::Approx(1.5));
  CHECK(mesh_volume(model->rest) == doctest::Approx(1));

  CHECK(has(error_of(scene, {.parameters = {{"omega", "x"}}}), "--omega"));
  CHECK(has(error_of(scene, {.parameters = {{"dt", "nan"}}}), "--dt"));
  CHECK(has(error_of(scene, {.parameters = {{"iterations", "1e3"}}}), "--iterations"));
  CHECK(has(error_of(scene, {.set = {"nonsense"}}), "PATH=VALUE"));
  CHECK(has(error_of(scene, {.set = {"bodies.7.density=1"}}), "bodies.7"));
  CHECK(has(error_of(scene, {.set = {"bodies.0.density=-1"}}), "density"));
  CHECK(has(error_of(scene, {.deform = "melt"}), "--deform melt"));
  CHECK(has(error_of(scene, {.deform = "stretch:0"}), "factor"));
  CHECK_THROWS_AS(load_scene("no-such-scene"), Error);
}

TEST_CASE("several bodies touch each other unless the scene or a flag says otherwise") {
  const std::string cube = R"({"block": {"size": [1, 1, 1], "cells": [1, 1, 1]}, "position": [0, 1, 0]})",
                    two = R"({"bodies": [)" + cube + "," + cube;
  const auto contact = [](const std::string& text, const SceneOverrides& overrides = {}) {
    return load_scene(SceneFile(text).path.string(), overrides).settings.contact;
  };
  CHECK(contact(two + "]}") == "bodies");
  CHECK(contact("{" + block + "}") == "none");
  CHECK(contact(two + R"(], "world": {"contact": "none"}})") == "none");
  CHECK(contact(two + R"(], "world": {"contact": "self"}})") == "self");
  CHECK(contact(two + R"(], "world": {"restitution": 0.5}})") == "bodies");
  CHECK(contact(two + "]}", {.parameters = {{"contact", "none"}}}) == "none");
  CHECK(contact(two + "]}", {.set = {"world.contact=none"}}) == "none");
}

TEST_CASE("a scene of a lattice takes TetGen from the command line, and the size of the lattice goes") {
  const BodyDescription shipped = load_scene("jelly-bunny").bodies[0];
  CHECK(shipped.fill == "lattice");
  CHECK(shipped.tets == 24000);
  for (const char* other : {"tetgen", "auto"}) {
    const BodyDescription body = load_scene("jelly-bunny", {.fill = other}).bodies[0];
    CHECK(body.fill == other);
    CHECK_FALSE((body.tets || body.spacing));
  }
  CHECK(load_scene("jelly-bunny", {.fill = "lattice"}).bodies[0].tets == 24000);
  CHECK(load_scene("jelly-bunny", {.mesh = "another.ply"}).bodies[0].fill == "auto");
  CHECK(load_scene("jelly-bunny", {.fill = "lattice", .spacing = 0.1}).bodies[0].spacing == 0.1);
}

TEST_CASE("a fixed side of a box that a lattice fills is all of that side") {
  const SceneFile cube(
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
      "f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 4 8 7\nf 4 7 3\n"
      "f 1 5 8\nf 1 8 4\nf 2 3 7\nf 2 7 6\n",
      ".obj");
  Scene scene = load_scene("clamped-bunny", {.fill = "lattice"});
  scene.bodies[0].mesh = cube.path, scene.bodies[0].tets = 1000;
  scene.bodies[0].fixed = {{{{0, 0, 0}, {1, 0, 1}}}};
  const auto model = build_model(scene);
  glm::dvec3 low(1e9), high(-1e9);
  for (std::size_t i = 0; i < model->positions.size(); ++i) {
    if (model->inverse_masses[i] > 0) continue;
    CHECK(model->rest.positions[i].y < 0.1);
    low = glm::min(low, model->rest.positions[i]), high = glm::max(high, model->rest.positions[i]);
  }
  CHECK(high.x - low.x > 0.8);
  CHECK(high.z - low.z > 0.8);
  CHECK(std::ranges::count(model->inverse_masses, 0.0) > 16);
}

TEST_CASE("every deformation does what it says and leaves the rest shape") {
  const TetMesh mesh = make_block({1, 2, 1}, {3, 3, 3});
  const auto volume_of = [&](const std::vector<glm::dvec3>& x, int& inverted) {
    TetMesh copy = mesh;
    copy.positions = x;
    double sum = 0;
    inverted = 0;
    for (const Tet& t : copy.tets) sum += tet_volume(copy, t), inverted += tet_volume(copy, t) < 0;
    return sum;
  };
  const auto deformed = [&](const char* how) {
    auto x = mesh.positions;
    deform(x, mesh, how, 3);
    return x;
  };
  int inverted = 0;
  CHECK(volume_of(deformed("none"), inverted) == doctest::Approx(2));
  CHECK(volume_of(deformed("stretch:10"), inverted) == doctest::Approx(20));
  CHECK(volume_of(deformed("squash:0.01"), inverted) == doctest::Approx(0.02));
  CHECK(volume_of(deformed("mirror"), inverted) == doctest::Approx(-2));
  CHECK(inverted == int(mesh.tets.size()));
  CHECK(volume_of(deformed("flatten"), inverted) == doctest::Approx(0));
  CHECK(bounds(deformed("flatten")).size() > 1);
  CHECK(bounds(deformed("line")).high.z - bounds(deformed("line")).low.z == 0);
  CHECK(bounds(deformed("point")).size() == 0);
  volume_of(deformed("invert-one"), inverted);
  CHECK(inverted >= 1);
  CHECK(deformed("random") == deformed("random"));
  const auto jittered = deformed("jitter:0.1");
  CHECK(volume_of(jittered, inverted) == doctest::Approx(2));  // moved and turned, not deformed
  CHECK(inverted == 0);
  const double size = bounds(mesh.positions).size(),
               moved = glm::distance(bounds(jittered).centre(), bounds(mesh.positions).centre());
  CHECK(moved > 0.001 * size);
  CHECK(moved < 0.2 * size);
  CHECK(glm::length(glm::normalize(jittered[1] - jittered[0]) - glm::normalize(mesh.positions[1] - mesh.positions[0])) >
        1e-3);
  CHECK(bounds(deformed("random")).size() <= bounds(mesh.positions).size());
}

TEST_CASE("fixed boxes, several bodies, transforms and obstacles build") {
  const SceneFile file(R"({"bodies": [
    {"block": {"size": [2, 1, 1], "cells": [2, 1, 1]}, "position": [0, 1, 0], "fixed": [{"low": [0, 0, 0], "high": [0, 1, 1]}]},
    {"block": {"size": [1, 1, 1], "cells": [1, 1, 1]}, "height": 3, "rotation": [0, 0, 90], "position": [4, 2, 0], "velocity": [1, 0, 0], "spin": [0, 2, 0]}],
    "world": {"obstacles": [{"point": [-3, 0, 0], "normal": [2, 0, 0]}]}})");
  const auto model = build_model(load_scene(file.path.string()));
  CHECK(model->bodies.size() == 2);
  const auto moved = [&](int seed) {  // each body by its own numbers
    const auto other = build_model(
        load_scene(file.path.string(), {.deform = "jitter:0.1", .set = {"solver.seed=" + std::to_string(seed)}}));
    std::vector<glm::dvec3> ways;
    for (const Body& body : other->bodies)
      ways.push_back(other->positions[body.first_vertex] - model->positions[body.first_vertex]);
    return ways;
  };
  CHECK(moved(1) == moved(1));
  CHECK(moved(1)[0] != moved(2)[0]);
  CHECK(moved(1)[0] != moved(1)[1]);
  int fixed = 0;
  for (double w : model->inverse_masses) fixed += w == 0;
  CHECK(fixed == 4);
  const std::vector<glm::dvec3> second(model->positions.begin() + std::ptrdiff_t(model->bodies[1].first_vertex),
                                       model->positions.end());
  CHECK(bounds(second).low.y == doctest::Approx(2));
  CHECK(bounds(second).high.y == doctest::Approx(5));
  CHECK(bounds(second).centre().x == doctest::Approx(4));
  CHECK(obstacles_at(*model, Settings{}, 0).back().plane == glm::dvec4(1, 0, 0, -3));
  glm::dvec3 momentum(0);
  double mass = 0;
  for (std::size_t i = model->bodies[1].first_vertex; i < model->positions.size(); ++i)
    momentum += model->masses[i] * model->velocities[i], mass += model->masses[i];
  CHECK(glm::length(momentum / mass - glm::dvec3(1, 0, 0)) < 1e-9);
}

TEST_CASE("every shipped scene runs in every mode") {
  GlTest gl;
  CHECK(scene_names() ==
        std::vector<std::string>{"armadillo-drop", "balloon",     "beads",        "beam",           "bowl",
                                 "bowl-32",        "bunny",       "bunny-drop",   "cards",          "chain",
                                 "clamped-bunny",  "clay",        "cloth-heap",   "cloth-on-bunny", "dragon-drop",
                                 "folded-ears",    "funnel",      "gripper",      "hard-stack",     "hung-armadillo",
                                 "jelly-beam",     "jelly-bunny", "knot",         "layers",         "mixed",
                                 "muscle",         "muscle-arm",  "press",        "press-cloth",    "ring",
                                 "rollers",        "sewn-bag",    "soft-beam",    "spikes",         "squishy-balls",
                                 "stack",          "stairs",      "twisted-beams"});
  std::map<std::string, int> runs;
  for (const SolverMode& mode : pbd_modes()) runs[mode.name] = 0;
  for (const std::string& name : scene_names()) {
    CAPTURE(name);
    if (name == "bowl-32" && !is_long_run()) continue;
    const auto model = build_model(load_scene(name));
    if (model->rest.tets.size() > 12000 && !is_long_run()) continue;
    // The long suite takes all pairs, the short one each scene but the large ones in the mode that has had fewest.
    auto modes = pbd_modes();
    std::ranges::stable_sort(modes, {}, [&](const SolverMode& mode) { return runs.at(mode.name); });
    bool taken = false;
    for (const SolverMode& mode : modes) {
      if (taken && !is_long_run()) break;
      CAPTURE(std::string(mode.name));
      std::map<std::string, std::string> parameters = {{"mode", mode.name}, {"iterations", "2"}, {"substeps", "4"}};
      if (!mode.compliance && (name == "cloth-on-bunny" || name == "mixed")) continue;  // it needs some
      if (name == "muscle-arm") {  // corrections need short substeps for bones, and Jacobi shorter ones
        if (!mode.cpu) continue;
        parameters["iterations"] = "1", parameters["substeps"] = "40";
      }
      if (mode.published && !(model->attachments.empty() && model->loads.empty())) continue;
      if (mode.name != std::string("node") && name == "bowl-32") continue;  // large
      taken = true, ++runs.at(mode.name);
      const Scene scene = load_scene(name, {.parameters = {parameters.begin(), parameters.end()}});
      Sim sim = create_sim(model, scene.settings);
      for (int s = 0; s < (is_long_run() ? 4 : 2); ++s) step(sim);
      Metrics metrics = create_metrics(*model, sim.system);
      const Measurement m = measure_now(metrics, sim);
      CHECK(m.finite());
      CHECK(m.kinetic > 0);
      // two iterations of a solver by rates leave stiff bodies that press each other a tenth smaller
      CHECK(std::abs(m.volume_error_percent) < (scene.settings.contact == "none" ? 5 : 10));
    }
    CHECK(taken);
  }
  for (const auto& [mode, times] : runs) CHECK_MESSAGE(times >= 3, mode);
}

TEST_CASE("every hard case opens, and says what it is") {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(models_folder() / "scenes/hard")) {
    CAPTURE(entry.path());
    Scene scene = load_scene("hard/" + entry.path().stem().string());
    CHECK(scene.name == "hard/" + entry.path().stem().string());
    CHECK(scene.description.size() > 10);
    if (!scene.bodies[0].block && !scene.bodies[0].tet) scene.bodies[0].block = {{0.8, 1, 0.6}, {3, 4, 2}};
    const auto model = build_model(scene);
    CHECK(model->positions.size() >= 4);
    ++count;
  }
  CHECK(count >= 40);
}

TEST_CASE("scenes of other programs have their sizes, masses and stiffness") {
  const auto check = [](const char* name, std::size_t tets, double mass, double young_modulus) {
    CAPTURE(std::string(name));
    const Scene scene = load_scene(std::string("published/") + name);
    const auto model = build_model(scene);
    CHECK(model->rest.tets.size() == tets);
    CHECK(std::accumulate(model->masses.begin(), model->masses.end(), 0.0) == doctest::Approx(mass).epsilon(1e-3));
    CHECK(material_of(scene.settings, scene.bodies.size() - 1).young_modulus == young_modulus);
  };
  check("sofa-beam", 39 * 9 * 9 * 6, 50, 2000);
  check("sofa-beam-fine", 75 * 15 * 15 * 6, 50, 1000);
  check("newton-beams", 4 * 12 * 4 * 4 * 6, 4 * 1000 * 1.2 * 0.4 * 0.4, 2.5e5);
}

TEST_CASE("a body as JSON reads back as the same body, and a setting that is no list takes none") {
  const std::string heavy = R"([{"low": [0, 0.6, 0], "high": [1, 1, 1], "ratio": 100.0, "share": 0.5}])";
  const std::string tet = R"([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])";
  for (const std::string& body :
       std::vector<std::string>{R"("block": {"size": [1, 2, 3], "cells": [2, 1, 1]}, "spin": [0, 2, 0])",
                                R"("mesh": "bunny.ply", "height": 2)", R"("tet": )" + tet}) {
    const SceneFile file("{\"bodies\": [{" + body + ", \"fixed\": [{\"low\": [0, 0, 0]}], \"heavy\": " + heavy + "}]}");
    const auto written = body_json(load_scene(file.path.string()).bodies[0]).dump();
    const SceneFile again("{\"bodies\": [" + written + "]}");
    CHECK(body_json(load_scene(again.path.string()).bodies[0]).dump() == written);
  }
  CHECK(has(error_of("{" + block + R"(, "solver": {"omega": [1]}})"), "'omega' cannot be [1]"));
  CHECK(has(error_of("{" + block + "}", {.set = {"bodies.0.block.cells.x=1"}}), "bodies.0.block.cells.x"));
}

TEST_CASE("scale, heavy vertices and a single tet") {
  const auto model = [](const std::string& body) {
    const auto file = std::filesystem::temp_directory_path() / ("tetpbd_heavy_" + std::to_string(getpid()) + ".json");
    std::ofstream(file) << "{\"bodies\": [" << body << "]}";
    const auto result = build_model(load_scene(file.string()));
    std::filesystem::remove(file);
    return result;
  };
  const auto plain = model(R"({"block": {"size": [1, 1, 1], "cells": [2, 2, 2]}})");
  const auto heavy = model(
      R"({"block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "heavy": [{"low": [0, 0.6, 0], "high": [1, 1, 1], "ratio": 100}]})");
  for (std::size_t i = 0; i < plain->masses.size(); ++i) {
    const double factor = plain->positions[i].y > 0.6 ? 100 : 1;
    CHECK(heavy->masses[i] == doctest::Approx(factor * plain->masses[i]));
    CHECK(heavy->inverse_masses[i] == doctest::Approx(1 / heavy->masses[i]));
  }
  const auto flat = model(R"({"block": {"size": [1, 1, 1], "cells": [1, 1, 1]}, "scale": [2, 0.5, 1]})");
  const Bounds box = bounds(flat->positions);
  CHECK(glm::length(box.high - box.low - glm::dvec3(2, 0.5, 1)) < 1e-12);
  const auto tet = model(R"({"tet": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]})");
  CHECK(tet->rest.tets.size() == 1);
  CHECK(mesh_volume(tet->rest) == doctest::Approx(1.0 / 6));
}
