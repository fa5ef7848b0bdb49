// Pages of compare and map: whole in one file, and what a browser makes of them.
#include <doctest/doctest.h>
#include <png.h>

#include "app/lab/report.h"
#include "tests/app/run_program.h"

using namespace tetpbd;
using namespace run_program;

namespace {

long count(const std::string& text, const std::string& part) {
  long times = 0;
  for (std::size_t at = 0; (at = text.find(part, at)) != text.npos; at += part.size()) ++times;
  return times;
}

// Nothing outside is asked for: what is shown is data, and the only address is the name of SVG.
void check_closed(const std::string& html) {
  CHECK(count(html, "http") == count(html, "http://www.w3.org/2000/svg"));
  for (const char* from : {"<link", "<iframe", "@import", "src=\"/", "fetch(", "src=\"f"})
    CHECK_MESSAGE(html.find(from) == html.npos, std::string(from));
}

/// A browser's picture of the page as the address `hash` shows it: how many pixels are of each colour.
std::vector<unsigned char> screenshot(const Folder& folder, const std::string& page, const std::string& hash) {
  const fs::path shot = folder.path / "shot.png";
  fs::remove(shot);
  const std::string command =
      "chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --host-resolver-rules='MAP * "
      "~NOTFOUND' --user-data-dir=" +
      (folder.path / "profile").string() +
      " --window-size=1200,1000 --virtual-time-budget=500 --screenshot=" + shot.string() + " 'file://" +
      (folder.path / page).string() + hash + "' >/dev/null 2>&1";
  REQUIRE(std::system(command.c_str()) == 0);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  REQUIRE(png_image_begin_read_from_file(&png, shot.c_str()));
  png.format = PNG_FORMAT_RGBA;
  std::vector<unsigned char> pixels(PNG_IMAGE_SIZE(png));
  REQUIRE(png_image_finish_read(&png, nullptr, pixels.data(), 0, nullptr));
  return pixels;
}

}  // namespace

TEST_CASE("report: text that looks like HTML is text, and bytes are themselves in a table") {
  const std::string html = html_table({"a", "b"}, {{{"<b>&\"", "1"}, "data:x", true}, {{"2", ""}}}, true);
  CHECK(html.find("<td>&lt;b&gt;&amp;&quot;</td>") != html.npos);
  CHECK(html.find("<tr class=\"marked\" data-row=\"0\" data-film=\"data:x\">") != html.npos);
  CHECK(html.find("<tr data-row=\"1\">") != html.npos);
  const Folder folder;
  for (const auto& [bytes, text] : {std::pair("", ""), {"M", "TQ=="}, {"Ma", "TWE="}, {"Man", "TWFu"}}) {
    std::ofstream(folder.path / "bytes") << bytes;
    CHECK(data_uri(folder.path / "bytes") == "data:image/png;base64," + std::string(text));
  }
  CHECK(data_uri(folder.path / "none") == "");
}

TEST_CASE("report: compare and map leave a page with a row, a point and a film each, merged ones too") {
  const Folder folder;
  const std::string small = "--scene beam --set bodies.0.block.cells=[4,2,2] ";
  const std::string compare = "compare " + small + "--modes node,cpu --iterations 1,4 --steps 12 ";
  REQUIRE(program(compare + "--out c", folder).status == 0);
  const std::string html = read(folder.path / "c/compare.html");
  check_closed(html);
  CHECK(count(html, "<tr data-row=") + count(html, "<tr class=\"marked\" data-row=") == 4);
  CHECK(count(html, "<circle data-row=") >= 1);  // those with an error that a logarithm shows
  CHECK(count(html, "data-film=\"data:image/png;base64,iVBOR") == 4);
  CHECK(read(folder.path / "c/compare.svg").find("data-row") == std::string::npos);
  for (const char* shard : {"1", "2"})
    REQUIRE(program(compare + "--shard " + shard + "/2 --out part" + shard, folder).status == 0);
  REQUIRE(program("compare --merge part1 part2 --out merged", folder).status == 0);
  CHECK(count(read(folder.path / "merged/compare.html"), "data-film=\"data:image/png;base64,iVBOR") == 4);
  REQUIRE(program("map " + small + "--set duration=0.05 --x omega=0.5,1 --y iterations=1,2,5 --out m", folder).status ==
          0);
  const std::string map = read(folder.path / "m/map.html");
  check_closed(map);
  CHECK(count(map, "<rect data-row=") == 6);
  CHECK(count(map, "data-film=\"data:image/png;base64,iVBOR") == 6);
  CHECK(map.find(">omega</th><th>iterations</th>") != map.npos);

  if (std::system("command -v chromium >/dev/null") != 0) {
    MESSAGE("SKIPPED, there is no chromium: what a browser makes of the pages was not looked at");
    return;
  }
  for (const char* page : {"c/compare.html", "m/map.html"}) {
    const auto plain = screenshot(folder, page, ""), first = screenshot(folder, page, "#row=0"),
               last = screenshot(folder, page, "#row=3");
    const auto differing = [](const auto& a, const auto& b) {
      REQUIRE(a.size() == b.size());
      long pixels = 0;
      for (std::size_t i = 0; i < a.size(); i += 4) pixels += !std::equal(&a[i], &a[i] + 4, &b[i]);
      return pixels;
    };
    CHECK(differing(plain, first) > 20000);  // a picture of 240 x 180 that was not there
    CHECK(differing(first, last) > 500);     // another row's
  }
}
