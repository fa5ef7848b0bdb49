// Filling surfaces with TetGen, and the cache of its meshes.
#include <doctest/doctest.h>

#include <chrono>
#include <cmath>

#include "app/commands.h"
#include "sim/mesh/cache.h"
#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

TEST_CASE("switches: what meshes a surface passes, with Q added once") {
  CHECK(checked_switches("pY") == "pYQ");
  CHECK(checked_switches("-pYQ") == "pYQ");
  CHECK(checked_switches("pYq1.85o/140") == "pYq1.85o/140Q");
  CHECK(checked_switches("pYq1.414/18o/140a1.25e-6") == "pYq1.414/18o/140a1.25e-6Q");
}

TEST_CASE("switches: what does not is refused") {
  const auto error = [](const char* switches) { return error_of([&] { checked_switches(switches); }); };
  for (const char* switches :
       {"prY", "pYR", "pYi", "pYm", "pYd", "pYw", "pYc", "pYs", "pN",   "pE",  "pB",   "pf", "pe",
        "pn",  "pv",  "pg",  "pk",  "pF",  "pI",  "ph",  "pYK", "pY q", "pYa", "pYo2", "pY-"}) {
    CAPTURE(switches);
    CHECK(contains(error(switches), "is not for filling a surface: TetGen switches '"));
  }
  CHECK(contains(error("pYr2"), "'r2' is not for"));
  CHECK(contains(error("qY"), "'p' is missing"));
  CHECK(contains(error(""), "'p' is missing"));
  CHECK(error("pYo2").starts_with("2 "));
  CHECK(contains(error(std::string(500, 'p').c_str()), "too long"));
}

TEST_CASE("tetgen: the shipped models' counts") {
  Folder folder;
  const struct {
    const char *name, *switches;
    std::size_t vertices, triangles, edges, faces, tets, slivers;
    int euler, genus;
  } rows[] = {{"bunny.ply", "pY", 2990, 5976, 15713, 22460, 9736, 776, 1, 0},
              {"bunny.ply", "pYq1.85o/140", 3474, 5976, 17266, 24598, 10805, 0, 1, 0},
              {"armadillo.ply", "pY", 6362, 12720, 32312, 45542, 19591, 894, 1, 0},
              {"armadillo.ply", "pYq1.85o/140", 7284, 12720, 35746, 50566, 22103, 0, 1, 0},
              {"dragon.ply", "pY", 5291, 10582, 27158, 38443, 16576, 455, 0, 1},
              {"dragon.ply", "pYq1.85o/140", 5889, 10582, 28812, 40555, 17632, 0, 0, 1},
              {"dragon_21k.ply", "pY", 10582, 21164, 55431, 79116, 34267, 1682, 0, 1},
              {"dragon_21k.ply", "-pYq1.85o/140Q", 12214, 21164, 61133, 87256, 38337, 0, 0, 1}};
  for (const auto& row : rows) {
    CAPTURE(row.name);
    CAPTURE(row.switches);
    const TetMesh mesh = load_mesh(fs::path(TEST_MODELS) / row.name, row.switches);
    const MeshReport r = report(mesh);
    CHECK(r.vertices == row.vertices);
    CHECK(r.surface_triangles == row.triangles);
    CHECK(r.edges == row.edges);
    CHECK(r.faces == row.faces);
    CHECK(r.tets == row.tets);
    CHECK(r.slivers == row.slivers);
    CHECK(r.bends == row.triangles * 3 / 2);
    CHECK(r.euler_characteristic == row.euler);
    CHECK(r.genus == row.genus);
    CHECK(r.components == 1);
    CHECK(r.inverted == 0);
    SurfaceMesh surface{mesh.positions, mesh.surface};
    CHECK(check_surface(surface).flipped_triangles == 0);
    CHECK(check_surface(surface).volume == doctest::Approx(r.volume));
  }
}

TEST_CASE("tetgen: with Y the surface's vertices come first and stay") {
  Folder folder;
  const SurfaceMesh surface = load_surface(fs::path(TEST_MODELS) / "bunny.ply");
  const TetMesh mesh = tetrahedralise(surface, "pYq1.85o/140");
  REQUIRE(mesh.positions.size() > surface.positions.size());
  CHECK(std::equal(surface.positions.begin(), surface.positions.end(), mesh.positions.begin()));
}

TEST_CASE("tetgen: parts, turned surfaces, units") {
  Folder folder;
  CHECK(mesh_volume(tetrahedralise(cube(), "pY")) == doctest::Approx(1));
  const TetMesh two = tetrahedralise(joined(cube(), cube({3, 0, 0})), "pYq");
  CHECK(report(two).components == 2);
  CHECK(mesh_volume(two) == doctest::Approx(2));
  SurfaceMesh turned = cube();
  for (Triangle& t : turned.triangles) std::swap(t[0], t[1]);
  CHECK(mesh_volume(tetrahedralise(turned, "pY")) == doctest::Approx(1));
  CHECK(mesh_volume(tetrahedralise(cube({0, 0, 0}, 1e-3), "pY")) == doctest::Approx(1e-9));
}

TEST_CASE("tetgen: defects are named with their source") {
  Folder folder;
  const auto error = [](const SurfaceMesh& s) {
    const std::string text = error_of([&] { tetrahedralise(s, "pY", 60, "FILE.ply"); });
    CAPTURE(text);
    CHECK(contains(text, "FILE.ply: "));
    CHECK(text.starts_with("2 "));
    return text;
  };
  CHECK(contains(error(joined(tetrahedron(), tetrahedron(glm::dvec3(0.2)))),
                 "surface intersects itself: 3 pairs of triangles, first near (0.333333, 0.333333, 0.333333) "
                 "in FILE.ply: "));
  CHECK(contains(error(joined(cube(), cube({0.5, 0.25, 0.125}))), "surface intersects itself: "));
  SurfaceMesh open = cube();
  open.triangles.pop_back();
  CHECK(contains(error(open), "surface is open: 3 edges with one triangle only"));
  CHECK(contains(error({}), "too few triangles"));
  CHECK(!fs::exists(folder.cache()));  // no failure is kept
}

TEST_CASE("tetgen: the time limit ends it") {
  Folder folder;
  const auto start = std::chrono::steady_clock::now();
  const std::string text = error_of([] { tetrahedralise(cube(), "pq1.1a1e-8", 0.3, "a cube"); });
  CHECK(contains(text, "took longer than 0.3 s: a cube: "));
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(20));
}

TEST_CASE("tetgen: a program that is named is run, one that is missing is one clear line") {
  Folder folder;
  ::setenv("TETPBD_TETGEN_PROGRAM", "/nowhere/tetgen", 1);
  const std::string missing = error_of([] { tetrahedralise(cube(), "pY", 60, "a cube"); });
  folder.write("own", "#!/bin/sh\necho $1 >$0.switches\nexec tetgen \"$@\"\n");
  fs::permissions(folder.path / "own", fs::perms::owner_all);
  ::setenv("TETPBD_TETGEN_PROGRAM", (folder.path / "own").c_str(), 1);
  const TetMesh mesh = tetrahedralise(cube(), "pYq");
  ::unsetenv("TETPBD_TETGEN_PROGRAM");
  CHECK(missing ==
        "2 TetGen cannot be started, so surfaces cannot be filled: /nowhere/tetgen: install the package "
        "tetgen, or name the program in TETPBD_TETGEN_PROGRAM");
  CHECK(mesh_volume(mesh) == doctest::Approx(1));
  std::string switches;
  std::ifstream(folder.path / "own.switches") >> switches;
  CHECK(switches == "-pYqQF");
}

namespace {

fs::path only_file(const fs::path& folder) {
  fs::path found;
  int count = 0;
  for (const auto& entry : fs::directory_iterator(folder)) found = entry.path(), ++count;
  CHECK(count == 1);
  return found;
}

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_CASE("cache: the second time the mesh is read") {
  Folder folder;
  const TetMesh made = tetrahedralise(cube(), "pYq");
  CHECK(only_file(folder.cache()).extension() == ".tets");
  // A mesher that gets no time fails, so these come from the cache.
  for (const char* switches : {"pYq", "-pYqQ"}) {
    const TetMesh kept = tetrahedralise(cube(), switches, 0);
    CHECK(kept.positions == made.positions);
    CHECK(kept.tets == made.tets);
    CHECK(kept.surface == made.surface);
  }
  CHECK(contains(error_of([] { tetrahedralise(cube(), "pY", 0); }), "took longer than 0 s"));
}

TEST_CASE("cache: damaged files are remade") {
  Folder folder;
  const TetMesh made = tetrahedralise(cube(), "pYq");
  const fs::path file = only_file(folder.cache());
  const std::string bytes = content(file);
  const std::size_t places[] = {0, 10, 20, 35, 60, bytes.size() / 2, bytes.size() - 1};
  for (const std::size_t place : places) {
    CAPTURE(place);
    std::string damaged = bytes;
    damaged[place] = static_cast<char>(damaged[place] ^ 0x10);
    std::ofstream(file, std::ios::binary) << damaged;
    CHECK(contains(error_of([] { tetrahedralise(cube(), "pYq", 0); }), "took longer"));  // not read
    CHECK(tetrahedralise(cube(), "pYq").tets == made.tets);
    CHECK(content(file) == bytes);
  }
  for (const std::size_t size : {bytes.size() - 1, std::size_t{30}, std::size_t{0}}) {
    std::ofstream(file, std::ios::binary) << bytes.substr(0, size);
    CHECK(tetrahedralise(cube(), "pYq").tets == made.tets);
    CHECK(content(file) == bytes);
  }
  tetrahedralise(cube(), "pY");
  tetrahedralise(cube({0, 0, 1e-9}), "pYq");
  CHECK(std::distance(fs::directory_iterator(folder.cache()), fs::directory_iterator()) == 3);
}

TEST_CASE("cache: a folder that cannot be written is no error") {
  Folder folder;
  folder.write("file", "in the way");
  ::setenv("TETPBD_CACHE", (folder.path / "file" / "cache").c_str(), 1);
  CHECK(mesh_volume(tetrahedralise(cube(), "pY")) == doctest::Approx(1));
  ::setenv("TETPBD_CACHE", "/proc/none/cache", 1);
  CHECK(mesh_volume(tetrahedralise(cube(), "pY")) == doctest::Approx(1));
}

TEST_CASE("mesh command: reports, writes, passes errors on") {
  Folder folder;
  const fs::path bunny = fs::path(TEST_MODELS) / "bunny.ply";
  CHECK(run_mesh_command({.file = bunny, .filled = {.tetgen = "pY"}, .out = folder.path / "bunny.msh"}) == 0);
  CHECK(load_tets(folder.path / "bunny.msh").tets.size() == 9736);
  CHECK(run_mesh_command({.file = folder.path / "bunny.msh", .json = true}) == 0);
  CHECK(contains(error_of([&] { run_mesh_command({.file = folder.path / "none.ply"}); }), "no such file"));
  CHECK(contains(error_of([&] { run_mesh_command({.file = bunny, .out = folder.path / "a.b"}); }),
                 "unknown mesh format"));
}
