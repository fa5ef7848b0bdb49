// Surfaces that no solver can fill, wrapped; distance fields; fine surfaces on coarse tets; repairs.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "app/commands.h"
#include "app/scene.h"
#include "sim/mesh/carry.h"
#include "sim/mesh/distance_field.h"
#include "sim/mesh/wrap.h"
#include "tests/app/run_program.h"
#include "tests/mesh/mesh_samples.h"
#include "tests/render/render_stage.h"

using namespace tetpbd;
using namespace samples;

namespace {

const doctest::skip needs_openvdb(!can_wrap());
constexpr const char* coarse = "pYq1.85o/140";

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

TEST_CASE("wrap: every defect ends as a body that carries the surface" * needs_openvdb) {
  const Folder folder;
  SurfaceMesh s = cube({3, 0, 0});
  const auto count = [&] { return std::uint32_t(s.positions.size()); };
  std::string why;
  SUBCASE("open") {
    s.triangles.pop_back();
    why = "surface is open: 3 edges with one triangle only";
  }
  SUBCASE("a sheet") {
    s = rectangle(2, 1);
    why = "too few triangles to enclose a volume: 2 of them";
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
    why = "parts of the surface touch in single vertices: 1 vertex";
  }
  SUBCASE("it intersects itself") {
    s = joined(s, cube({3.5, 0.3, 0.2}));
    why = "surface intersects itself: ";
  }
  SUBCASE("one part in another") {
    s = joined(s, cube({3.25, 0.25, 0.25}, 0.5));
    why = "parts of the surface lie inside one another";
  }
  SUBCASE("one-sided") {
    s = {{}, {}};
    for (std::uint32_t i = 0; i < 12; ++i) {  // a Moebius strip
      const double turn = 2 * std::acos(-1.0) * i / 12, half = turn / 2;
      const glm::dvec3 out(std::cos(turn), std::sin(turn), 0);
      for (const double side : {-0.3, 0.3})
        s.positions.push_back(out * (1 + side * std::cos(half)) + glm::dvec3(0, 0, side * std::sin(half)));
      const std::uint32_t a = 2 * i, c = i < 11 ? a + 2 : 1, d = i < 11 ? a + 3 : 0;
      s.triangles.push_back({a, a + 1, d});
      s.triangles.push_back({a, d, c});
    }
    why = "surface is open: 24 edges";
  }
  const Filled filled = fill_or_wrap(s, coarse, WrapOptions{24, 1}, false, "bad.obj");
  CHECK(contains(filled.note, why));
  CHECK(contains(filled.note, ", so it was wrapped with 24 voxels across"));
  const MeshReport counts = report(filled.mesh);
  CHECK(counts.inverted == 0);
  CHECK(counts.components == 1);
  CHECK(counts.volume > 0);
  const CarriedSurface carried = carry(s, filled.mesh, "bad.obj");
  const auto positions = carried_positions(carried, filled.mesh.tets, filled.mesh.positions);
  const double size = bounds(s.positions).size();
  for (std::size_t v = 0; v < positions.size(); ++v) {
    CHECK(glm::distance(positions[v], s.positions[v]) < 1e-6 * size);
    const glm::vec3 w = carried.vertices[v].weights;
    CHECK(std::min({w.x, w.y, w.z, 1 - w.x - w.y - w.z}) > -1e-5f);
  }
  const Filled again = fill_or_wrap(s, coarse, WrapOptions{24, 1}, false, "bad.obj");
  CHECK(again.note == filled.note);
  CHECK(again.mesh.positions == filled.mesh.positions);
  CHECK(contains(error_of([&] { fill_or_wrap(s, coarse, {}, false, "bad.obj"); }), why));
}

TEST_CASE("wrap: a sound surface is left alone, a hopeless one refused" * needs_openvdb) {
  const Folder folder;
  const Filled sound = fill_or_wrap(cube(), coarse, WrapOptions{}, false, "cube.obj");
  CHECK(sound.note == "");
  CHECK(mesh_volume(sound.mesh) == doctest::Approx(1));
  SurfaceMesh lost = cube();
  lost.positions[3].x = NAN;
  CHECK(contains(error_of([&] { fill_or_wrap(lost, coarse, WrapOptions{}, false, "lost.obj"); }),
                 "2 positions are not finite numbers: 1 vertex, first vertex 3 in lost.obj: "));
  CHECK(contains(error_of([&] { wrap({}, {}, "nothing.obj"); }), "nothing.obj"));
  SurfaceMesh scan = sphere(20);
  scan.triangles.resize(scan.triangles.size() - 30);  // a small hole does not make it hollow
  CHECK(mesh_volume(fill_or_wrap(scan, coarse, WrapOptions{30, 1}, false, "scan.obj").mesh) > 4.2);
  SurfaceMesh bowl = sphere(20);
  std::erase_if(bowl.triangles, [&](const Triangle& t) { return bowl.positions[t[0]].z > 0.1; });
  CHECK(mesh_volume(fill_or_wrap(bowl, coarse, WrapOptions{30, 1}, false, "bowl.obj").mesh) < 1.9);
  const SurfaceMesh round = wrap(cube(), {40, 1}, "cube.obj");
  const Bounds box = bounds(round.positions);
  CHECK(box.low.x == doctest::Approx(-std::sqrt(3.0) / 40).epsilon(0.05));
  CHECK(box.high.y == doctest::Approx(1 + std::sqrt(3.0) / 40).epsilon(0.05));
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
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "wrap": false)"); }), "needs its \"wrap\""));
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "wrap": {"voxels": 3})"); }),
                 "'bodies.0.wrap.voxels' must be a whole number from 8 to 1000, not 3"));
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "wrap": true)"); }), "must be an object"));
}

TEST_CASE("run: a broken mesh becomes a body, and files have its surface" * needs_openvdb) {
  const run_program::Folder folder;
  SurfaceMesh open = sphere(10);
  open.triangles.resize(open.triangles.size() - 30);
  write_surface(folder.path / "open.obj", open);
  std::ofstream(folder.path / "s.json") << R"({"bodies": [{"mesh": "open.obj", "wrap": {"voxels": 16}}]})";
  const auto done = run_program::program(
      "run --scene s.json --steps 2 --export ply,pc2,vtk --positions --png-every 2 --size 64x48 --out o", folder,
      "TETPBD_CACHE=cache");
  CHECK(done.status == 0);
  CHECK(contains(done.err, "open.obj: surface is open: "));
  CHECK(contains(done.err, "so it was wrapped with 16 voxels across"));
  const SurfaceMesh seen = load_surface(folder.path / "o/ply/frame_00000.ply");
  CHECK(seen.triangles == load_surface(folder.path / "open.obj").triangles);
  CHECK(fs::exists(folder.path / "o/surface.npy"));
  CHECK(fs::exists(folder.path / "o/surface_faces.npy"));
  const auto refused = run_program::program("run --scene s.json --set bodies.0.wrap=false --out o", folder);
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
