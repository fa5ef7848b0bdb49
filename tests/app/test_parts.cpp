// Attachments, forces and fibres in scene files: read, refused, written again.
#include <doctest/doctest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "app/scene.h"
#include "sim/error.h"
#include "tests/app/run_program.h"

using namespace tetpbd;
using nlohmann::json;

namespace {

json two_blocks() {
  return json::parse(R"({"bodies": [
    {"name": "low", "block": {"size": [0.2, 0.2, 0.2], "cells": [2, 2, 2]}, "position": [0, 0, 0]},
    {"name": "high", "block": {"size": [0.2, 0.2, 0.2], "cells": [2, 2, 2]}, "position": [0, 0.2, 0]}],
    "world": {"contact": "none"}, "solver": {"material": "neo-hookean", "young_modulus": 1e5}})");
}

Scene read_back(const json& scene) {
  const run_program::Folder folder;
  const auto file = folder.path / "scene.json";
  std::ofstream(file) << scene.dump();
  return load_scene(file.string());
}

std::string refused(const json& scene) {
  try {
    build_model(read_back(scene));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

bool holds(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("attachments hold what is near, by name or number, in a box or all") {
  json scene = two_blocks();
  scene["attachments"] = {{{"body", "high"}, {"to", 0}}};
  const auto model = build_model(read_back(scene));
  REQUIRE(model->attachments.size() == 1);
  const Attachment& a = model->attachments[0];
  CHECK(a.vertices.size() == 9);  // its bottom
  for (std::size_t k = 0; k < a.vertices.size(); ++k) {
    CHECK(body_at(*model, a.vertices[k]).name == "high");
    CHECK(std::abs(model->positions[a.vertices[k]].y - 0.2) < 1e-9);
    CHECK(body_at(*model, a.triangles[k][0]).name == "low");
    CHECK(std::abs(a.places[k].z) < 1e-9);
  }
  scene["attachments"][0].update({{"low", {0, 0, 0}}, {"high", {0, 0, 1}}});
  CHECK(build_model(read_back(scene))->attachments[0].vertices.size() == 3);
}

TEST_CASE("what attachments, forces and fibres cannot be is refused by name") {
  const auto with = [](const char* key, const char* value) {
    json scene = two_blocks();
    scene[key] = json::parse(value);
    return refused(scene);
  };
  CHECK(holds(with("attachments", R"([{"body": "hihg", "to": "low"}])"), "did you mean 'high'"));
  CHECK(holds(with("attachments", R"([{"body": "low", "to": 0}])"), "to itself"));
  CHECK(holds(with("attachments", R"([{"body": 2, "to": 0}])"), "from 0 to 1"));
  CHECK(holds(with("attachments", R"([{"body": 1}])"), "attached \"to\""));
  CHECK(holds(with("attachments", R"([{"body": 1, "to": 0, "low": [0, 1, 0], "within": 0.1}])"),
              "'high' is 0.2 m from 'low'"));
  CHECK(holds(with("attachments", R"([{"body": 1, "to": 0, "low": [0.1, 0.1, 0.1], "high": [0.2, 0.2, 0.2]}])"),
              "holds no vertex"));
  CHECK(holds(with("forces", R"([{"body": "low"}])"), "needs one of"));
  CHECK(holds(with("forces", R"([{"wind": [1, 0, 0], "pressure": 3}])"), "has both"));
  CHECK(holds(with("forces", R"([{"pressure": 3, "factors": [{"time": 1, "factor": 1}, {"time": 1, "factor": 2}]}])"),
              "later"));
  CHECK(holds(with("forces", R"([{"pressure": 3, "low": [0.1, 0.1, 0.1], "high": [0.2, 0.2, 0.2]}])"),
              "acts on no vertex"));
  json scene = two_blocks();
  scene["bodies"][0]["fibres"] = json::parse(R"([{"along": [0, 0, 0], "stiffness": 1}])");
  CHECK(holds(refused(scene), "no direction"));
  scene["bodies"][0]["fibres"] = json::parse(R"([{"along": [0, 1, 0]}])");
  CHECK(holds(refused(scene), "needs a \"stiffness\""));
  scene["bodies"][0]["fibres"] =
      json::parse(R"([{"along": [0, 1, 0], "stiffness": 1e4, "activation": [{"activation": 2}]}])");
  CHECK(!refused(scene).empty());
  scene["bodies"][0]["fibres"] =
      json::parse(R"([{"along": [0, 1, 0], "stiffness": 1e4, "activation": [{"activation": 0.2}]}])");
  CHECK(refused(scene).empty());
  const auto model = build_model(read_back(scene));
  Settings hard = read_back(scene).settings;
  hard.material = "none";
  CHECK_THROWS_AS(check_settings(*model, hard), Error);
  hard.mode = "paper";
  CHECK_THROWS_AS(check_settings(*model, hard), Error);
}

TEST_CASE("scene.json says attachments, forces and fibres so that the same model is read again") {
  for (const char* name : {"beads", "balloon", "muscle-arm", "sewn-bag"}) {
    CAPTURE(std::string(name));
    const Scene scene = load_scene(name);
    const auto model = build_model(scene), again = build_model(read_back(json(scene_json(scene))));
    REQUIRE(model->attachments.size() == again->attachments.size());
    for (std::size_t n = 0; n < model->attachments.size(); ++n) {
      CHECK(model->attachments[n].vertices == again->attachments[n].vertices);
      CHECK(model->attachments[n].places == again->attachments[n].places);
      CHECK(model->attachments[n].stiffness == again->attachments[n].stiffness);
    }
    REQUIRE(model->loads.size() == again->loads.size());
    for (std::size_t n = 0; n < model->loads.size(); ++n) {
      CHECK(model->loads[n].vertices == again->loads[n].vertices);
      CHECK(model->loads[n].amount == again->loads[n].amount);
      CHECK(model->loads[n].vector == again->loads[n].vector);
      CHECK(model->loads[n].factors == again->loads[n].factors);
    }
    REQUIRE(model->fibres.size() == again->fibres.size());
    for (std::size_t n = 0; n < model->fibres.size(); ++n) {
      CHECK(model->fibres[n].tets == again->fibres[n].tets);
      CHECK(model->fibres[n].activation == again->fibres[n].activation);
    }
  }
}
