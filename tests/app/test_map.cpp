// tetpbd map: cells of two settings, held against the reference motion, and their picture.
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>

#include "app/lab/chart.h"
#include "tests/app/run_program.h"

using namespace tetpbd;
using namespace run_program;

TEST_CASE("map: a cell for each pair of values, in the order given, held against its own reference motion") {
  const Folder folder;
  const std::string small = "map --scene beam --set bodies.0.block.cells=[4,2,2] --set duration=0.1 ";
  REQUIRE(program(small + "--material springs --young-modulus 1e5 --mode node --substeps 2 --x iterations=1,8 "
                          "--y young_modulus=1e4:1e6:3 --out m",
                  folder)
              .status == 0);
  const auto document = nlohmann::ordered_json::parse(std::ifstream(folder.path / "m/map.json"));
  const auto& rows = document["rows"];
  REQUIRE(rows.size() == 6);
  const char* expected[][2] = {{"1", "1e+04"}, {"8", "1e+04"}, {"1", "1e+05"},
                               {"8", "1e+05"}, {"1", "1e+06"}, {"8", "1e+06"}};
  for (std::size_t i = 0; i < 6; ++i) {
    CHECK(rows[i]["x"] == expected[i][0]);
    CHECK(rows[i]["y"] == expected[i][1]);
    CHECK(rows[i]["finite"] == true);
    const double error = rows[i]["motion_rms"];
    CHECK(error > 0);
    CHECK(error < 0.1);
  }
  // Iterations count where the body is stiff.
  CHECK(double(rows[5]["motion_rms"]) < 0.8 * double(rows[4]["motion_rms"]));
  CHECK(double(rows[1]["motion_rms"]) < 0.5 * double(rows[4]["motion_rms"]));
  // As a run of its own is.
  REQUIRE(program("compare --scene beam --set bodies.0.block.cells=[4,2,2] --material springs --young-modulus 1e5 "
                  "--modes node --substeps 2 --iterations 8 --steps 20 --judge motion --out c",
                  folder)
              .status == 0);
  const auto compared = nlohmann::json::parse(std::ifstream(folder.path / "c/compare.json"))["rows"][0];
  CHECK(double(rows[3]["motion_rms"]) == doctest::Approx(double(compared["motion_rms"])).epsilon(1e-3));
  CHECK(std::filesystem::exists(folder.path / "m/map.svg"));
  for (const auto& [flags, said] : {std::pair("--x omega", "'omega' has no values"),
                                    {"--x mode=1,2", "'mode' cannot be '1'"},
                                    {"--y dt=1:x:3", "'x' is no number"},
                                    {"--y dt=0.1:0.2:1", "bad number of values"},
                                    {"--x omega=9", "'omega' cannot be 9"},
                                    {"--x k_stretch=0.5 --mode explicit --material none", "needs forces"}}) {
    const Outcome outcome = program(small + std::string(flags) + " --out bad", folder);
    CAPTURE(outcome.err);
    CHECK(outcome.status == 2);
    CHECK(outcome.err.find(said) != std::string::npos);
  }
  CHECK_FALSE(std::filesystem::exists(folder.path / "bad/map.csv"));
  // By the rule, in a mode that does not go as far as the last value.
  REQUIRE(program("map --scene beam --set bodies.0.block.cells=[4,2,2] --set duration=0.02 --material springs "
                  "--stability 0.01 --mode explicit --x young_modulus=1e4,1e12 --y damping=0,1 --out far",
                  folder)
              .status == 0);
  const auto far = nlohmann::json::parse(std::ifstream(folder.path / "far/map.json"))["rows"];
  CHECK(far[0]["finite"] == true);
  CHECK(far[1]["finite"] == false);
  CHECK(std::string(far[1]["refused"]).find("too stiff for mode explicit") != std::string::npos);
  CHECK(program("map --scene soft-beam --set bodies.0.block.cells=[4,2,2] --set duration=0.01 --x damping=0,1 --y "
                "dt=0.005 --out rule",
                folder)
            .status == 0);
}

TEST_CASE("map: its picture has a cell of the error's colour each, and says where one fails") {
  const auto row = [](const char* x, const char* y, nlohmann::ordered_json error, nlohmann::ordered_json failed) {
    return nlohmann::ordered_json{{"x", x},
                                  {"y", y},
                                  {"finite", failed.is_null()},
                                  {"failed_at_step", failed},
                                  {"motion_rms", error},
                                  {"max_volume_loss_percent", 3.0}};
  };
  nlohmann::ordered_json document = {{"scene", "a<b"}, {"mode", "node"}, {"tets", 7},
                                     {"seconds", 1.5}, {"x", "omega"},   {"y", "dt"}};
  document["rows"] = {row("1", "0.1", 1e-6, nullptr), row("2", "0.1", 1.0, nullptr), row("1", "0.2", nullptr, 17),
                      row("2", "0.2", 0.01, nullptr)};
  const std::string svg = map_svg(document);
  for (const char* part : {"a&lt;b: dt against omega", "distance from the reference motion", ">fails at 17<",
                           ">0.0001<", ">100<", ">1<", "fill=\"#333333\"", "fill=\"#304f94\"", "fill=\"#d64533\""})
    CHECK_MESSAGE(svg.find(part) != std::string::npos, std::string(part));
  document["rows"] = {row("1", "0.1", nullptr, nullptr)};
  const std::string again = map_svg(document);
  CHECK(again.find("largest net volume loss") != std::string::npos);
  CHECK(again.find(">3<") != std::string::npos);
}

TEST_CASE("map: a setting that each body has of its own is no axis") {
  const Folder folder;
  std::ofstream(folder.path / "own.json") << R"({"bodies": [{"block": {}, "material": "foam"},
    {"block": {}, "position": [0, 1.2, 0], "material": "rubber"}]})";
  const Outcome run = program("map --scene own.json --x young_modulus=1e4,1e5 --y dt=0.005,0.01 --out m", folder);
  CHECK(run.status == 2);
  CHECK(run.err.find("each body has a material of its own: young_modulus") != std::string::npos);
}
