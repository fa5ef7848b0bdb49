// Lattices: what TetGen cannot fill, or fills badly; cavities.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <tuple>

#include "app/commands.h"
#include "app/scene.h"
#include "sim/interrupt.h"
#include "sim/mesh/carry.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/fill.h"
#include "sim/mesh/solid.h"
#include "sim/model/material.h"
#include "tests/app/run_program.h"
#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

namespace {

const FillOptions coarse{.size = {2000, 0}};

}  // namespace

TEST_CASE("lattice: every defect ends as a body that carries the surface") {
  const Folder folder;
  SurfaceMesh s = cube({3, 0, 0});
  const auto count = [&] { return std::uint32_t(s.positions.size()); };
  std::string why;
  double volume = 1;
  int parts = 1;
  SUBCASE("open") {
    s.triangles.pop_back();
    why = "surface is open: 3 edges with one triangle only";
  }
  SUBCASE("doubled") {
    s.triangles.push_back(s.triangles[0]);
    why = "triangles appear more than once: 1 too many";
  }
  SUBCASE("no area") {
    s.positions.push_back((s.positions[0] + s.positions[1]) * 0.5);
    s.triangles.push_back({0, 1, 8});
    why = "triangles have no area: 1 triangle";
  }
  SUBCASE("three triangles at an edge") {
    s.positions.push_back({4.5, 1.5, 0.5});
    s.triangles.push_back({3, 7, count() - 1});
    why = "edges have more than two triangles: 1 edge";
  }
  SUBCASE("parts that touch in a vertex") {
    SurfaceMesh other = cube({4, 1, 1});
    s = joined(s, other);
    weld(s, 1e-9);
    volume = 2, parts = 2;
    why = "parts of the surface touch in single vertices: 1 vertex";
  }
  SUBCASE("it intersects itself") {
    s = joined(s, cube({3.5, 0.3, 0.2}));
    volume = 2 - 0.5 * 0.7 * 0.8;
    why = "surface intersects itself: ";
  }
  const Filled filled = fill(s, coarse, "bad.obj");
  CHECK(contains(filled.note, why));
  CHECK(contains(filled.note, fmt::format(", so a lattice of {} tets fills it", filled.mesh.tets.size())));
  CHECK(std::abs(double(filled.mesh.tets.size()) - 2000) < 350);
  const MeshReport counts = report(filled.mesh);
  CHECK(counts.inverted == 0);
  CHECK(counts.components == parts);
  CHECK(counts.min_dihedral_deg > 20);
  CHECK(filled_volume(filled.mesh) == doctest::Approx(volume).epsilon(0.03));
  const double size = bounds(s.positions).size();
  const auto positions = carried_positions(filled.carried, filled.mesh.tets, filled.mesh.positions);
  for (std::size_t v = 0; v < positions.size(); ++v) CHECK(glm::distance(positions[v], s.positions[v]) < 1e-6 * size);
  const Filled again = fill(s, coarse, "bad.obj");
  CHECK(again.note == filled.note);
  CHECK(again.mesh.positions == filled.mesh.positions);
  CHECK(again.mesh.fill == filled.mesh.fill);
  CHECK(again.carried.triangles == filled.carried.triangles);
  CHECK(contains(error_of([&] { fill(s, {.by = "tetgen"}, "bad.obj"); }), why));
}

TEST_CASE("lattice: what encloses nothing is refused, a hole is closed") {
  const Folder folder;
  CHECK(fill(cube(), {}, "cube.obj").note == "");
  SurfaceMesh lost = cube();
  lost.positions[3].x = NAN;
  CHECK(contains(error_of([&] { fill(lost, coarse, "lost.obj"); }),
                 "2 positions are not finite numbers: 1 vertex, first vertex 3 in lost.obj: "));
  CHECK(contains(error_of([&] { fill(rectangle(2, 1), coarse, "flat.obj"); }), "encloses nothing"));
  CHECK(contains(error_of([&] { fill({}, coarse, "nothing.obj"); }), "nothing.obj"));
  SurfaceMesh plate = cube();
  for (glm::dvec3& p : plate.positions) p.y *= 1e-3;
  CHECK(contains(error_of([&] {
                   fill(plate, {.by = "lattice", .size = {1000, 0}}, "plate.obj");
                 }),
                 "half of the body is thinner than an eighth of a cell: 0.001 m of"));
  SurfaceMesh scan = sphere(20);
  scan.triangles.resize(scan.triangles.size() - 30);  // a small hole does not make it hollow
  CHECK(filled_volume(fill(scan, coarse, "scan.obj").mesh) == doctest::Approx(4.18).epsilon(0.04));
  FillOptions fine{.by = "lattice", .size = {.spacing = 1e-5}};
  const std::string refused = error_of([&] { fill(cube(), fine, "cube.obj"); });
  CHECK(contains(refused, "2 a lattice with a spacing of 1e-05 m is too fine: it has 1e+15 points, of at most 1e+09"));
  CHECK(contains(refused, "give a spacing of 0.0"));
}

TEST_CASE("lattice: parts that are nearer than a cell stay apart, those that overlap become one") {
  const Folder folder;
  const auto of_two = [&](double apart) { return joined(cube(), cube({1 + apart, 0.13, 0.21})); };
  const Filled near = fill(of_two(1e-3), {.by = "lattice", .size = {3000, 0}}, "near.obj");
  CHECK(report(near.mesh).components == 2);
  CHECK(contains(near.note, "in 2 parts"));
  CHECK(filled_volume(near.mesh) == doctest::Approx(2).epsilon(1e-6));
  // Each half of the surface rides on its own part.
  DisjointSets parts(near.mesh.positions.size());
  for (const Tet& t : near.mesh.tets)
    for (const std::uint32_t v : t) parts.join(t[0], v);
  const auto part = [&](std::size_t v) { return parts.root(near.mesh.tets[near.carried.vertices[v].tet][0]); };
  for (std::size_t v = 0; v < 16; ++v) CHECK(part(v) == part(v < 8 ? 0 : 8));
  CHECK(part(0) != part(8));
  CHECK(report(fill(of_two(-0.1), {.by = "lattice", .size = {3000, 0}}, "joined.obj").mesh).components == 1);
}

TEST_CASE("lattice: mass and stiffness are of what the body fills") {
  const Folder folder;
  const SurfaceMesh ball = sphere(24);
  const Filled filled = fill(ball, {.by = "lattice", .size = {6000, 0}}, "ball.obj");
  SurfaceMesh copy = ball;
  const double volume = check_surface(copy).volume;
  CHECK(filled_volume(filled.mesh) == doctest::Approx(volume).epsilon(1e-6));
  CHECK(mesh_volume(filled.mesh) < 1.06 * volume);
  double mass = 0;
  for (const double m : lumped_masses(filled.mesh, 500)) mass += m;
  CHECK(mass == doctest::Approx(500 * volume).epsilon(1e-6));
  // Stretched alike everywhere, the body stores the energy of its own volume.
  Material material;
  material.material = "neo-hookean", material.young_modulus = 1e5, material.poisson_ratio = 0.3;
  const ConstraintSystem system = build_constraints(filled.mesh, material);
  const ConstraintList& tets = system.lists[index_of<NeoHookean>];
  for (std::size_t t = 0; t < 50; ++t) {
    TetMesh full = filled.mesh;
    full.fill.clear();
    const auto whole = build_constraints(full, material).lists[index_of<NeoHookean>].compliance[2 * t];
    CHECK(tets.compliance[2 * t] * fill_of(filled.mesh, t) == doctest::Approx(whole));
    if (t == 0) CHECK(tets.count() == full.tets.size());
    if (t > 3) break;
  }
  // The outer vertices lie on the surface, but where that would flatten tets.
  const Outward outward = turn_outward(ball);
  const Solid solid(outward.surface);
  double sum = 0, count = 0;
  for (const Triangle& t : filled.mesh.surface)
    for (const std::uint32_t v : t) sum += std::pow(solid.nearest(filled.mesh.positions[v]).distance, 2), ++count;
  CHECK(std::sqrt(sum / count) < 0.04);
  CHECK(flattest_tet(filled.mesh).quality > 0.45);
}

TEST_CASE("cavities: nested parts are hollow, whichever way they are turned, and solid again within") {
  const Folder folder;
  SurfaceMesh inner = cube(glm::dvec3(0.25), 0.5);
  for (const bool turned : {false, true}) {
    CAPTURE(turned);
    if (turned)
      for (Triangle& t : inner.triangles) std::swap(t[0], t[1]);
    SurfaceMesh hollow = joined(cube(), inner);
    const SurfaceCheck check = check_surface(hollow);
    CHECK(check.defect == "");
    CHECK(check.volume == doctest::Approx(0.875));
    CHECK(check.cavities.size() == 1);
    CHECK((check.flipped_triangles > 0) == !turned);
    CHECK(mesh_volume(tetrahedralise(hollow, "pYq1.85o/140")) == doctest::Approx(0.875));
    const Filled filled = fill(hollow, {.by = "lattice", .size = {4000, 0}}, "hollow.obj");
    CHECK(filled.cavities == 1);
    CHECK(filled_volume(filled.mesh) == doctest::Approx(0.875).epsilon(1e-6));
    const SurfaceMesh with_core = joined(hollow, cube(glm::dvec3(0.4), 0.2));
    CHECK(mesh_volume(tetrahedralise(with_core, "pYq1.85o/140")) == doctest::Approx(0.883));
    const Filled core = fill(with_core, {.by = "lattice", .size = {12000, 0}}, "core.obj");
    CHECK(filled_volume(core.mesh) == doctest::Approx(0.883).epsilon(1e-6));
    CHECK(report(core.mesh).components == 2);
  }
}

TEST_CASE("files of tets: a soft body's boundary is filled anew where a tet is far too flat, or if asked") {
  const Folder folder;
  const TetMesh sound = make_block(glm::dvec3(1), glm::ivec3(3));
  TetMesh mesh = sound;  // a vertex in its tet 5, close to the face opposite to the last corner, makes four of it
  const Tet t = mesh.tets[5];
  const auto at = [&](std::size_t k) { return mesh.positions[t[k]]; };
  mesh.positions.push_back((at(0) + at(1) + at(2)) / 3.0 + 1e-3 * (at(3) - at(0)));
  const auto middle = std::uint32_t(mesh.positions.size() - 1);
  for (std::size_t k = 0; k < 3; ++k) mesh.tets.push_back(t), mesh.tets.back()[k] = middle;
  mesh.tets[5][3] = middle;
  finish_tets(mesh, "block");
  CHECK(too_flat(sound).empty());
  CHECK(contains(too_flat(mesh), "tet 5 near ("));
  write_mesh(folder.path / "flat.msh", mesh);
  write_mesh(folder.path / "sound.msh", sound);
  write_mesh(folder.path / "flat.ply", mesh);
  const auto made = [&](const std::string& keys, const SceneOverrides& overrides = {},
                        const std::string& name = "flat.msh") {
    const std::string text = fmt::format(R"({{"bodies": [{{"mesh": "{}", "density": 500 {}}}]}})", name, keys);
    return build_model(load_scene(folder.write("s.json", text).string(), overrides));
  };
  const std::string soft = R"(, "material": "rubber")";
  const auto mass = [](const Model& model) { return body_mass(model, model.bodies[0]); };
  const auto filled = made(soft);
  const std::string& what = filled->fills.at(0).what;
  CHECK(what.starts_with("tet 5 near (-"));
  CHECK(contains(what, "as flat as 0.000"));
  CHECK(contains(what, fmt::format(" of an edge, so a lattice of {} tets fills it", filled->rest.tets.size())));
  CHECK(what.ends_with("; --fill file keeps its tets"));
  CHECK(flattest_tet(filled->rest).quality > 0.3);
  CHECK(mass(*filled) == doctest::Approx(500).epsilon(0.01));
  CHECK(filled->carried.triangles.size() == mesh.surface.size());
  // What keeps the file's tets: a hard body, a sound file, and who says so.
  for (const auto& model : {made(""), made(soft + R"(, "fill": "file")"), made(soft, {.fill = "file"}),
                            made(soft + R"(, "fill": "lattice")", {.fill = "file"})}) {
    CHECK(original_tets(*model) == mesh.tets);
    CHECK(model->fills.at(0).what.empty());
  }
  CHECK(original_tets(*made(soft, {}, "sound.msh")) == sound.tets);
  // What fills any file anew.
  const std::tuple<std::shared_ptr<Model>, double, double> anew[] = {
      {made("", {.fill = "lattice", .tets = 300}, "sound.msh"), 1, 300},
      {made(R"(, "tets": 300)"), 1, 300},
      {made(R"(, "spacing": 0.5, "height": 2)"), 8, 1000}};
  for (const auto& [model, volume, tets] : anew) {
    CHECK(std::abs(double(model->rest.tets.size()) - tets) < 0.5 * tets);
    CHECK(model->fills.at(0).what.starts_with("a lattice of "));
    CHECK(mass(*model) == doctest::Approx(500 * volume).epsilon(0.01));
  }
  const auto by_tetgen = made(soft, {.fill = "tetgen"});
  CHECK(flattest_tet(by_tetgen->rest).quality > 0.05);
  CHECK(by_tetgen->rest.surface.size() == mesh.surface.size());
  CHECK(mass(*by_tetgen) == doctest::Approx(500));
  CHECK(contains(error_of([&] { made("", {.fill = "file"}, "flat.ply"); }),
                 "2 no body is from a file of tets: --fill file"));
  CHECK(
      contains(error_of([&] { made(R"(, "fill": "file")", {}, "flat.ply"); }), "'bodies.0.fill' is of a file of tets"));
  CHECK(contains(error_of([&] { made(R"(, "fill": "file", "tets": 50)"); }), "tets is of a lattice"));
  const MeshOptions lattice{
      .file = folder.path / "flat.msh", .filled = {.fill = "lattice"}, .out = folder.path / "l.msh"};
  CHECK(run_mesh_command(lattice) == 0);
  CHECK(too_flat(load_tets(folder.path / "l.msh")).empty());
  CHECK(run_mesh_command({.file = folder.path / "flat.msh", .out = folder.path / "same.msh"}) == 0);
  CHECK(load_tets(folder.path / "same.msh").tets == mesh.tets);
}

TEST_CASE("fit: the thinnest part and the gap to the surface, in the frame of the scene, also from the cache") {
  const Folder folder;
  // A slab with a thin fin on its top, which is at x = 0.
  SurfaceMesh slab = cube(), fin = cube({0, 0.9, 0});
  for (glm::dvec3& p : slab.positions) p.y *= 0.5;
  for (glm::dvec3& p : fin.positions) p.x *= 0.08, p.y = p.y > 1 ? 1.2 : 0.4;
  const SurfaceMesh surface = joined(slab, fin);
  for (const char* again : {"first", "from the cache"}) {
    CAPTURE(again);
    const Fit fit = fill(surface, {.by = "lattice", .size = {3000, 0}}, "fin.obj").fit;
    CHECK(fit.thinnest == doctest::Approx(0.08).epsilon(0.01));
    CHECK(fit.thinnest_at.y > 0.5);
    CHECK(fit.gap > 0);
    CHECK(fit.gap < 0.6 * fit.edge);
  }
  const Fit whole = fill(cube(), {}, "cube.obj").fit;
  CHECK(whole.gap == 0);
  CHECK(std::isnan(whole.thinnest));  // which its boundary tells
  CHECK(thinnest_part(cube()).depth == doctest::Approx(1).epsilon(1e-5));
  CHECK(std::isnan(thinnest_part({}).depth));
  write_surface(folder.path / "fin.obj", surface);
  const Scene scene = load_scene(folder
                                     .write("s.json", R"({"bodies": [{"mesh": "fin.obj", "height": 2.4, "tets": 3000,
    "rotation": [0, 0, 180], "position": [5, 0, 0]}]})")
                                     .string());
  const Fit placed = build_model(scene)->fills.at(0).fit;
  CHECK(placed.thinnest == doctest::Approx(0.16).epsilon(0.01));
  CHECK(placed.thinnest_at.y < 1.4);
  CHECK(placed.thinnest_at.x > 5);
}

TEST_CASE("lattice: says how far it is, and ends where it is interrupted") {
  const Folder folder;
  std::vector<double> parts;
  fill(cube(), {.by = "lattice", .size = {3000, 0}, .progress = [&](double part) { parts.push_back(part); }}, "a.obj");
  REQUIRE(parts.size() > 10);
  CHECK(std::ranges::is_sorted(parts));
  CHECK(parts.front() == 0);
  CHECK(parts.back() < 1);
  std::size_t calls = 0;
  const auto interrupt = [&](double) { signals::caught = ++calls == 5; };
  CHECK(error_of([&] {
          fill(cube(), {.by = "lattice", .size = {2500, 0}, .progress = interrupt}, "b.obj");
        }) == "1 interrupted: b.obj: start again; nothing was written");
  signals::caught = 0;
  CHECK(calls == 5);
}

TEST_CASE("run: a broken mesh becomes a body, and files have its surface") {
  const run_program::Folder folder;
  SurfaceMesh open = sphere(10);
  open.triangles.resize(open.triangles.size() - 30);
  write_surface(folder.path / "open.obj", open);
  std::ofstream(folder.path / "s.json") << R"({"bodies": [{"mesh": "open.obj", "tets": 500}]})";
  const auto done = run_program::program(
      "run --scene s.json --steps 2 --export ply,pc2,vtk --positions --png-every 2 --size 64x48 --out o", folder,
      "TETPBD_CACHE=cache");
  CHECK(done.status == 0);
  CHECK(contains(done.err, "open.obj: a lattice of "));
  const SurfaceMesh seen = load_surface(folder.path / "o/ply/frame_00000.ply");
  CHECK(seen.triangles == load_surface(folder.path / "open.obj").triangles);
  CHECK(fs::exists(folder.path / "o/surface.npy"));
  CHECK(fs::exists(folder.path / "o/surface_faces.npy"));
  const auto numbers = nlohmann::json::parse(run_program::read(folder.path / "o/stats.json"))["mesh"];
  CHECK(numbers["thinnest_part"] > 1.5);
  CHECK(numbers["thinnest_at"].size() == 3);
  CHECK(numbers["surface_gap"].get<double>() / numbers["surface_gap_of_edge"].get<double>() < 0.6);
  write_surface(folder.path / "cube.obj", cube());
  const auto whole = run_program::program("mesh cube.obj --json", folder, "TETPBD_CACHE=cache");
  const auto counts = nlohmann::json::parse(whole.out)["mesh"];
  CHECK(counts["thinnest_part"].get<double>() == doctest::Approx(1).epsilon(1e-4));
  CHECK(counts["surface_gap"] == 0);
  const auto refused = run_program::program("run --mesh open.obj --fill tetgen --out o", folder);
  CHECK(refused.status == 2);
  CHECK(contains(refused.err, "surface is open"));
}
