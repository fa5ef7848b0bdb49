// The program itself, from its command line to the files it leaves.
#include <doctest/doctest.h>
#include <png.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

struct Folder {
  fs::path path = fs::temp_directory_path() / ("tetpbd_run_" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
};

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

struct Outcome {
  int status;
  std::string out, err;
};

Outcome tetpbd(const std::string& arguments, const Folder& folder, const std::string& environment = "") {
  const std::string out = (folder.path / "stdout").string(), err = (folder.path / "stderr").string();
  const int status = std::system(("cd " + folder.path.string() + " && " + environment + " " TEST_PROGRAM " " +
                                  arguments + " >" + out + " 2>" + err)
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(out), read(err)};
}

struct Picture {
  int width = 0, height = 0;
  std::vector<unsigned char> rgba;
  const unsigned char* at(int x, int y) const { return &rgba[std::size_t(4 * (y * width + x))]; }
};

Picture read_png(const fs::path& file) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&png, file.c_str()));
  png.format = PNG_FORMAT_RGBA;
  Picture picture{int(png.width), int(png.height), std::vector<unsigned char>(PNG_IMAGE_SIZE(png))};
  REQUIRE(png_image_finish_read(&png, nullptr, picture.rgba.data(), 0, nullptr));
  return picture;
}

// The body is warm clay on grey: where red exceeds blue by far.
struct Blob {
  int count = 0;
  double y = 0;
};
[[maybe_unused]] Blob body_of(const Picture& picture) {
  Blob blob;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      if (picture.at(x, y)[0] > picture.at(x, y)[2] + 40) ++blob.count, blob.y += y;
  if (blob.count) blob.y /= blob.count;
  return blob;
}

}  // namespace

#ifdef TETPBD_TETGEN  // the bunny is a surface
TEST_CASE("run writes what it says, twice the same") {
  const Folder folder;
  const std::string arguments =
      "run --scene bunny-drop --steps 30 --iterations 3 --set bodies.0.position=[0,0.02,0] --size 320x240 "
      "--samples 0 "
      "--png-every 15 --video fall.mp4 --positions --out ";
  const Outcome first = tetpbd(arguments + "a", folder), second = tetpbd(arguments + "b", folder);
  CHECK(first.err == "");
  REQUIRE(first.status == 0);
  REQUIRE(second.status == 0);
  const json a = json::parse(read(folder.path / "a/stats.json")),
             b = json::parse(read(folder.path / "b/stats.json"));
  CHECK(a["state_hash"] == b["state_hash"]);
  CHECK(a["scene"] == "bunny-drop");
  CHECK(a["settings"]["iterations"] == 3);
  CHECK(a["settings"]["omega"] == 1.5);
  CHECK(a["mesh"]["vertices"] == 3474);
  CHECK(a["mesh"]["surface_triangles"] == 5976);
  CHECK(a["mesh"]["edges"] == 17266);
  CHECK(a["mesh"]["bends"] == 8964);
  CHECK(a["mesh"]["tets"] == 10805);
  CHECK(a["mesh"]["euler_characteristic"] == 1);
  CHECK(a["mesh"]["volume"].get<double>() == doctest::Approx(0.2087).epsilon(1e-3));
  CHECK(a["device"]["gl_renderer"].get<std::string>() != "");
  CHECK(a["timing"]["steps"] == 30);
  for (const char* key : {"gpu_ms_per_step", "wall_ms_per_step"}) {
    CHECK(a["timing"][key]["median"].get<double>() > 0);
    CHECK(a["timing"][key]["p05"] <= a["timing"][key]["median"]);
    CHECK(a["timing"][key]["p95"] >= a["timing"][key]["median"]);
  }
  CHECK(a["timing"]["fps"].get<double>() > 0);
  for (const char* key :
       {"max_volume_loss_percent", "final_volume_error_percent", "tet_volume_rms", "tet_volume_max",
        "inverted_tets", "stretch_rms", "stretch_max", "bend_rms_rad", "rigid_distance"})
    CHECK(a["error"][key].is_number());
  CHECK(a["error"]["max_volume_loss_percent"] > 0);
  CHECK(a["momentum"]["linear_drift"].get<double>() < 1e-4);
  CHECK(a["momentum"]["angular_drift"].is_number());
  CHECK(a["finite"] == true);
  CHECK(a["energy"]["start"].get<double>() > a["energy"]["final"].get<double>());

  std::istringstream csv(read(folder.path / "a/stats.csv"));
  int rows = 0;
  std::string line, header;
  std::getline(csv, header);
  while (std::getline(csv, line)) {
    CHECK(std::count(line.begin(), line.end(), ',') == std::count(header.begin(), header.end(), ','));
    ++rows;
  }
  CHECK(rows == 31);

  const Picture start = read_png(folder.path / "a/frame_00000.png"),
                end = read_png(folder.path / "a/frame_00030.png");
  CHECK(start.width == 320);
  CHECK(start.height == 240);
  CHECK(body_of(start).count > 1000);
  CHECK(body_of(end).count > 1000);
  CHECK(body_of(end).y > body_of(start).y + 1);  // it fell: further down in the picture
  CHECK(fs::exists(folder.path / "a/frame_00015.png"));

  CHECK(read(folder.path / "a/positions.npy").size() == 128 + 3474 * 12);
  CHECK(read(folder.path / "a/positions.npy").substr(1, 5) == "NUMPY");
  CHECK(read(folder.path / "a/tets.npy").size() == 128 + 10805 * 16);
  CHECK(fs::file_size(folder.path / "fall.mp4") > 1000);
  CHECK(read(folder.path / "fall.mp4").substr(4, 4) == "ftyp");
  for (const auto& entry : fs::recursive_directory_iterator(folder.path))
    CHECK(entry.path().string().find(".part") == std::string::npos);
}

#endif

TEST_CASE("every look and colour draws a body") {
  const Folder folder;
  int number = 0;
  for (const char* view : {"--look wire --flat", "--look tets --cut 0.6 --colour volume", "--colour stretch",
                           "--colour velocity --no-shadow --no-grid", "--flat --no-legend"}) {
    CAPTURE(view);
    const std::string out = "v" + std::to_string(number++);
    const Outcome run =
        tetpbd("run --scene beam --steps 8 --iterations 2 --size 320x240 --samples 0 --png-every 8 --out " +
                   out + " " + view,
               folder);
    CHECK(run.status == 0);
    CHECK(run.err == "");
    const Picture picture = read_png(folder.path / out / "frame_00008.png");
    int different = 0;
    const Picture first = read_png(folder.path / out / "frame_00000.png");
    for (std::size_t i = 0; i < picture.rgba.size(); ++i) different += picture.rgba[i] != first.rgba[i];
    CHECK(different > 100);
  }
}

TEST_CASE("mistakes get one line, status 2 and no files") {
  const Folder folder;
  const auto fails = [&](const std::string& arguments, const std::string& word, int status = 2) {
    CAPTURE(arguments);
    const Outcome outcome = tetpbd(arguments, folder);
    CHECK(outcome.status == status);
    CHECK(outcome.err.starts_with("tetpbd: "));
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CAPTURE(outcome.err);
    CHECK(outcome.err.find(word) != std::string::npos);
    CHECK(!fs::exists(folder.path / "out/stats.json"));
  };
  fails("run --scene none-such", "bunny-drop");
  fails("run --no-such-flag", "--no-such-flag");
  fails("run --omega lots", "--omega");
  fails("run --mode fast", "node, constraint, cpu");
  fails("run --size 10", "--size");
  fails("run --look nice", "surface, wire, tets");
  fails("run --scene beam --gpu 99", "--gpu 99");
  fails("run --steps 0", "--steps");
  fails("run --set a", "PATH=VALUE");
  fails("run --mesh missing.ply", "missing.ply");
  fails("run --scene beam --steps 1 --out /proc/nothing", "/proc/nothing");
  fails("run --scene beam --steps 1 --video film.doc", "film.doc");
  fails("--shaders /none info", "/none");
  fails("mesh missing.obj", "missing.obj");
  fails("wobble", "wobble");
  std::ofstream(folder.path / "open.off") << "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  fails("mesh open.off", "open.off");
  fails("run --mesh open.off", "open.off");
}

TEST_CASE("help, version, info and explain answer") {
  const Folder folder;
  CHECK(tetpbd("--version", folder).out.find('.') != std::string::npos);
  const std::string help = tetpbd("run --help", folder).out;
  for (const char* flag :
       {"--scene",   "--mesh",      "--tetgen", "--mode",       "--constraints", "--k-stretch",
        "--k-bend",  "--k-volume",  "--omega",  "--iterations", "--substeps",    "--dt",
        "--gravity", "--seed",      "--deform", "--gpu",        "--size",        "--set",
        "--explain", "--png-every", "--video",  "--csv-every",  "--positions"})
    CHECK(help.find(flag) != std::string::npos);
  CHECK(tetpbd("info", folder).out.find("OpenGL version") != std::string::npos);
  const Outcome explained =
      tetpbd("run --scene beam --mode constraint --constraints stretch --explain", folder);
  CHECK(explained.status == 0);
  CHECK(explained.out.find("solve_constraint stretch") != std::string::npos);
  CHECK(explained.out.find("volume") == std::string::npos);
  const Outcome view = tetpbd("view", folder, "env -u DISPLAY -u WAYLAND_DISPLAY");
  CHECK(view.status == 2);
  CHECK(view.err.find("display") != std::string::npos);
}

TEST_CASE("a driver that is not there, or too old, gets one line and status 1") {
  const Folder folder;
  const auto fails = [&](const std::string& environment, const std::string& word, int status = 1) {
    CAPTURE(environment);
    const Outcome outcome = tetpbd("run --scene beam --steps 1 --out out", folder, environment);
    CAPTURE(outcome.err);
    CHECK(outcome.status == status);
    CHECK(outcome.err.starts_with("tetpbd: "));
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(outcome.err.find(word) != std::string::npos);
    CHECK(!fs::exists(folder.path / "out/stats.json"));
  };
  fails("__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent", "no OpenGL 4.3 context");
  const std::string info = tetpbd("info", folder).out;
  if (info.find("Mesa") != std::string::npos)  // others take no orders about their version
    for (const char* version : {"4.2", "3.3"})
      fails(std::string("MESA_GL_VERSION_OVERRIDE=") + version, std::string("the driver offers ") + version);
  fails("TETPBD_SHADERS=/nonexistent", "/nonexistent/predict.comp", 2);
}

TEST_CASE("a run that stops being numbers leaves those of the last good step, and says where and why") {
  const Folder folder;
  fs::copy(TEST_MODELS "/../shaders", folder.path / "shaders", fs::copy_options::recursive);
  std::string text = read(folder.path / "shaders/vertex.glsl");
  const std::string end = "positions[i] = Position(";
  REQUIRE(text.find(end) != std::string::npos);
  // The free end of the beam falls: at a certain speed its numbers end.
  text.insert(text.find(end),
              "if ((phase & PHASE_FINISH) != 0u && v.high.y < -0.2) v.high.x = sqrt(v.high.y);\n  ");
  std::ofstream(folder.path / "shaders/vertex.glsl") << text;
  const std::string common = "--scene beam --iterations 2 --substeps 1 ";
  const Outcome bad = tetpbd("--shaders shaders run " + common + "--steps 60 --positions --out bad", folder);
  CAPTURE(bad.err);
  CHECK(bad.status == 1);
  CHECK(std::count(bad.err.begin(), bad.err.end(), '\n') == 1);
  CHECK(bad.err.find("tetpbd: the state is not finite: at step ") == 0);
  CHECK(bad.err.find("likely cause: a shader of shaders") != std::string::npos);
  const json stats = json::parse(read(folder.path / "bad/stats.json"));
  CHECK(stats["finite"] == false);
  const long step = stats["non_finite"]["step"];
  REQUIRE(step > 3);
  CHECK(stats["non_finite"]["vertex"].is_number_unsigned());
  CHECK(stats["timing"]["steps"] == step - 1);
  // The same run without the fault, up to that step: the same numbers.
  const Outcome good =
      tetpbd("run " + common + "--steps " + std::to_string(step - 1) + " --positions --out good", folder);
  REQUIRE(good.status == 0);
  const json right = json::parse(read(folder.path / "good/stats.json"));
  CHECK(right["finite"] == true);
  CHECK(right["non_finite"].is_null());
  for (const char* key : {"error", "momentum", "energy", "state_hash"}) CHECK(stats[key] == right[key]);
  CHECK(read(folder.path / "bad/positions.npy") == read(folder.path / "good/positions.npy"));
  for (const char* file : {"bad/stats.json", "bad/stats.csv"})
    for (const char* word : {"nan", "inf"}) CHECK(read(folder.path / file).find(word) == std::string::npos);
  const std::string csv = read(folder.path / "bad/stats.csv");
  CHECK(csv.ends_with(",0\n"));
  CHECK(std::count(csv.begin(), csv.end(), '\n') == step + 2);

  const Outcome compared = tetpbd(
      "--shaders shaders compare --scene beam --modes node,cpu --iterations 2 --substeps 1 --steps 60 --out "
      "c",
      folder);
  CHECK(compared.status == 0);
  CHECK(compared.err.find("the state is not finite: mode node, ") != std::string::npos);
  const json rows = json::parse(read(folder.path / "c/compare.json"))["rows"];
  CHECK(rows[0]["finite"] == false);
  CHECK(rows[0]["non_finite"]["step"] == step);
  CHECK(rows[1]["finite"] == true);
  const Outcome benched = tetpbd(
      "--shaders shaders bench --scenes beam --modes node --constraint-sets stretch+bend+volume --iterations "
      "2 --frames 60 --warm-up 0 --repeats 1 --no-render --out b",
      folder);
  CHECK(benched.status == 1);
  CHECK(benched.err.find("tetpbd: the state is not finite: beam, mode node") == 0);
  const json row = json::parse(read(folder.path / "b/bench.json"))["rows"][0];
  CHECK(row["finite"] == false);
  CHECK(row["fps"]["median"].is_null());
  CHECK(read(folder.path / "b/bench.csv").find("nan") == std::string::npos);
}

TEST_CASE("an interrupted run leaves whole files") {
  const Folder folder;
  const std::string command =
      "cd " + folder.path.string() +
      " && timeout -s INT 6 " TEST_PROGRAM
      " run --scene beam --steps 1000000 --iterations 3 --out out 2>stderr >/dev/null";
  const int status = std::system(command.c_str());
  CHECK(WEXITSTATUS(status) != 0);
  CHECK(read(folder.path / "stderr").find("interrupted") != std::string::npos);
  const json stats = json::parse(read(folder.path / "out/stats.json"));
  CHECK(stats["timing"]["steps"].get<long>() > 0);
  CHECK(stats["timing"]["steps"].get<long>() < 1000000);
}

TEST_CASE("soak: a block at rest neither drifts nor grows, one that falls does not pass") {
  const Folder folder;
  std::ofstream(folder.path / "rest.json")
      << R"({"name": "rest", "bodies": [{"name": "block", "block": {"size": [1, 0.5, 0.5], "cells": [4, 2, 2]},
             "position": [0, 0.02, 0]}], "solver": {"iterations": 10}})";
  for (const char* mode : {"node", "constraint"}) {
    CAPTURE(mode);
    tetpbd("soak --scene rest.json --settle 600 --steps 400 --out s --mode " + std::string(mode), folder);
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
  const Outcome falling = tetpbd("soak --scene rest.json --settle 0 --steps 100 --out f", folder);
  CHECK(falling.status == 1);
  CHECK(falling.err.find("drift") != std::string::npos);
  CHECK(json::parse(read(folder.path / "f/soak.json"))["passed"] == false);
}

TEST_CASE("a run that measures every tenth step has the same state, rows and end as one that measures all") {
  const Folder folder;
  const std::string command = "run --scene beam --iterations 2 --steps 25 ";
  REQUIRE(tetpbd(command + "--out all", folder).status == 0);
  REQUIRE(tetpbd(command + "--measure-every 10 --out some", folder).status == 0);
  const json all = json::parse(read(folder.path / "all/stats.json")),
             some = json::parse(read(folder.path / "some/stats.json"));
  CHECK(all["state_hash"] == some["state_hash"]);
  CHECK(all["error"]["tet_volume_rms"] == some["error"]["tet_volume_rms"]);
  CHECK(all["energy"]["final"] == some["energy"]["final"]);
  std::istringstream csv_all(read(folder.path / "all/stats.csv")),
      csv_some(read(folder.path / "some/stats.csv"));
  std::vector<std::string> rows, few;
  for (std::string line; std::getline(csv_all, line);) rows.push_back(line);
  for (std::string line; std::getline(csv_some, line);) few.push_back(line);
  REQUIRE(rows.size() == 27);
  REQUIRE(few.size() == 5);  // header, 0, 10, 20, 25
  CHECK(few[0] == rows[0]);
  CHECK(few[1] == rows[1]);
  CHECK(few[2].substr(0, few[2].find(',')) == "10");
  CHECK(few[4].substr(0, few[4].find(',')) == "25");
}

TEST_CASE(
    "bench writes a row a setting, with and without rendering, and calls a software renderer by its name") {
  const Folder folder;
  const Outcome run = tetpbd(
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
  CHECK(csv.starts_with(
      "scene,mode,constraints,iterations,substeps,size,picture,vertices,tets,fps,gpu_ms_per_step,"
      "wall_ms_per_step,draw_ms,gpu_us_per_iteration,dispatches_per_step,gpu_bytes,max_volume_loss_"
      "percent\n"));
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

TEST_CASE("compare finds the front, and shards merge to the same rows") {
  const Folder folder;
  const std::string command =
      "compare --scene beam --modes node,cpu --iterations 1,4 --substeps 1,2 --steps 12 ";
  const Outcome whole = tetpbd(command + "--out whole --budget-ms 1e9 --error 1000", folder);
  REQUIRE(whole.status == 0);
  CHECK(whole.out.find("best within") != std::string::npos);
  CHECK(whole.out.find("cheapest with") != std::string::npos);
  for (const char* shard : {"1/3", "2/3", "3/3"})
    REQUIRE(tetpbd(command + "--out part" + shard[0] + " --shard " + shard, folder).status == 0);
  REQUIRE(tetpbd("compare --merge part1 part2 part3 --out merged", folder).status == 0);
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
        CHECK(
            !(cost(other) < cost(row) && other["max_volume_loss_percent"] < row["max_volume_loss_percent"]));
  }
  CHECK(on_front >= 1);
  CHECK(read(folder.path / "whole/compare.svg").starts_with("<svg"));
  CHECK(read(folder.path / "whole/compare.png").substr(1, 3) == "PNG");
  CHECK(read(folder.path / "whole/compare.csv")
            .starts_with("scene,mode,omega,iterations,substeps,vertices,tets,gpu_ms_per_step"));
  CHECK(tetpbd("compare --shard 4/3", folder).status == 2);
  CHECK(tetpbd("compare --merge nowhere --out x", folder).status == 2);
  CHECK(tetpbd("compare --merge part1 part1 --out x", folder).status == 2);
  // Whole comparisons of the same scene go together as well; node+handles and the paper's pipeline are modes
  // here.
  REQUIRE(
      tetpbd(
          "compare --scene beam --modes node+handles,paper --iterations 1 --substeps 2 --steps 12 --out more",
          folder)
          .status == 0);
  REQUIRE(tetpbd("compare --merge whole more --out both", folder).status == 0);
  const json both = json::parse(read(folder.path / "both/compare.json"));
  CHECK(both["rows"].size() == 10);
  CHECK(both["combinations"] == 10);
  CHECK(both["rows"][8]["mode"] == "node+handles");
  CHECK(tetpbd("compare --merge whole whole --out x", folder).err.find("two of these") != std::string::npos);
  CHECK(tetpbd("compare --modes node+handle --out x", folder).err.find("node+handles") != std::string::npos);
}

#ifdef TETPBD_TETGEN
TEST_CASE("reproduce --quick shows the paper's trends and leaves one self-contained report") {
  const Folder folder;
  const Outcome run = tetpbd("reproduce --quick --out r", folder);
  CHECK(run.err == "");
  REQUIRE(run.status == 0);
  const std::string html = read(folder.path / "r/report.html");
  for (const char* part : {"Table 4", "Figure 6", "Figure 7", "Figure 8", "Figure 9", "Figure 12",
                           "data:image/png;base64,iVBOR", "<svg", "drop height"})
    CHECK(html.find(part) != std::string::npos);
  CHECK(html.find("src=\"http") == std::string::npos);
  for (const char* file : {"tables/table4.csv", "tables/volume_error_bunny.csv",
                           "figures/volume_error_bunny_all.svg", "figures/fps_all_alone.svg"})
    CHECK(fs::exists(folder.path / "r" / file));
  CHECK(read(folder.path / "r/tables/table4.csv").find("31800,10582,42072,15419,36690,31709") ==
        std::string::npos);  // quick: bunny alone
}
#endif

TEST_CASE("compare --hard-cases: a row for each case, mesh and mode, beside the reference; shards merge") {
  const Folder folder;
  const std::string common =
      "compare --hard-cases --cases coincident,mass-top --meshes tet --modes node,cpu-double --steps 30 ";
  const Outcome whole = tetpbd(common + "--out whole", folder);
  CAPTURE(whole.err);
  REQUIRE(whole.status == 0);
  const std::string csv = read(folder.path / "whole/stability.csv");
  CHECK(csv.starts_with(
      "case,mesh,mode,steps,finite,recovered_at_step,final_volume_error_percent,inverted_tets,"
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
    CHECK(tetpbd(common + "--shard " + std::to_string(i) + "/2 --out s" + std::to_string(i), folder).status ==
          0);
  CHECK(tetpbd("compare --hard-cases --merge s1 s2 --out merged", folder).status == 0);
  CHECK(json::parse(read(folder.path / "merged/stability.json"))["rows"] == rows);
  CHECK(tetpbd("compare --hard-cases --merge s1 --out half", folder).err.find("2 rows of 4") !=
        std::string::npos);
  CHECK(tetpbd("compare --hard-cases --cases nosuch --out none", folder).err.find("no such scene") !=
        std::string::npos);
  CHECK(tetpbd("compare --hard-cases --meshes cow --out none", folder)
            .err.find("choose from bunny, block, tet") != std::string::npos);
}
