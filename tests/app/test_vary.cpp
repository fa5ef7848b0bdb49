// The grammar of settings that are set or vary, the same in --vary, lists, lanes and --set.
#include <doctest/doctest.h>

#include <algorithm>

#include "app/lab/vary.h"
#include "app/scene.h"
#include "app/window/lanes.h"
#include "sim/error.h"
#include "sim/model/material.h"
#include "tests/app/run_program.h"

using namespace tetpbd;

TEST_CASE("vary: lists, ranges, words, sets of kinds and presets are values") {
  const auto values = [](const char* text) { return parse_variation(text, "--vary").values; };
  using Words = std::vector<std::string>;
  CHECK(values("omega=0.5,1") == Words{"0.5", "1"});
  CHECK(values("substeps=1:40:4") == Words{"1", "3", "12", "40"});  // by equal factors, as its slider goes
  CHECK(values("iterations=1:2:5") == Words{"1", "2"});
  CHECK(values("young_modulus=1e4:1e6:3") == Words{"1e+04", "1e+05", "1e+06"});
  CHECK(values("young-modulus=1e4") == Words{"1e4"});
  CHECK(values("mode=node,rigid-body") == Words{"node", "rigid-body"});
  CHECK(values("constraints=stretch,stretch+bend") == Words{"stretch", "stretch+bend"});
  CHECK(values("material=none,rubber") == Words{"none", "rubber"});
  CHECK(values("ground=true,false") == Words{"true", "false"});
  for (const auto& [text, said] : {std::pair("omga=1", "did you mean 'omega'?"),
                                   {"omega", "'omega' has no values"},
                                   {"omega=", "write omega=A,B or omega=FROM:TO:COUNT"},
                                   {"omega=9", "'omega' cannot be 9"},
                                   {"omega=1:2:1", "give 2 to 100"},
                                   {"omega=1:x:3", "'x' is no number"},
                                   {"constraints=stretch+bnd", "did you mean 'bend'?"},
                                   {"material=ruber", "cannot be"},
                                   {"seed=1,2", "'seed' does not vary"}}) {
    CAPTURE(text);
    CHECK_THROWS_WITH_AS(parse_variation(text, "--vary"), doctest::Contains(said), Error);
  }
}

TEST_CASE("vary: combinations are a product, and the mode is set before what depends on it") {
  Settings base;
  base.material = "neo-hookean", base.substeps = 3;
  const std::vector<Settings> all =
      combine(base, {parse_variation("substeps=2,5", ""), parse_variation("mode=node,newton", "")});
  REQUIRE(all.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(all[i].mode == (i % 2 ? "newton" : "node"));
    CHECK(all[i].substeps == (i < 2 ? 2 : 5));
  }
  CHECK(combine(base, {}) == std::vector{base});
  const Settings rubber = combine(base, {parse_variation("material=rubber", "")})[0];
  CHECK(rubber.poisson_ratio == 0.48);
  CHECK(combine(Settings(), {parse_variation("constraints=stretch+volume", "")})[0].constraints == "stretch,volume");
  // Tables have their order, whoever is named first; the second of one setting takes the first one's place.
  std::vector<Variation> rows = parse_variations({"substeps=1,2", "mode=node", "omega=1"});
  vary(rows, parse_variation("mode=cpu,explicit", ""));
  REQUIRE(rows.size() == 3);
  CHECK(rows[0].values == std::vector<std::string>{"cpu", "explicit"});
  CHECK(rows[2].row->name == "substeps");
  const auto distinct = without_repeats(combine(base, rows));
  CHECK(distinct.size() == 3);  // mode explicit chooses its substeps
  CHECK(distinct[2].substeps == automatic);
}

TEST_CASE("vary: a lane, --set and a flag set by the same words") {
  const std::string words = "material=rubber,constraints=stretch+volume,mode=explicit";
  Settings lane = lane_settings(Settings(), words, "--lane");
  CHECK(lane.constraints == "stretch,volume");
  CHECK_THROWS_WITH_AS(lane_settings(lane, "omga=1", "--lane"), doctest::Contains("did you mean 'omega'?"), Error);
  const auto set = [](std::vector<std::string> given) {
    return load_scene("beam", {.set = std::move(given)}).settings;
  };
  const Settings by_flag = load_scene("beam", {.parameters = {{"omega", "1.25"}, {"material", "foam"}}}).settings;
  CHECK(set({"omega=1.25", "material=foam"}) == by_flag);
  CHECK(set({"solver.omega=1.25"}).omega == 1.25);
  CHECK(material_of(set({"material=rubber", "bodies.0.young_modulus=2e4"}), 0).young_modulus == 2e4);
  CHECK_FALSE(load_scene("beam", {.set = {"mode=cpu"}}).mode_open);
  CHECK_THROWS_WITH_AS(set({"omga=1"}), doctest::Contains("did you mean 'omega'?"), Error);
  CHECK_THROWS_WITH_AS(set({"duratoin=1"}), doctest::Contains("did you mean 'duration'?"), Error);
  CHECK_THROWS_WITH_AS(set({"omega=9"}), doctest::Contains("--set omega=9"), Error);
}

TEST_CASE("vary: words vary in maps, sets of kinds in compare") {
  const run_program::Folder folder;
  const std::string beam = " --scene beam --set bodies.0.block.cells=[2,1,1] --steps 3 ";
  const auto rows = [&](const std::string& command, const char* file) {
    const auto outcome = run_program::program(command, folder);
    REQUIRE_MESSAGE(outcome.status == 0, outcome.err);
    return run_program::read(folder.path / file);
  };
  const std::string map =
      rows("map" + beam + "--vary mode=node,cpu --vary constraints=stretch,stretch+bend --out m", "m/map.csv");
  CHECK(map.find("\ncpu,stretch+bend,") != std::string::npos);
  const std::string compare =
      "compare" + beam + "--modes node --iterations 1 --judge volume --vary constraints=stretch,stretch+bend ";
  const std::string csv = rows(compare + "--out c", "c/compare.csv");
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 3);
  for (const char* shard : {"1", "2"}) rows(compare + "--shard " + shard + "/2 --out s" + shard, "s1/compare.csv");
  const std::string merged = rows("compare --merge s1 s2 --out merged", "merged/compare.csv");
  CHECK(std::count(merged.begin(), merged.end(), '\n') == 3);
}
