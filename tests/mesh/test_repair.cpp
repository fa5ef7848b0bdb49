// The command mesh: repairs, and which axis is up.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/scene.h"
#include "sim/mesh/carry.h"
#include "tests/app/run_program.h"
#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

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
