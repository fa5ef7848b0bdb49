// Fine surfaces on coarse tets, also in scenes and pictures.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "app/scene.h"
#include "sim/mesh/carry.h"
#include "tests/mesh/mesh_samples.h"
#include "tests/render/render_stage.h"

using namespace tetpbd;
using namespace samples;

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
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "fill": "tetgen")"); }), "only an embedded surface"));
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "tets": 3)"); }),
                 "'bodies.0.tets' must be a number from 10 to 1e+08, not 3"));
  CHECK(contains(error_of([&] { scene_with(R"("surface": "fine.obj", "fill": "foam")"); }),
                 "must be one of auto, tetgen, lattice, file, not \"foam\""));
  CHECK(contains(error_of([&] { build_model(scene_with(R"("surface": "fine.obj", "tets": 100, "spacing": 1)")); }),
                 "tets and spacing both say how fine a lattice is"));
  // A surface alone is embedded in a lattice, whose cells are as large as they are in the scene.
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
