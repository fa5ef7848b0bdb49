// The commands that measure: bench, compare, hard cases, reproduce, soak.
#include <doctest/doctest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "app/commands.h"
#include "tests/app/run_program.h"
#include "tests/long_run.h"

using nlohmann::json;
using namespace tetpbd;
using run_program::Folder, run_program::Outcome, run_program::read, run_program::program;
namespace fs = std::filesystem;

namespace {

/// The environment of a program whose scenes have this bunny and a beam of few cells. The long suite has
/// those that are shipped.
std::string smaller_scenes(const Folder& folder, const char* mesh) {
  if (is_long_run()) return "";
  const fs::path models = folder.path / "models";
  fs::create_directories(models);
  fs::copy(TEST_MODELS "/scenes", models / "scenes");
  fs::copy(TEST_MODELS "/bunny_coarse.obj", models);
  const auto change = [&](const char* name, const json& what) {
    json scene = json::parse(read(models / "scenes" / name));
    scene["bodies"][0].merge_patch(what);
    std::ofstream(models / "scenes" / name) << scene;
  };
  change("bunny-drop.json", json::parse(mesh));
  change("soft-beam.json", {{"block", {{"cells", {8, 2, 2}}}}});
  return "TETPBD_MODELS=" + models.string();
}

}  // namespace

TEST_CASE("soak: a block at rest neither drifts nor grows, one that falls does not pass (long)") {
  const Folder folder;
  std::ofstream(folder.path / "rest.json")
      << R"({"name": "rest", "bodies": [{"name": "block", "block": {"size": [1, 0.5, 0.5], "cells": [4, 2, 2]},
             "position": [0, 0.02, 0]}], "solver": {"iterations": 10, "substeps": 2}})";
  for (const char* mode : {"node", "constraint"}) {
    CAPTURE(mode);
    program("soak --scene rest.json --settle 600 --steps 400 --out s --mode " + std::string(mode), folder);
    const json soak = json::parse(read(folder.path / "s/soak.json"));
    CHECK(soak["steps"] == 400);
    CHECK(soak["finite"] == true);
    CHECK(soak["gl_buffer_bytes"]["start"].get<long>() > 10000);
    int seen = 0;
    for (const json& check : soak["checks"]) {
      const std::string name = check["name"];
      CAPTURE(name);
      CAPTURE(check["value"].dump());
      if (name == "speed_ratio") continue;  // of this machine, with whatever else runs on it
      CHECK(check["passed"] == true);
      ++seen;
    }
    CHECK(seen == 4);
    const std::string csv = read(folder.path / "s/soak.csv");
    CHECK(std::count(csv.begin(), csv.end(), '\n') == 402);
  }
  const Outcome falling = program("soak --scene rest.json --settle 0 --steps 100 --out f", folder);
  CHECK(falling.status == 1);
  CHECK(falling.err.find("drift") != std::string::npos);
  CHECK(json::parse(read(folder.path / "f/soak.json"))["passed"] == false);
}

TEST_CASE("bench writes a row a setting, with and without rendering, and calls a software renderer by its name") {
  const Folder folder;
  const Outcome run = program(
      "bench --scenes beam --modes cpu,node,paper --constraint-sets stretch,stretch+bend+volume --iterations "
      "1,2 "
      "--frames 5 "
      "--warm-up 1 --repeats 1 --size 64x48 --out b",
      folder);
  REQUIRE(run.status == 0);
  const json bench = json::parse(read(folder.path / "b/bench.json"));
  CHECK(bench["rows"].size() == 3 * 2 * 2 * 3);
  CHECK(bench["floors"]["dispatch_us"].get<double>() > 0);
  CHECK(bench["floors"]["copy_gb_s"].get<double>() > 0);
  if (bench["device"]["software"] == true) CHECK(run.out.find("SOFTWARE") != std::string::npos);
  const std::string csv = read(folder.path / "b/bench.csv");
  CHECK(
      csv.starts_with("scene,mode,constraints,iterations,substeps,size,picture,vertices,tets,fps,gpu_ms_per_step,"
                      "wall_ms_per_step,draw_ms,gpu_us_per_iteration,dispatches_per_step,gpu_bytes,max_volume_loss_"
                      "percent,motion_final,motion_rms,motion_peak,motion_relative,state_hash,copies,"
                      "copy_steps_per_second\n"));
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 37);
  for (const json& row : bench["rows"]) {
    const int iterations = row["iterations"], kinds = row["constraints"] == "stretch" ? 1 : 3;
    CHECK(row["fps"]["median"].get<double>() > 0);
    CHECK(row["max_volume_loss_percent"].is_number());
    CHECK((row["bytes_per_step"].get<long>() > 0) == (row["mode"] != "cpu"));
    CHECK(row["dispatches_per_step"] == (row["mode"] == "cpu"    ? 0
                                         : row["mode"] == "node" ? iterations
                                                                 : 2 + iterations * (kinds + 1)));
    CHECK((row["picture"] == "") == row["draw_ms"].is_null());
    CHECK((row["gpu_ms_per_step"]["median"].get<double>() > 0) == (row["mode"] != "cpu"));
  }
}

TEST_CASE("compare judges by the motion, beside a rigid body and a direct solver") {
  const Folder folder;
  const std::string
      cache = "TETPBD_CACHE=" + (folder.path / "cache").string(),
      falls =
          "compare --scene beam --set bodies.0.fixed=[] --set bodies.0.block.cells=[4,2,2] "
          "--set bodies.0.position=[0,0.1,0] --set bodies.0.rotation=[10,20,30] --steps 60 --iterations 1 ";
  // k = 1: what is not known is not judged by, and found when asked for.
  const Outcome unknown = program(falls + "--modes node --substeps 2 --out a --rigid-contact 0", folder, cache);
  REQUIRE(unknown.status == 0);
  CHECK(unknown.out.find("judged by volume") != std::string::npos);
  CHECK(unknown.out.find("--judge motion finds it") != std::string::npos);
  const std::string all = falls + "--modes rigid-body,node,cpu-double --substeps 1,20 --error 0.1 --out b";
  const Outcome hard = program(all + " --judge motion", folder, cache);
  REQUIRE(hard.status == 0);
  CHECK(hard.out.find("judged by motion") != std::string::npos);
  const json rows = json::parse(read(folder.path / "b/compare.json"))["rows"];
  REQUIRE(rows.size() == 6);
  for (const json& row : rows) {
    CAPTURE(row.dump());
    const double error = row["motion_final"].get<double>();
    CHECK((row["substeps"] == 1 || error < 1e-3));
    CHECK(row["motion_peak"].get<double>() >= row["motion_rms"].get<double>());
    CHECK(row["motion_over_time"].back()[1] == row["motion_final"]);
    CHECK(row["tet_volume_rms_peak"].is_null() == (row["mode"] == "rigid-body"));
    for (const json& other : rows)  // nothing on the front is beaten
      if (row["pareto"] == true && other["wall_ms_per_step"] < row["wall_ms_per_step"] && row["mode"] != "node" &&
          other["mode"] != "node")
        CHECK(other["motion_final"] >= row["motion_final"]);
  }
  CHECK(read(folder.path / "b/motion.svg").starts_with("<svg"));
  // What costs little is not what errs little.
  CHECK(hard.out.substr(hard.out.find("cheapest with")).find(", 20 x 1 (substeps") != std::string::npos);
  CHECK(program(all + " --judge looks", folder, cache).status == 2);

  // A material: Newton's steps are nearer than as many of Jacobi.
  const std::string soft = falls + "--material neo-hookean --young-modulus 2e5 --judge motion --out c ";
  REQUIRE(program(soft + "--modes direct,node --substeps 1,20 ", folder, cache).status == 0);
  const json softs = json::parse(read(folder.path / "c/compare.json"))["rows"];
  const auto error = [&](const char* mode, int substeps) {
    for (const json& row : softs)
      if (row["mode"] == mode && row["substeps"] == substeps) return row["motion_final"].get<double>();
    return std::nan("");
  };
  CHECK(error("direct", 20) < 0.005);
  for (const int substeps : {1, 20}) CHECK(error("direct", substeps) < error("node", substeps));
  const Outcome wrong = program(soft + "--modes rigid-body", folder, cache);
  CHECK(wrong.status == 2);
  CHECK(wrong.err.find("no baseline for this scene: rigid-body") != std::string::npos);
}

TEST_CASE("compare judges meshes and solvers together, by the motion on finer meshes (long)") {
  const Folder folder;
  std::ofstream(folder.path / "cube.obj") << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
                                             "f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 4 8 7\nf 4 7 3\n"
                                             "f 1 5 8\nf 1 8 4\nf 2 3 7\nf 2 7 6\n";
  const std::string cache = "TETPBD_CACHE=" + (folder.path / "cache").string(),
                    hangs =
                        "compare --scene beam --mesh cube.obj --material neo-hookean --young-modulus 1e4 --steps 10 "
                        "--set 'bodies.0.fixed=[{\"low\":[0,0.85,0],\"high\":[1,1,1]}]' --iterations 1 --substeps 4 ";
  const Outcome all = program(hangs +
                                  "--judge total --modes node,newton --fills tetgen,lattice:150,lattice:1000 "
                                  "--budget-ms 1e6 --out a",
                              folder, cache);
  REQUIRE(all.status == 0);
  const json rows = json::parse(read(folder.path / "a/compare.json"))["rows"];
  REQUIRE(rows.size() == 6);
  const auto error = [&](const char* fill, const char* mode) {
    for (const json& row : rows)
      if (row["fill"] == fill && row["mode"] == mode) {
        const double total = row["total_rms"].get<double>(), own = row["motion_rms"].get<double>();
        CHECK(row["total_error"].get<double>() == doctest::Approx(total + own));
        return total;
      }
    return std::nan("");
  };
  // A finer mesh is nearer with the better solver, and by far with neither.
  CHECK(error("lattice:1000", "newton") < 0.85 * error("lattice:150", "newton"));
  CHECK(error("lattice:1000", "newton") > 1e-4);
  CHECK(error("lattice:150", "newton") < 0.05);
  CHECK(error("tetgen", "newton") > 0);
  CHECK(all.out.find("judged by total: total error") != std::string::npos);
  CHECK(all.out.substr(all.out.find("best within")).find("lattice:1000") != std::string::npos);
  CHECK(read(folder.path / "a/motion.svg").find("motion on finer meshes") != std::string::npos);
  // The second time that motion is in the cache, which another mesh of the first body has not.
  CHECK(program(hangs + "--judge total --modes node --out b", folder, cache).err.find("finer") == std::string::npos);
  CHECK(program(hangs + "--judge total --modes node --truth cube.obj --out c", folder, cache).status == 0);
  CHECK(program(hangs + "--fills hexes --out d", folder, cache).err.find("no such filling: --fills hexes") !=
        std::string::npos);
  CHECK(program(hangs + "--fills lattice:many --out d", folder, cache).err.find("'many' is no number") !=
        std::string::npos);
  CHECK(program("compare --scene beam --judge total --out d", folder, cache).err.find("give them a material") !=
        std::string::npos);
}

TEST_CASE("compare finds the front, and shards merge to the same rows") {
  const Folder folder;
  const std::string command = "compare --scene beam --modes node,cpu --iterations 1,4 --substeps 1,2 --steps 12 ";
  const Outcome whole = program(command + "--out whole --budget-ms 1e9 --error 1000", folder);
  REQUIRE(whole.status == 0);
  CHECK(whole.out.find("best within") != std::string::npos);
  CHECK(whole.out.find("cheapest with") != std::string::npos);
  for (const char* shard : {"1/3", "2/3", "3/3"})
    REQUIRE(program(command + "--out part" + shard[0] + " --shard " + shard, folder).status == 0);
  REQUIRE(program("compare --merge part1 part2 part3 --out merged", folder).status == 0);
  const json a = json::parse(read(folder.path / "whole/compare.json")),
             b = json::parse(read(folder.path / "merged/compare.json"));
  CHECK(a["rows"].size() == 8);
  CHECK(b["rows"].size() == 8);
  int on_front = 0;
  for (const json& row : a["rows"]) {
    on_front += row["pareto"] == true;
    int twins = 0;
    for (const json& other : b["rows"])
      twins += row["mode"] == other["mode"] && row["iterations"] == other["iterations"] &&
               row["substeps"] == other["substeps"] &&
               row["max_volume_loss_percent"] == other["max_volume_loss_percent"] &&
               row["rigid_distance"] == other["rigid_distance"];
    CHECK(twins == 1);
    // Nothing on the front is beaten in both time and error.
    const auto cost = [](const json& r) {
      return (r["gpu_ms_per_step"].is_number() ? r["gpu_ms_per_step"] : r["wall_ms_per_step"]).get<double>();
    };
    for (const json& other : a["rows"])
      if (row["pareto"] == true)
        CHECK(!(cost(other) < cost(row) && other["max_volume_loss_percent"] < row["max_volume_loss_percent"]));
  }
  CHECK(on_front >= 1);
  CHECK(read(folder.path / "whole/compare.svg").starts_with("<svg"));
  CHECK(read(folder.path / "whole/compare.png").substr(1, 3) == "PNG");
  CHECK(read(folder.path / "whole/compare.csv")
            .starts_with("scene,mode,omega,iterations,substeps,fill,element,vertices,tets,gpu_ms_per_step"));
  CHECK(program("compare --shard 4/3", folder).status == 2);
  CHECK(program("compare --merge nowhere --out x", folder).status == 2);
  CHECK(program("compare --merge part1 part1 --out x", folder).status == 2);
  // Whole comparisons of the same scene go together as well; the paper's pipeline is a mode here.
  REQUIRE(program("compare --scene beam --modes cpu-double,paper --iterations 1 --substeps 2 --steps 12 "
                  "--out more",
                  folder)
              .status == 0);
  REQUIRE(program("compare --merge whole more --out both", folder).status == 0);
  const json both = json::parse(read(folder.path / "both/compare.json"));
  CHECK(both["rows"].size() == 10);
  CHECK(both["combinations"] == 10);
  CHECK(both["rows"][9]["mode"] == "paper");
  CHECK(program("compare --merge whole whole --out x", folder).err.find("two of these") != std::string::npos);
  CHECK(program("compare --modes nodes --out x", folder).err.find("choose from node") != std::string::npos);
}

TEST_CASE("reproduce --quick shows the paper's trends and leaves one self-contained report") {
  const Folder folder;
  const std::string models = smaller_scenes(folder, R"({"mesh": "bunny_coarse.obj", "tetgen": "pY"})");
  const Outcome run = program("reproduce --quick --out r", folder, models);
  CHECK(run.err.find("tetpbd:") == std::string::npos);  // progress alone
  REQUIRE(run.status == 0);
  const std::string html = read(folder.path / "r/report.html");
  for (const char* part : {"Table 4", "Figure 6", "Figure 7", "Figure 8", "Figure 9", "Figure 12",
                           "data:image/png;base64,iVBOR", "<svg", "drop height"})
    CHECK(html.find(part) != std::string::npos);
  CHECK(html.find("src=\"http") == std::string::npos);
  CHECK(html.ends_with("</html>\n"));
  for (const char* file : {"tables/table4.csv", "tables/volume_error_bunny.csv", "figures/volume_error_bunny_all.svg",
                           "figures/fps_all_alone.svg"})
    CHECK(fs::exists(folder.path / "r" / file));
  CHECK(read(folder.path / "r/tables/table4.csv").find("31800,10582,42072,15419,36690,31709") ==
        std::string::npos);  // quick: bunny alone
}

TEST_CASE("compare --hard-cases: a row for each case, mesh and mode, beside the reference, shards merge") {
  const Folder folder;
  const std::string common =
      "compare --hard-cases --cases coincident,mass-top --meshes tet --modes node,cpu-double --steps 30 ";
  const Outcome whole = program(common + "--out whole", folder);
  CAPTURE(whole.err);
  REQUIRE(whole.status == 0);
  const std::string csv = read(folder.path / "whole/stability.csv");
  CHECK(
      csv.starts_with("case,mesh,mode,steps,finite,recovered_at_step,final_volume_error_percent,inverted_tets,"
                      "rigid_distance,reference_recovered_at_step,"));
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 5);
  const json rows = json::parse(read(folder.path / "whole/stability.json"))["rows"];
  for (const auto& row : rows) {
    CHECK(row["finite"] == true);
    CHECK(row["steps"] == 30);
    if (row["case"] != "coincident") continue;
    CHECK(row["recovered_at_step"].get<long>() >= 1);  // it starts with a flat tet
    CHECK(row["reference_recovered_at_step"].get<long>() >= 1);
    CHECK(row["guard_direction"].get<long>() > 0);
  }
  for (int i : {1, 2})
    CHECK(program(common + "--shard " + std::to_string(i) + "/2 --out s" + std::to_string(i), folder).status == 0);
  CHECK(program("compare --hard-cases --merge s1 s2 --out merged", folder).status == 0);
  CHECK(json::parse(read(folder.path / "merged/stability.json"))["rows"] == rows);
  CHECK(program("compare --hard-cases --merge s1 --out half", folder).err.find("2 rows of 4") != std::string::npos);
  CHECK(program("compare --hard-cases --cases nosuch --out none", folder).err.find("no such scene") !=
        std::string::npos);
  CHECK(program("compare --hard-cases --meshes cow --out none", folder).err.find("choose from bunny, block, tet") !=
        std::string::npos);
}

TEST_CASE("hard cases: recovered is what stays good for the last 5 % of the steps") {
  const auto series = [](int bad) {  // 100 steps, of which so many at the start have an inverted tet
    std::vector<Measurement> measurements(101);
    for (int s = 0; s <= 100; ++s) measurements[s].step = s, measurements[s].inverted_tets = s < bad;
    return measurements;
  };
  CHECK(recovered_at(series(0), 100, true) == 0);
  CHECK(recovered_at(series(95), 100, true) == 95);
  CHECK_FALSE(recovered_at(series(96), 100, true));
  CHECK_FALSE(recovered_at(series(100), 100, true));
  CHECK_FALSE(recovered_at(series(101), 100, true));
  auto bent = series(50);
  for (Measurement& m : bent) m.rigid_distance = 0.02;  // the volume is right and the shape is not
  CHECK_FALSE(recovered_at(bent, 100, true));
  CHECK(recovered_at(bent, 100, false) == 50);
}

TEST_CASE("hard cases: where no constraint acts there is nothing to recover by") {
  const Folder folder;
  const Outcome run =
      program("compare --hard-cases --cases stiffness-0 --meshes tet --modes node --steps 2 --out h", folder);
  CHECK(run.status == 2);
  CHECK(run.err.find("nothing to run") != std::string::npos);
  CHECK(program("compare --hard-cases --out h", folder, "TETPBD_MODELS=/none").err.find("no hard cases: /none") !=
        std::string::npos);
}

TEST_CASE(
    "info --selftest: a formula that a GPU gets wrong by a thousandth fails, what it has no part in does "
    "not") {
  const Folder folder;
  fs::copy(TEST_SHADERS, folder.path / "shaders", fs::copy_options::recursive);
  const fs::path file = folder.path / "shaders/constraints/volume.glsl";
  std::string text = read(file);
  const std::string rest = "d) - rest";
  REQUIRE(text.find(rest) != std::string::npos);
  text.insert(text.find(rest) + rest.size(), " * real(1.001)");
  std::ofstream(file) << text;
  const std::string models = smaller_scenes(
      folder, R"({"mesh": null, "tetgen": null, "height": null, "block": {"size": [1, 1, 1], "cells": [3, 3, 3]}})");
  const Outcome wrong = program("--shaders shaders info --selftest", folder, models);
  CAPTURE(wrong.out);
  CHECK(wrong.status == 1);
  CHECK(wrong.err.find("a step of node against cpu-double") != std::string::npos);
  std::istringstream lines(wrong.out);
  std::string line;
  for (int failed = 0; std::getline(lines, line);)
    if (line.starts_with("FAIL")) CHECK_MESSAGE(++failed <= 3, line);
  CHECK(wrong.out.find(" of 31 checks") != std::string::npos);
  CHECK(wrong.out.find("| bunny-drop node 20x1") != std::string::npos);
}
