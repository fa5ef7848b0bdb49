// Surfaces that TetGen cannot fill, and the lattice that does; cavities; distance fields; fine surfaces on coarse tets.
// repairs.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "app/commands.h"
#include "app/scene.h"
#include "sim/mesh/carry.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/distance_field.h"
#include "sim/mesh/fill.h"
#include "sim/mesh/solid.h"
#include "sim/model/material.h"
#include "tests/app/run_program.h"
#include "tests/mesh/mesh_samples.h"
#include "tests/render/render_stage.h"

using namespace tetpbd;
using namespace samples;

namespace {

const doctest::skip needs_openvdb(!can_make_distance_fields());
const FillOptions coarse{.size = {2000, 0}};

SurfaceMesh rectangle(double x, double y, double z = 0) {
  return {{{0, 0, z}, {x, 0, z}, {x, y, z}, {0, y, z}}, {{0, 1, 2}, {0, 2, 3}}};
}
// n x n on each of the cube's sides, pushed out to a sphere of radius 1.
SurfaceMesh sphere(int n) {
  SurfaceMesh s;
  const SurfaceMesh box = cube(glm::dvec3(-1), 2);
  for (std::size_t side = 0; side < 12; side += 2) {
    const Triangle &t = box.triangles[side], &u = box.triangles[side + 1];
    const glm::dvec3 a = box.positions[t[0]], b = box.positions[t[1]], d = box.positions[u[2]];
    const auto base = std::uint32_t(s.positions.size());
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i)
        s.positions.push_back(glm::normalize(a + (b - a) * (double(i) / n) + (d - a) * (double(j) / n)));
    const auto at = [&](int i, int j) { return base + std::uint32_t(j * (n + 1) + i); };
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        s.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        s.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
  }
  weld(s, 1e-9);
  return s;
}

}  // namespace

TEST_CASE("distance field: signed of what is closed, a sheet's of what is not" * needs_openvdb) {
  const Folder folder;
  const auto at = [](const DistanceField& f, const glm::dvec3& p) {
    const glm::ivec3 i((p - f.origin) / f.spacing + 0.5);
    return double(f.values.at(std::size_t((i.z * f.size.y + i.y) * f.size.x + i.x)));
  };
  const DistanceField field = distance_field(cube({10, 0, 0}), 20);
  CHECK(field.size == glm::ivec3(27));
  CHECK(field.spacing == doctest::Approx(0.05));
  CHECK(field.origin.x == doctest::Approx(9.85));
  CHECK(at(field, {10.5, 0.5, 0.5}) == doctest::Approx(-0.5));
  CHECK(at(field, {10.2, 0.5, 0.5}) == doctest::Approx(-0.2));
  CHECK(at(field, {11.1, 0.5, 0.5}) == doctest::Approx(0.1));
  CHECK(at(field, {11.1, 1.1, 1.1}) == doctest::Approx(0.1 * std::sqrt(3)));
  const DistanceField again = distance_field(cube({10, 0, 0}), 20);
  CHECK(again.values == field.values);
  CHECK(!fs::is_empty(folder.cache()));
  SurfaceMesh inward = cube();
  for (Triangle& t : inward.triangles) std::swap(t[0], t[1]);
  CHECK(at(distance_field(inward, 20), {0.5, 0.5, 0.5}) == doctest::Approx(-0.5));

  const DistanceField sheet = distance_field(rectangle(2, 1), 20);
  CHECK(at(sheet, {1, 0.5, 0}) == doctest::Approx(-0.05));
  CHECK(at(sheet, {1, 0.5, 0.2}) == doctest::Approx(0.15));
  SurfaceMesh lost = cube();
  lost.positions[3].x = NAN;
  CHECK(contains(error_of([&] { distance_field(lost, 20, "lost.obj"); }), "not finite numbers: 1 vertex"));
}

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
  CHECK(contains(refused, "give a spacing of 0.00"));
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

TEST_CASE("solid: inside, nearest points and crossings") {
  const SurfaceMesh box = cube();
  const Solid solid(box);
  CHECK(solid.winding({0.3, 0.4, 0.6}) == doctest::Approx(1));
  CHECK(std::abs(solid.winding({1.3, 0.4, 0.6})) < 1e-3);
  const auto near = solid.nearest({0.3, 0.4, 1.5});
  CHECK(near.distance == doctest::Approx(0.5));
  CHECK(near.point.z == doctest::Approx(1));
  CHECK(solid.nearest({3, 0, 0}, 0.5).distance == 0.5);
  std::vector<Solid::Crossing> found;
  solid.find_crossings({-1, 0.4, 0.3}, {2, 0.41, 0.32}, found);
  REQUIRE(found.size() == 2);
  CHECK(found[0].at == doctest::Approx(1.0 / 3));
  CHECK(found[0].jump == 1);
  CHECK(found[1].jump == -1);
  CHECK(solid.winding_at({0.5, 0.45, 0.35}, {-1, 0.4, 0.3}, 0) == 1);
  CHECK(solid.sees({0.1, 0.2, 0.3}, 1, {0.9, 0.8, 0.7}));
  CHECK_FALSE(solid.sees({0.1, 0.2, 0.3}, 1, {1.2, 0.8, 0.7}));
  const SurfaceMesh two = joined(cube(), cube({0.5, 0.2, 0.2}));
  const Solid both(two);
  CHECK(both.winding({0.7, 0.5, 0.5}) == doctest::Approx(2));
  CHECK(both.sees({0.1, 0.5, 0.5}, 1, {1.4, 0.52, 0.51}));  // through the walls inside
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

TEST_CASE("carry: a fine sphere on coarse tets follows every affine motion of them") {
  const Folder folder;
  const SurfaceMesh fine = sphere(40);
  CHECK(fine.triangles.size() == 19200);
  const TetMesh tets = tetrahedralise(sphere(5), "pYq1.4");
  const CarriedSurface carried = carry(fine, tets, "sphere");
  CHECK(sizeof(CarriedVertex) == 16);
  CHECK(carried.triangles == fine.triangles);
  const auto follow = [&](const glm::dmat3& turn, const glm::dvec3& shift) {
    auto moved = tets.positions;
    for (auto& p : moved) p = turn * p + shift;
    const auto now = carried_positions(carried, tets.tets, moved);
    double worst = 0;
    for (std::size_t v = 0; v < now.size(); ++v)
      worst = std::max(worst, glm::distance(now[v], turn * fine.positions[v] + shift));
    return worst / 2;  // of its size
  };
  CHECK(follow(glm::dmat3(1), glm::dvec3(0)) < 1e-6);
  CHECK(follow(glm::dmat3(0.6, 0.8, 0, -0.8, 0.6, 0, 0, 0, 1), {1, 2, 3}) < 1e-6);
  CHECK(follow(glm::dmat3(1.5, 0.2, 0, -0.3, 0.5, 0.4, 0, 0.1, 1), {0, 0, 0}) < 2e-6);

  const CarriedSurface own = carry_boundary(tets);
  const auto boundary = carried_positions(own, tets.tets, tets.positions);
  for (std::size_t t = 0; t < own.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) CHECK(boundary[own.triangles[t][k]] == tets.positions[tets.surface[t][k]]);
  SurfaceMesh elsewhere = fine;
  for (auto& p : elsewhere.positions) p += glm::dvec3(1, 0, 0);
  CHECK(contains(error_of([&] { carry(elsewhere, tets, "far.obj"); }), "2 surface does not fit its tets: vertex"));
}

TEST_CASE("repair: mends what needs no choice, leaves a sound surface as it is") {
  SurfaceMesh s = cube();
  CHECK(repair(s) == "");
  CHECK(s.positions == cube().positions);
  CHECK(s.triangles == cube().triangles);
  SUBCASE("repeated triangles") {
    s.triangles.push_back(s.triangles[4]);
    s.triangles.push_back({3, 2, 0});
    CHECK(repair(s) == "2 repeated triangles dropped");
    CHECK(s.triangles == cube().triangles);
  }
  SUBCASE("two vertices in one place, one without a triangle") {
    s.positions.push_back(s.positions[7]);
    s.positions.push_back({9, 9, 9});
    s.triangles.back() = {1, 8, 5};
    CHECK(repair(s) == "2 vertices merged or without a triangle");
    CHECK(s.positions == cube().positions);
    CHECK(s.triangles == cube().triangles);
  }
  SUBCASE("no area, and where one lies on another's side") {
    s.triangles.push_back({0, 1, 1});
    CHECK(repair(s) == "1 triangle without area dropped");
    s.positions.push_back({0.5, 0.5, 0});  // on the diagonal 0 3
    s.triangles.push_back({0, 3, 8});
    s.triangles[0] = {0, 2, 8};
    s.triangles.push_back({8, 2, 3});
    CHECK(check_surface(s).defect == "triangles have no area");
    CHECK(repair(s) == "1 triangle without area turned into its neighbour");
    CHECK(check_surface(s).defect == "");
    CHECK(check_surface(s).volume == doctest::Approx(1));
  }
  SUBCASE("turned") {
    std::swap(s.triangles[3][0], s.triangles[3][1]);
    CHECK(repair(s) == "1 triangle turned outward");
    CHECK(check_surface(s).flipped_triangles == 0);
  }
  SUBCASE("what it cannot mend stays") {
    s.triangles.pop_back();
    const SurfaceMesh before = s;
    CHECK(repair(s) == "");
    CHECK(s.triangles == before.triangles);
  }
}

TEST_CASE("surface files: triangle strips of PLY") {
  const Folder folder;
  const char* head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  for (const char* strips : {"6 0 2 1 3 0 2\n", "9 0 2 1 3 -1 1 3 0 2\n"}) {
    SurfaceMesh s = load_surface(folder.write("strips.ply", std::string(head) + strips));
    CHECK(s.triangles == std::vector<Triangle>{{0, 2, 1}, {1, 2, 3}, {1, 3, 0}, {0, 3, 2}});
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "");
    CHECK(check.flipped_triangles == 0);
  }
  CHECK(contains(error_of([&] { load_surface(folder.write("bad.ply", std::string(head) + "3 0 1 7\n")); }),
                 "names vertex 7 of 4"));
}

TEST_CASE("repair: the command writes what is sound, and says what is left") {
  const Folder folder;
  const auto repaired = [&](const fs::path& file, const fs::path& to, const fs::path& out = {}) {
    return run_mesh_command({.file = file, .repaired = folder.path / to, .out = out});
  };
  write_surface(folder.path / "cube.ply", cube());
  CHECK(repaired(folder.path / "cube.ply", "same.ply") == 0);
  CHECK(run_program::read(folder.path / "same.ply") == run_program::read(folder.path / "cube.ply"));
  SurfaceMesh open = cube();
  open.triangles.push_back(open.triangles[0]);
  open.triangles.erase(open.triangles.begin() + 5);
  write_surface(folder.path / "open.obj", open);
  CHECK(repaired(folder.path / "open.obj", "mended.ply", folder.path / "open.node") == 1);
  CHECK(load_surface(folder.path / "mended.ply").triangles.size() == 11);
  CHECK(!fs::exists(folder.path / "open.node"));
  CHECK(contains(error_of([&] { repaired(folder.path / "open.obj", "a.msh"); }), "a.msh"));
  CHECK(contains(error_of([&] { repaired(folder.path / "cube.ply", "b.ply", "c.txt"); }), "c.txt"));
  CHECK(!fs::exists(folder.path / "b.ply"));
}

TEST_CASE("repair: with --out the sound surface is filled too, and what TetGen refuses is not called sound") {
  const Folder folder;
  SurfaceMesh turned = cube();
  std::swap(turned.triangles[3][0], turned.triangles[3][1]);
  write_surface(folder.path / "turned.stl", turned);
  const MeshOptions both{.file = folder.path / "turned.stl",
                         .repaired = folder.path / "b.ply",
                         .out = folder.path / "c.node",
                         .json = true};
  CHECK(run_mesh_command(both) == 0);
  CHECK(mesh_volume(load_tets(folder.path / "c.ele")) == doctest::Approx(1));
  SurfaceMesh mended = load_surface(folder.path / "b.ply");
  CHECK(check_surface(mended).flipped_triangles == 0);
  SurfaceMesh other = sphere(6);
  for (auto& p : other.positions) p += glm::dvec3(0.4, 0.1, 0);
  write_surface(folder.path / "balls.ply", joined(sphere(6), other));
  for (const bool json : {false, true})
    CHECK(run_mesh_command({.file = folder.path / "balls.ply",
                            .repaired = folder.path / "b.obj",
                            .out = folder.path / "balls.msh",
                            .json = json}) == 1);
  CHECK(fs::exists(folder.path / "b.obj"));
  CHECK(!fs::exists(folder.path / "balls.msh"));
}

TEST_CASE("up: what a file calls z or x is upright, in what is written and in scenes, with the surface that rides") {
  const Folder folder;
  // A block, 1 x 2 x 3 along the file's axes; y is up in the program's.
  const TetMesh block = make_block({1, 2, 3}, {1, 1, 1});
  write_mesh(folder.path / "block.msh", block);
  write_mesh(folder.path / "fine.obj", block);
  const auto size_of = [](const std::vector<glm::dvec3>& positions) {
    const Bounds box = bounds(positions);
    return box.high - box.low;
  };
  const std::tuple<const char*, const char*, glm::dvec3> axes[] = {
      {"x", "y.node", {2, 1, 3}}, {"y", "y.msh", {1, 2, 3}}, {"z", "z.node", {1, 3, 2}}};
  for (const auto& [up, out, size] : axes) {
    CAPTURE(up);
    CHECK(run_mesh_command({.file = folder.path / "block.msh", .up = up, .out = folder.path / out}) == 0);
    const TetMesh written = load_tets(folder.path / out);
    CHECK(size_of(written.positions) == size);
    CHECK(mesh_volume(written) == doctest::Approx(6));  // turned, not mirrored
    const std::string file = folder
                                 .write("s.json", fmt::format(R"({{"bodies": [{{"mesh": "block.msh", "up": "{}",
        "surface": "fine.obj", "scale": [1, 2, 1]}}]}})",
                                                              up))
                                 .string();
    const auto model = build_model(load_scene(file));
    const glm::dvec3 scaled = size * glm::dvec3(1, 2, 1);
    CHECK(glm::length(size_of(model->positions) - scaled) < 1e-6);
    CHECK(glm::length(size_of(carried_positions(model->carried, model->rest.tets, model->positions)) - scaled) < 1e-5);
    const std::string json = body_json(load_scene(file).bodies[0]).dump();
    CHECK(contains(json, "\"up\"") == (up != std::string("y")));
    const auto moved = build_model(load_scene(file, {.mesh = folder.path / "block.msh"}));  // "up" was the other file's
    CHECK(glm::length(size_of(moved->positions) - glm::dvec3(1, 4, 3)) < 1e-6);
    const auto named = build_model(load_scene(file, {.mesh = folder.path / "block.msh", .up = up}));
    CHECK(glm::length(size_of(named->positions) - scaled) < 1e-6);
  }
  CHECK(upright({1, 2, 3}, "z") == glm::dvec3(1, 3, -2));
  CHECK(run_mesh_command({.file = folder.path / "fine.obj", .up = "z", .repaired = folder.path / "up.ply"}) == 0);
  CHECK(size_of(load_surface(folder.path / "up.ply").positions) == glm::dvec3(1, 3, 2));
  const auto error = [&](const char* body, SceneOverrides overrides) {
    const fs::path file = folder.write("bad.json", fmt::format(R"({{"bodies": [{{{}}}]}})", body));
    return error_of([&] { load_scene(file.string(), overrides); });
  };
  const char* cell = R"("block": {"size": [1, 1, 1], "cells": [1, 1, 1]})";
  CHECK(contains(error(R"("mesh": "block.msh", "up": "up")", {}), "'bodies.0.up' must be"));
  CHECK(contains(error((std::string(cell) + R"(, "up": "z")").c_str(), {}), "this body has none"));
  CHECK(contains(error(cell, {.up = "z"}), "2 the first body is from no file: --up z: "));
  CHECK(contains(error(R"("mesh": "block.msh")", {.up = "w"}), "no such axis"));
}

TEST_CASE("scene: a body's fine surface, beside bodies without") {
  const Folder folder;
  write_surface(folder.path / "fine.obj", sphere(10));
  const auto scene_with = [&](const std::string& first) {
    return load_scene(folder
                          .write("s.json", fmt::format(R"({{"bodies": [{{{}, "height": 1, "position": [2, 1, 0]}},
      {{"block": {{"size": [1, 1, 1], "cells": [1, 1, 1]}}}}]}})",
                                                       first))
                          .string());
  };
  const Scene scene = scene_with(R"("block": {"size": [2, 2, 2], "cells": [2, 2, 2]}, "surface": "fine.obj")");
  const auto model = build_model(scene);
  const CarriedSurface& carried = model->carried;
  CHECK(carried.triangles.size() == 1200 + 12);
  const auto x = carried_positions(carried, model->rest.tets, model->rest.positions);
  const SurfaceMesh fine = sphere(10);
  for (std::size_t v = 0; v < fine.positions.size(); ++v)
    CHECK(glm::distance(x[v], fine.positions[v] * 0.5 + glm::dvec3(2, 1.5, 0)) < 1e-6);
  CHECK(bounds({x.begin() + std::ptrdiff_t(fine.positions.size()), x.end()}).high == glm::dvec3(0.5, 1, 0.5));
  const std::string json = body_json(scene.bodies[0]).dump();
  CHECK(contains(json, "fine.obj"));
  CHECK(build_model(scene_with(R"("block": {"size": [2, 2, 2], "cells": [2, 2, 2]})"))->carried.triangles.empty());
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "fill": "tetgen")"); }), "rides on a lattice"));
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "tets": 3)"); }),
                 "'bodies.0.tets' must be a number from 10 to 1e+08, not 3"));
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "fill": "foam")"); }),
                 "must be one of auto, tetgen, lattice, not \"foam\""));
  CHECK(contains(error_of([&] { build_model(scene_with(R"("surface": "fine.obj", "tets": 100, "spacing": 1)")); }),
                 "tets and spacing both say how fine a lattice is"));
  // A surface alone rides on a lattice, whose cells are as large as they are in the scene.
  const auto alone = build_model(scene_with(R"("surface": "fine.obj", "spacing": 0.2, "scale": [1, 2, 1])"));
  CHECK(alone->carried.triangles.size() == 1200 + 12);
  const Bounds own = body_bounds(alone->bodies[0], alone->rest.positions);
  CHECK(own.high.y - own.low.y == doctest::Approx(1).epsilon(0.1));
  CHECK(own.high.x - own.low.x == doctest::Approx(0.5).epsilon(0.2));
  CHECK(own.low.y == doctest::Approx(1));
  double edges = 0;
  for (const auto& [a, b] : tet_edges(alone->rest))
    edges += glm::distance(alone->rest.positions[a], alone->rest.positions[b]);
  CHECK(edges / double(tet_edges(alone->rest).size()) == doctest::Approx(0.19).epsilon(0.15));
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
  const auto refused = run_program::program("run --mesh open.obj --fill tetgen --out o", folder);
  CHECK(refused.status == 2);
  CHECK(contains(refused.err, "surface is open"));
}

TEST_CASE("render: a carried surface looks as its own mesh would, also deformed") {
  const Folder folder;
  Stage stage(tetrahedralise(sphere(8), "pYq1.4"));
  const Image background = stage.empty(), plain = stage.image();
  stage.renderer.carried = carry(sphere(24), stage.mesh, "sphere");
  const auto like = [&](const Image& a, const Image& b) {
    const Difference first = difference(a, background), second = difference(b, background);
    CHECK(first.count > 3000);
    CHECK(std::abs(first.count - second.count) < first.count / 20);
    CHECK(glm::all(glm::lessThanEqual(glm::abs(first.low - second.low), glm::ivec2(3))));
    CHECK(glm::all(glm::lessThanEqual(glm::abs(first.high - second.high), glm::ivec2(3))));
    CHECK(difference(a, b, 40).count < first.count / 20);  // the light on it, too
  };
  like(plain, stage.image());
  stage.frame.options.shadow = true;
  stage.frame.ground = -1.0f;
  stage.image();
  stage.frame.options.shadow = false;
  stage.frame.ground.reset();
  for (glm::dvec3& p : stage.mesh.positions) p = {0.6 * p.x + 0.3 * p.y, 1.2 * p.y, p.z + 0.4 * p.x};
  stage.move(1);
  const Image moved = stage.image();
  stage.frame.options.look = Look::tets;  // shows what is simulated
  stage.image();
  stage.frame.options.look = Look::surface;
  stage.frame.options.colour = Colour::volume;
  stage.image();
  stage.frame.options.colour = Colour::plain;
  stage.renderer.carried = {};
  like(stage.image(), moved);
  CHECK(gl_error_count() == 0);
}
