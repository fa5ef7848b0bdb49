// Filling surfaces with TetGen, and the cache of its meshes.
#include <doctest/doctest.h>

#include <chrono>
#include <cmath>

#include "app/mesh_command.h"
#include "mesh_samples.h"
#include "sim/mesh/mesh_cache.h"
#include "sim/mesh/tetgen_switches.h"

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
  for (const char* switches : {"prY", "pYR", "pYi", "pYm", "pYd", "pYw", "pYc", "pYs"}) {
    CAPTURE(switches);
    CHECK(contains(error(switches), "does something else than mesh a surface: TetGen switches '"));
  }
  for (const char* switches : {"pN", "pE", "pB", "pf", "pe", "pn", "pv", "pg", "pk", "pF", "pI", "ph"}) {
    CAPTURE(switches);
    CHECK(contains(error(switches), "is about TetGen's own files"));
  }
  CHECK(contains(error("pYK"), "there is no switch 'K'"));
  CHECK(contains(error("pY q"), "there is no switch ' '"));
  CHECK(contains(error("qY"), "'p' is missing"));
  CHECK(contains(error(""), "'p' is missing"));
  CHECK(contains(error("pYa"), "'a' without a number"));
  CHECK(contains(error("pYo2"), "second-order"));
  CHECK(error("pYo2").starts_with("2 "));
  CHECK(contains(error(std::string(500, 'p').c_str()), "too long"));
}

#if TETPBD_TETGEN

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
  CHECK(contains(error(joined(cube({0, 0, 0}, 3), cube({1, 1, 1}))),
                 "parts of the surface lie inside one another: "));
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

TEST_CASE("cache: a file that was meshed before is not parsed again") {
  Folder folder;
  const fs::path file = folder.path / "bunny.ply";
  fs::copy_file(fs::path(TEST_MODELS) / "bunny.ply", file);
  const TetMesh made = load_mesh(file, "pY");
  fs::path mesh_kept, source;
  for (const auto& entry : fs::directory_iterator(folder.cache()))
    (entry.path().extension() == ".source" ? source : mesh_kept) = entry.path();
  const auto key = source_key(file, "pY");
  REQUIRE(key);
  REQUIRE(read_mesh_of(*key));
  CHECK(read_mesh_of(*key)->tets == made.tets);
  CHECK(load_mesh(file, "pY").positions == made.positions);
  CHECK(source_key(file, "pYq") != key);
  CHECK(!source_key(folder.path, "pY"));
  // Damage to the note, or to the mesh it names, costs time alone.
  const std::string note = content(source), mesh = content(mesh_kept);
  for (const fs::path& damaged : {source, mesh_kept}) {
    std::string bytes = content(damaged);
    bytes[bytes.size() - 3] ^= 1;
    std::ofstream(damaged, std::ios::binary) << bytes;
    CHECK(!read_mesh_of(*key));
    CHECK(load_mesh(file, "pY").tets == made.tets);
    CHECK((content(source) == note && content(mesh_kept) == mesh));
  }
  // Other bytes are another file, and a damaged one is refused whatever is kept.
  std::ofstream(file, std::ios::binary | std::ios::app) << "x";
  CHECK(source_key(file, "pY") != key);
  std::ofstream(file, std::ios::binary) << content(fs::path(TEST_MODELS) / "bunny.ply").substr(0, 5000);
  CHECK(error_of([&] { load_mesh(file, "pY"); }) != "");
}

TEST_CASE("mesh command: reports, writes, passes errors on") {
  Folder folder;
  const fs::path bunny = fs::path(TEST_MODELS) / "bunny.ply";
  CHECK(run_mesh_command(bunny, "pY", folder.path / "bunny.msh", false) == 0);
  CHECK(load_tets(folder.path / "bunny.msh").tets.size() == 9736);
  CHECK(run_mesh_command(folder.path / "bunny.msh", "", {}, true) == 0);
  CHECK(contains(error_of([&] { run_mesh_command(folder.path / "none.ply", "pY", {}, false); }),
                 "no such file"));
  CHECK(contains(error_of([&] { run_mesh_command(bunny, "pY", folder.path / "a.b", true); }),
                 "unknown mesh format"));
}

#endif
