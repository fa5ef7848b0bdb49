// The program itself, from its command line to the files it leaves.
#include <doctest/doctest.h>
#include <png.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/app/run_program.h"

using nlohmann::json;
using run_program::Folder, run_program::Outcome, run_program::read, run_program::program;
namespace fs = std::filesystem;

namespace {

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
Blob body_of(const Picture& picture) {
  Blob blob;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      if (picture.at(x, y)[0] > picture.at(x, y)[2] + 40) ++blob.count, blob.y += y;
  if (blob.count) blob.y /= blob.count;
  return blob;
}

}  // namespace

TEST_CASE("run writes what it says, twice the same") {
  const Folder folder;
  const std::string arguments =
      "run --scene bunny-drop --mode node --steps 30 --iterations 3 --substeps 2 --set "
      "bodies.0.position=[0,0.02,0] "
      "--size 320x240 "
      "--samples 0 "
      "--png-every 15 --video fall.mp4 --positions --out ";
  const Outcome first = program(arguments + "a", folder), second = program(arguments + "b", folder);
  CHECK(first.err == "");
  REQUIRE(first.status == 0);
  REQUIRE(second.status == 0);
  const json a = json::parse(read(folder.path / "a/stats.json")), b = json::parse(read(folder.path / "b/stats.json"));
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
  for (const char* key : {"max_volume_loss_percent", "final_volume_error_percent", "tet_volume_rms", "tet_volume_max",
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

  const Picture start = read_png(folder.path / "a/frame_00000.png"), end = read_png(folder.path / "a/frame_00030.png");
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

TEST_CASE("every look and colour draws a body") {
  const Folder folder;
  int number = 0;
  for (const char* view : {"--look wire --flat", "--look tets --cut 0.6 --colour volume", "--colour stretch",
                           "--colour velocity --no-shadow --no-grid", "--flat --no-legend"}) {
    CAPTURE(view);
    const std::string out = "v" + std::to_string(number++);
    const Outcome run = program(
        "run --scene beam --steps 8 --iterations 2 --size 320x240 --samples 0 --png-every 8 --out " + out + " " + view,
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
    const Outcome outcome = program(arguments, folder);
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
  fails("run --mode fast", "node, constraint, gauss-seidel, cpu");
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
  fails("run --mesh open.off --fill tetgen", "open.off");
}

TEST_CASE("help, version, info and explain answer") {
  const Folder folder;
  CHECK(program("--version", folder).out.find('.') != std::string::npos);
  const std::string help = program("run --help", folder).out;
  for (const char* flag : {"--scene",   "--mesh",      "--tetgen", "--mode",       "--constraints", "--k-stretch",
                           "--k-bend",  "--k-volume",  "--omega",  "--iterations", "--substeps",    "--dt",
                           "--gravity", "--seed",      "--deform", "--gpu",        "--size",        "--set",
                           "--explain", "--png-every", "--video",  "--csv-every",  "--positions"})
    CHECK(help.find(flag) != std::string::npos);
  CHECK(program("info", folder).out.find("OpenGL version") != std::string::npos);
  const Outcome explained = program("run --scene beam --mode constraint --constraints stretch --explain", folder);
  CHECK(explained.status == 0);
  CHECK(explained.out.find("solvers/constraint stretch") != std::string::npos);
  CHECK(explained.out.find("volume") == std::string::npos);
  // A line of a kernel: work-groups, how often, bytes, microseconds, gigabytes per second.
  std::istringstream line(explained.out.substr(explained.out.find("solvers/constraint stretch")));
  std::string word;
  for (double number = 0; number == 0 && line >> word;) number = std::atof(word.c_str());
  double often = 0, bytes = 0, us = 0, rate = 0;
  line >> often >> bytes >> us >> rate;
  CAPTURE(explained.out);
  CHECK(often > 0);
  CHECK(us > 0);
  CHECK(rate == doctest::Approx(1e-3 * bytes / us).epsilon(0.2));
  const Outcome view = program("view", folder, "env -u DISPLAY -u WAYLAND_DISPLAY");
  CHECK(view.status == 2);
  CHECK(view.err.find("display") != std::string::npos);
}

TEST_CASE("dump-shaders writes each shader of a run as it is compiled") {
  const Folder folder;
  const auto dumped = [&](const std::string& arguments, const std::string& to) {
    const Outcome outcome = program("run --scene beam " + arguments + " --dump-shaders " + to, folder);
    CHECK(outcome.status == 0);
    std::map<std::string, std::string> texts;
    for (const auto& entry : fs::directory_iterator(folder.path / to))
      texts[entry.path().filename().string()] = read(entry.path());
    for (const auto& [name, text] : texts) {
      CAPTURE(name);
      CHECK(text.starts_with("#version 430 core\n"));
      CHECK(text.find("void main()") != std::string::npos);
      for (const char* left : {"\n#include", "#foreach", "$KIND"}) CHECK(text.find(left) == std::string::npos);
    }
    return std::pair(texts, outcome.out);
  };
  const auto [explained, table] = dumped("--mode constraint --explain", "explained");
  CHECK(explained.contains("solvers_constraint_stretch_bend_volume.comp"));
  // No two of those that the table lists share a file.
  std::istringstream lines(table.substr(table.find("work-groups")));
  std::string line;
  std::size_t kernels = 0;
  std::getline(lines, line);
  while (std::getline(lines, line) && !line.starts_with("all, in a step")) ++kernels;
  CAPTURE(table);
  CHECK(kernels >= 3);
  CHECK(explained.size() >= kernels);
  const auto [drawn, said] = dumped("--mode node --steps 1 --png-every 1 --size 32x32", "a/b");
  CHECK(drawn.contains("solvers_node_stretch_bend_volume.comp"));
  CHECK(drawn.at("solvers_node_stretch_bend_volume.comp").find("Constraint4 volume(") != std::string::npos);
  CHECK(std::ranges::any_of(drawn, [](const auto& file) { return file.first.ends_with(".vert"); }));
  CHECK(std::ranges::any_of(drawn, [](const auto& file) { return file.first.ends_with(".frag"); }));

  std::ofstream(folder.path / "file") << "of other content";
  for (const char* to : {"file", "file/below", "/proc/nothing"}) {
    const Outcome outcome = program("run --scene beam --steps 1 --out none --dump-shaders " + std::string(to), folder);
    CAPTURE(outcome.err);
    CHECK(outcome.status == 2);
    CHECK(outcome.err.starts_with("tetpbd: "));
    CHECK(outcome.err.find(to) != std::string::npos);
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(!fs::exists(folder.path / "none"));
  }
}

TEST_CASE("a driver that is not there, or too old, gets one line and status 1") {
  const Folder folder;
  const auto fails = [&](const std::string& environment, const std::string& word, int status = 1) {
    CAPTURE(environment);
    const Outcome outcome = program("run --scene beam --mode node --steps 1 --out out", folder, environment);
    CAPTURE(outcome.err);
    CHECK(outcome.status == status);
    CHECK(outcome.err.starts_with("tetpbd: "));
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(outcome.err.find(word) != std::string::npos);
    CHECK(!fs::exists(folder.path / "out/stats.json"));
  };
  fails("__EGL_VENDOR_LIBRARY_FILENAMES=/nonexistent", "no OpenGL 4.3 context");
  const std::string info = program("info", folder).out;
  if (info.find("Mesa") != std::string::npos)  // others take no orders about their version
    for (const char* version : {"4.2", "3.3"})
      fails(std::string("MESA_GL_VERSION_OVERRIDE=") + version, std::string("the driver offers ") + version);
  fails("TETPBD_SHADERS=/nonexistent", "/nonexistent/solvers/node.comp", 2);
}

TEST_CASE("a run that stops being numbers leaves those of the last good step, and says where and why") {
  const Folder folder;
  fs::copy(TEST_MODELS "/../shaders", folder.path / "shaders", fs::copy_options::recursive);
  std::string text = read(folder.path / "shaders/solvers/corrections.glsl");
  const std::string end = "stay_listed(i, x, v);";
  REQUIRE(text.find(end) != std::string::npos);
  // The free end of the beam falls: at a certain speed its numbers end.
  text.insert(text.find(end), "if ((phases & PHASE_FINISH) != 0u && v.high.y < -0.2) v.high.x = sqrt(v.high.y);\n  ");
  std::ofstream(folder.path / "shaders/solvers/corrections.glsl") << text;
  const std::string common = "--scene beam --mode node --iterations 2 --substeps 1 ";
  const Outcome bad = program("--shaders shaders run " + common + "--steps 60 --positions --out bad", folder);
  CAPTURE(bad.err);
  CHECK(bad.status == 1);
  CHECK(std::count(bad.err.begin(), bad.err.end(), '\n') == 1);
  CHECK(bad.err.find("tetpbd: the state is not finite: at step ") == 0);
  const json stats = json::parse(read(folder.path / "bad/stats.json"));
  CHECK(stats["finite"] == false);
  const long step = stats["non_finite"]["step"];
  REQUIRE(step > 3);
  CHECK(stats["non_finite"]["vertex"].is_number_unsigned());
  CHECK(stats["timing"]["steps"] == step - 1);
  // The same run without the fault, up to that step: the same numbers.
  const Outcome good =
      program("run " + common + "--steps " + std::to_string(step - 1) + " --positions --out good", folder);
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

  const Outcome compared = program(
      "--shaders shaders compare --scene beam --modes node,cpu --iterations 2 --substeps 1 --steps 60 --out "
      "c",
      folder);
  CHECK(compared.status == 0);
  CHECK(compared.err.find("the state is not finite: beam, mode node, ") != std::string::npos);
  const json rows = json::parse(read(folder.path / "c/compare.json"))["rows"];
  CHECK(rows[0]["finite"] == false);
  CHECK(rows[0]["non_finite"]["step"] == step);
  CHECK(rows[1]["finite"] == true);
  const Outcome benched = program(
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
      " run --scene beam --steps 1000000 --iterations 3 --positions-every 10 --out out 2>stderr >/dev/null";
  const int status = std::system(command.c_str());
  CHECK(WEXITSTATUS(status) != 0);
  CHECK(read(folder.path / "stderr").find("interrupted") != std::string::npos);
  const json stats = json::parse(read(folder.path / "out/stats.json"));
  CHECK(stats["timing"]["steps"].get<long>() > 0);
  CHECK(stats["timing"]["steps"].get<long>() < 1000000);
  const std::size_t frames = stats["timing"]["steps"].get<std::size_t>() / 10 + 1, n = stats["mesh"]["vertices"];
  CHECK(stats["frames"]["count"] == frames);
  CHECK(fs::file_size(folder.path / "out/trajectory.npy") == 128 + frames * n * 12);
}

TEST_CASE("a run that measures every tenth step has the same state, rows and end as one that measures all") {
  const Folder folder;
  const std::string command = "run --scene beam --iterations 2 --steps 25 ";
  REQUIRE(program(command + "--out all", folder).status == 0);
  REQUIRE(program(command + "--measure-every 10 --out some", folder).status == 0);
  const json all = json::parse(read(folder.path / "all/stats.json")),
             some = json::parse(read(folder.path / "some/stats.json"));
  CHECK(all["state_hash"] == some["state_hash"]);
  CHECK(all["error"]["tet_volume_rms"] == some["error"]["tet_volume_rms"]);
  CHECK(all["energy"]["final"] == some["energy"]["final"]);
  std::istringstream csv_all(read(folder.path / "all/stats.csv")), csv_some(read(folder.path / "some/stats.csv"));
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

TEST_CASE("the scene that a run writes gives the same run wherever it lies") {
  const Folder folder;
  const auto stats = [&](const std::string& out) { return json::parse(read(folder.path / out / "stats.json")); };
  const auto replayed = [&](const std::string& arguments) {
    CAPTURE(arguments);
    const Outcome first = program("run " + arguments + " --out a/b", folder);
    CHECK(first.err == "");
    fs::create_directories(folder.path / "elsewhere");
    fs::copy(folder.path / "a/b/scene.json", folder.path / "elsewhere", fs::copy_options::overwrite_existing);
    REQUIRE(program("run --scene elsewhere/scene.json --out c", folder).status == 0);
    CHECK(stats("a/b")["state_hash"] == stats("c")["state_hash"]);
    CHECK(stats("a/b")["settings"] == stats("c")["settings"]);
    CHECK(stats("a/b")["scene"] == stats("c")["scene"]);
    CHECK(read(folder.path / "a/b/scene.json") == read(folder.path / "c/scene.json"));
    return json::parse(read(folder.path / "c/scene.json"));
  };
  std::ofstream(folder.path / "slope.json") << R"({"bodies": [
    {"block": {"size": [0.4, 0.3, 0.2], "cells": [3, 2, 2]}, "position": [0, 0.3, 0], "velocity": [1, -1, 0.3], "rotation": [10, 20, 30],
     "heavy": [{"low": [0, 0.5, 0], "ratio": 3, "share": 0.5}], "material": "rubber"},
    {"tet": [[3, 0, 0], [4, 0, 0.1], [3, 1, 0], [3, 0, 1]], "position": [3, 1, 0], "deform": "stretch:1.3", "material": "rubber"}],
    "world": {"obstacles": [{"point": [0.1, 0, 0.3], "normal": [1, 2.7, 0.9]}], "friction": 0.3}})";
  const json slope = replayed("--scene slope.json --steps 25 --mode cpu-double --seed 4 --substeps 7");
  CHECK(slope["solver"]["constraints"] == json({"stretch", "bend", "volume"}));
  CHECK(slope["world"]["obstacles"][0]["normal"] == json({1, 2.7, 0.9}));
  CHECK(slope["camera"]["distance"] > 1);
  CHECK(stats("c")["settings"]["constraints"] == slope["solver"]["constraints"]);
  CHECK(replayed("--scene slope.json --steps 4")["solver"]["mode"] == "explicit");  // as chosen for it
  CHECK(replayed("--scene beam --constraints stretch --steps 3")["bodies"][0]["block"].is_object());

  REQUIRE(program("mesh " TEST_MODELS "/bunny.ply --out a/my.obj", folder).status == 0);
  const json own = replayed("--mesh a/my.obj --up z --height 0.5 --steps 2 --set camera.fov=20");
  CHECK(own["name"] == "bunny-drop with my.obj");
  CHECK(own["bodies"][0]["height"] == 0.5);
  CHECK(own["bodies"][0]["up"] == "z");
  CHECK(own["camera"]["fov"] == 20);
  CHECK(replayed("--scene bunny-drop --steps 1")["bodies"][0]["mesh"] == "bunny.ply");

  const Outcome numbers = program("run --scene c/stats.json", folder);
  CHECK(numbers.status == 2);
  CHECK(numbers.err.find("give c/scene.json") != std::string::npos);
}

TEST_CASE("the camera of a run turns about the bodies, or goes along a path") {
  const Folder folder;
  std::ofstream(folder.path / "path.json")
      << R"([{"time": 0, "target": [0, 1, 0], "distance": 4, "azimuth": 10, "elevation": 15}, {"time": 0.1, "azimuth": 70}])";
  const std::string run =
      "run --scene beam --set bodies.0.block.cells=[4,1,1] --mode cpu-fast --steps 20 --png-every 20 "
      "--size 96x72 --samples 0 --out ";
  const std::string still = " --set camera.target=[0,1,0] --set camera.distance=4 --set camera.elevation=15";
  REQUIRE(program(run + "path --camera-path path.json", folder).status == 0);
  REQUIRE(program(run + "turned --turntable 0.6 --set camera.azimuth=10" + still, folder).status == 0);
  for (const int azimuth : {10, 70}) {  // 0.1 s later
    const std::string out = "at" + std::to_string(azimuth);
    REQUIRE(program(run + out + " --set camera.azimuth=" + std::to_string(azimuth) + still, folder).status == 0);
    const auto frame = [&](const std::string& of) {
      return read_png(folder.path / of / (azimuth == 10 ? "frame_00000.png" : "frame_00020.png")).rgba;
    };
    CHECK(frame("path") == frame(out));
    CHECK(frame("turned") == frame(out));
  }
  const Outcome wrong = program(run + "x --camera-path none.json", folder);
  CHECK(wrong.status == 2);
  CHECK(wrong.err.find("no such camera path") != std::string::npos);
}

TEST_CASE("a mesh of one's own is in view at any size, and named") {
  const Folder folder;
  REQUIRE(program("mesh " TEST_MODELS "/bunny.ply --out my.obj", folder).status == 0);
  const std::string common = "run --mesh my.obj --steps 1 --png-every 1 --size 160x120 --samples 0 ";
  for (const char* height : {"", "--height 30", "--height 0"}) {  // 1, as the scene has it; its own 0.15
    CAPTURE(height);
    const Outcome run = program(common + height, folder);
    CHECK(run.out.find("bunny-drop with my.obj: ") != std::string::npos);
    const Picture picture = read_png(folder.path / "out/frame_00000.png");
    CHECK(body_of(picture).count > 150);
    CHECK(body_of(picture).count < 6000);
    for (int x = 0; x < picture.width; ++x)
      CHECK(picture.at(x, 0)[0] <= picture.at(x, 0)[2] + 40);  // nothing is cut off above
  }
}

TEST_CASE("frames for other programs are of the size that their heads say") {
  const Folder folder;
  const Outcome run = program(
      "run --scene beam --iterations 1 --substeps 1 --steps 7 --positions-every 3 --export vtk,pc2,ply "
      "--measure-every 5",
      folder);
  CHECK(run.err == "");
  CHECK(run.out.find("largest volume loss of measured steps ") != std::string::npos);
  CHECK(run.out.find(", worst tet at the end ") != std::string::npos);
  const fs::path out = folder.path / "out";
  const json stats = json::parse(read(out / "stats.json"));
  CHECK(stats["frames"]["count"] == 3);
  CHECK(stats["error"]["measured_every"] == 5);
  const std::size_t n = stats["mesh"]["vertices"], surface = stats["mesh"]["surface_vertices"],
                    faces = stats["mesh"]["surface_triangles"], tets = stats["mesh"]["tets"];
  const auto bytes = [&](const char* file) { return fs::file_size(out / file); };
  CHECK(bytes("trajectory.npy") == 128 + 3 * n * 12);
  CHECK(read(out / "trajectory.npy").find("'shape': (3, " + std::to_string(n) + ", 3,)") == 51);
  for (const char* file : {"positions.npy", "velocities.npy", "rest.npy"}) CHECK(bytes(file) == 128 + n * 12);
  CHECK(bytes("bodies.npy") == 128 + n * 4);
  CHECK(bytes("faces.npy") == 128 + faces * 12);
  CHECK(bytes("tets.npy") == 128 + tets * 16);
  CHECK(bytes("surface.pc2") == 32 + 3 * surface * 12);
  for (const char* file : {"vtk/frame_00000.vtu", "vtk/frame_00006.vtu", "ply/frame_00003.ply"})
    CHECK(bytes(file) > 1000);
  CHECK(read(out / "frames.pvd").find("timestep=\"0.015\" file=\"vtk/frame_00003.vtu\"") != std::string::npos);
  for (const auto& entry : fs::recursive_directory_iterator(out))
    CHECK(entry.path().string().find(".part") == std::string::npos);
  const Outcome unknown = program("run --scene beam --export fbx", folder);
  CHECK(unknown.status == 2);
  CHECK(unknown.err.find("vtk, pc2, ply") != std::string::npos);
}

TEST_CASE("a cache folder named from where one is holds meshes itself") {
  const Folder folder;
  const std::string mesh = std::string("mesh ") + TEST_MODELS + "/bunny.ply --tetgen pY";
  REQUIRE(program(mesh, folder, "TETPBD_CACHE=meshes").status == 0);
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder.path / "meshes")) files += entry.is_regular_file();
  CHECK(files == 1);
}

TEST_CASE("run: its last line is a verdict, and what starts inside something is moved out or refused") {
  const Folder folder;
  const auto run = [&](const std::string& scene, const std::string& options = "") {
    std::ofstream(folder.path / "scene.json") << scene;
    return program("run --scene scene.json --steps 20 --csv-every 0 " + options, folder);
  };
  const auto block = [](const std::string& more) {
    return R"({"bodies": [{"name": "cube", "block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, )" + more + "}]";
  };
  const Outcome fine = run(block(R"("position": [0, 1, 0])") + "}");
  CHECK(fine.status == 0);
  CHECK(fine.out.ends_with("\nverdict: right\n"));
  const Outcome deep = run(block(R"("position": [0, -0.02, 0])") + "}");
  CHECK(deep.status == 0);
  CHECK(deep.err.find("body 'cube' started 0.02 m inside the ground") != std::string::npos);
  CHECK(deep.out.find("\nverdict: doubtful: body 'cube' started inside the ground and was moved") != std::string::npos);
  const auto stats = nlohmann::json::parse(read(folder.path / "out/stats.json"));
  CHECK(stats["start_motions"][0]["work"].get<double>() == doctest::Approx(1000 * 9.81 * 0.02));
  CHECK(stats["verdict"]["level"] == "doubtful");
  CHECK(stats["energy"]["created"].get<double>() < 0.01 * stats["energy"]["scale"].get<double>());
  CHECK(stats["mesh"]["mass"].get<double>() == doctest::Approx(1000));
  CHECK(run(block(R"("position": [0, -0.02, 0])") + "}", "--strict").status == 1);
  const std::string stiff = R"(, "solver": {"mode": "node", "material": "neo-hookean", "young_modulus": 1e10}})";
  CHECK(run(block(R"("position": [0, 0.1, 0], "spin": [3, 2, 1])") + stiff).out.find("take mode newton or explicit") !=
        std::string::npos);
  const std::string flat = R"({"bodies": [{"name": "flat", "block": {"size": [1, 0.002, 1], "cells": [4, 1, 4]},
    "position": [0, 0.1, 0], "spin": [3, 2, 1]}])";
  CHECK(run(flat + stiff).out.find("the mesh has slivers, the flattest is tet ") != std::string::npos);

  const Outcome held =
      run(block(R"("position": [0, -0.2, 0], "fixed": [{"low": [0, 1, 0], "high": [1, 1, 1]}])") + "}");
  CHECK(held.status == 2);
  CHECK(held.err.find("body 'cube' in the ground") != std::string::npos);
  const Outcome none =
      run(block(R"("position": [0, 1, 0], "fixed": [{"low": [0.1, 0, 0], "high": [0.4, 1, 1]}])") + "}");
  CHECK(none.status == 2);
  CHECK(none.err.find("a fixed region holds no vertex: 'fixed.0' of body 'cube'") != std::string::npos);
  const Outcome turned = run(block(R"("position": [0, 1, 0], "fixed": [{"low": [1, 0, 0], "high": [0, 1, 1]}])") + "}");
  CHECK(turned.status == 2);
  CHECK(turned.err.find("'bodies.0.fixed.0' has a \"low\" above its \"high\"") != std::string::npos);
}

TEST_CASE("run: where surfaces cut each other it ends, if asked to look") {
  const Folder folder;
  // Neither falls; the first flies into the second, which lets it through without contact.
  std::ofstream(folder.path / "scene.json") << R"({"world": {"gravity": 0, "ground": false}, "bodies": [
    {"name": "left", "block": {"size": [1, 1, 1], "cells": [2, 2, 2]}, "velocity": [4, 0, 0]},
    {"name": "right", "block": {"size": [1, 1, 1], "cells": [3, 3, 3]}, "position": [1.101, 0.2, 0.1]}]})";
  const std::string run = "run --scene scene.json --steps 20 --csv-every 0 ";
  const Outcome through = program(run + "--contact none --check-crossings", folder);
  CHECK(through.status == 1);
  CHECK(through.out.find("\nverdict: wrong: after step 6 surfaces cut each other, ") != std::string::npos);
  CHECK(through.out.find("of body 'left' and ") != std::string::npos);
  CHECK(through.out.find("--contact bodies") != std::string::npos);
  const auto stats = nlohmann::json::parse(read(folder.path / "out/stats.json"));
  CHECK(stats["error"]["overlap_triangles"].get<int>() > 4);
  CHECK(stats["error"]["crossing_depth"].get<double>() == doctest::Approx(0.04).epsilon(0.3));
  CHECK(stats["timing"]["steps"] == 6);
  CHECK(program(run + "--contact none", folder).status == 0);
  const Outcome apart = program(run + "--contact none --check-crossings --set bodies.0.velocity=[0,0,0]", folder);
  CHECK(apart.status == 0);
  CHECK(apart.out.find("surfaces cut") == std::string::npos);
}

TEST_CASE("run: a column of mirrored cells sags without a lean, and one of equal cells leans") {
  const Folder folder;
  const auto lean = [&](const std::string& mirror) {
    std::ofstream(folder.path / "scene.json")
        << R"({"bodies": [{"block": {"size": [0.2, 0.4, 0.2], "cells": [2, 4, 2])" + mirror +
               R"(}, "fixed": [{"low": [0, 0, 0], "high": [1, 0.001, 1]}],
             "material": {"model": "neo-hookean", "young_modulus": 1e5, "poisson_ratio": 0.45}}],
             "world": {"ground": false}, "solver": {"mode": "newton", "substeps": 2, "iterations": 16, "damping": 4}})";
    CHECK(program("run --scene scene.json --steps 100", folder).status == 0);
    const std::string csv = read(folder.path / "out/stats.csv");
    const auto header = csv.substr(0, csv.find('\n')), last = csv.substr(csv.rfind('\n', csv.size() - 2) + 1);
    const auto field = [&](const std::string& row, long n) {
      std::size_t at = 0;
      for (; n > 0; --n) at = row.find(',', at) + 1;
      return std::stod(row.substr(at));
    };
    return std::abs(field(last, std::ranges::count(header.substr(0, header.find("centre_x")), ',')));
  };
  const double mirrored = lean(""), plain = lean(R"(, "mirror": false)");
  CHECK(mirrored < 1e-6);
  CHECK(plain > 1e-4);
}
