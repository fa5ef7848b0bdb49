// Tetrahedral meshes: blocks, boundary, files, reports.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

namespace {

TetMesh block_without(const glm::ivec3& cells, const std::function<bool(const glm::dvec3&)>& removed) {
  TetMesh mesh = make_block(glm::dvec3(cells), cells);  // cells of one metre
  std::erase_if(mesh.tets, [&](const Tet& t) {
    return removed((mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]] + mesh.positions[t[3]]) / 4.0);
  });
  finish_tets(mesh, "test");
  return mesh;
}

void check_same(const TetMesh& a, const TetMesh& b) {
  CHECK(a.positions == b.positions);
  CHECK(a.tets == b.tets);
  CHECK(a.surface == b.surface);
}

const std::string node4 = "# four\n4 3 0 0\n1 0 0 0\n2 1 0 0 # x\n3 0 1 0\n\n4 0 0 1\n";

}  // namespace

TEST_CASE("block: counts, volume, masses, bounds") {
  const glm::dvec3 size(2, 1, 0.5);
  const glm::ivec3 cells(4, 3, 2);
  const TetMesh mesh = make_block(size, cells);
  CHECK(mesh.positions.size() == 5 * 4 * 3);
  CHECK(mesh.tets.size() == 6 * 24);
  CHECK(mesh.surface.size() == 4 * (12 + 8 + 6));
  CHECK(mesh_volume(mesh) == doctest::Approx(1));
  for (const Tet& t : mesh.tets) CHECK(tet_volume(mesh, t) == doctest::Approx(1.0 / 144));
  const auto masses = lumped_masses(mesh, 1200);
  CHECK(std::accumulate(masses.begin(), masses.end(), 0.0) == doctest::Approx(1200));
  CHECK(*std::min_element(masses.begin(), masses.end()) > 0);
  const Bounds box = bounds(mesh.positions);
  CHECK(glm::length(box.centre()) < 1e-12);
  CHECK(glm::length(box.high - box.low - size) < 1e-12);
  SurfaceMesh surface{mesh.positions, mesh.surface};  // the boundary is a sound surface, outward as it is
  const SurfaceCheck check = check_surface(surface);
  CHECK(check.defect == "");
  CHECK(check.flipped_triangles == 0);
  CHECK(check.volume == doctest::Approx(1));
}

TEST_CASE("block: one corner tet gives its vertex a quarter of its mass") {
  TetMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {}};
  finish_tets(mesh, "test");
  for (const double m : lumped_masses(mesh, 24)) CHECK(m == doctest::Approx(1));
  CHECK(tet_edges(mesh) == std::vector<std::array<std::uint32_t, 2>>{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}});
}

TEST_CASE("report: a block, a ring, a cavity, two parts") {
  const MeshReport block = report(make_block({1, 1, 1}, {3, 3, 3}));
  CHECK(block.euler_characteristic == 1);
  CHECK(block.genus == 0);
  CHECK(block.components == 1);
  CHECK(block.bends == 3 * block.surface_triangles / 2);
  CHECK(block.surface_vertices == 64 - 8);
  CHECK(block.min_dihedral_deg == doctest::Approx(45));
  CHECK(block.max_dihedral_deg == doctest::Approx(90));
  CHECK(block.slivers == 0);
  CHECK(block.inverted == 0);
  CHECK(block.volume == doctest::Approx(1));
  CHECK(block.smallest_tet_volume == doctest::Approx(block.mean_tet_volume));

  const MeshReport ring =
      report(block_without({3, 3, 1}, [](const glm::dvec3& c) { return std::abs(c.x) < 0.5 && std::abs(c.y) < 0.5; }));
  CHECK(ring.tets == 48);
  CHECK(ring.euler_characteristic == 0);
  CHECK(ring.genus == 1);
  const MeshReport hollow = report(block_without({3, 3, 3}, [](const glm::dvec3& c) {
    return std::max({std::abs(c.x), std::abs(c.y), std::abs(c.z)}) < 0.5;
  }));
  CHECK(hollow.euler_characteristic == 2);  // a shell
  CHECK(hollow.genus == 0);
  const TetMesh halves = block_without({3, 1, 1}, [](const glm::dvec3& c) { return std::abs(c.x) < 0.5; });
  CHECK(halves.positions.size() == 16);
  CHECK(report(halves).components == 2);
  CHECK(report(halves).euler_characteristic == 2);

  TetMesh turned = make_block({1, 1, 1}, {1, 1, 1});
  std::swap(turned.tets[2][0], turned.tets[2][1]);
  CHECK(report(turned).inverted == 1);
  TetMesh sliver{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0.01}, {0, 1, 0}}, {{0, 1, 2, 3}}, {}};
  finish_tets(sliver, "test");
  CHECK(report(sliver).slivers == 1);
}

TEST_CASE("finish: orients tets, drops unused vertices, faces outward") {
  TetMesh mesh{{{9, 9, 9}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{1, 3, 2, 4}}, {{0, 0, 0}}};
  finish_tets(mesh, "test");
  CHECK(mesh.positions.size() == 4);
  CHECK(tet_volume(mesh, mesh.tets[0]) == doctest::Approx(1.0 / 6));
  CHECK(mesh.surface.size() == 4);
  CHECK(signed_volume({mesh.positions, mesh.surface}) == doctest::Approx(1.0 / 6));
}

TEST_CASE("finish: what is no mesh is refused") {
  const TetMesh good = make_block({1, 1, 1}, {2, 1, 1});
  const auto error = [](TetMesh mesh) { return error_of([&] { finish_tets(mesh, "SOURCE"); }); };
  CHECK(error(good) == "");
  TetMesh bad = good;
  bad.tets.clear();
  CHECK(contains(error(bad), "2 mesh has no tetrahedron: SOURCE: "));
  bad = good;
  bad.tets[3][2] = 12;
  CHECK(contains(error(bad), "tet 3 names vertex 12 of 12: SOURCE: "));
  bad = good;
  bad.tets[3][2] = bad.tets[3][0];
  CHECK(contains(error(bad), "tet 3 names a vertex twice: SOURCE: "));
  bad = good;
  bad.positions[4].x = NAN;
  CHECK(contains(error(bad), "position of vertex 4 is not finite: SOURCE: "));
  bad = good;
  for (auto& p : bad.positions) p.y = 0;
  CHECK(contains(error(bad), "tets have no volume: 12 of them, first tet 0 near "));
  bad = good;
  bad.tets.push_back(bad.tets[0]);
  CHECK(contains(error(bad), "tets 0 and 12 overlap"));
  bad = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.1, 0.1, 0.5}}, {{0, 1, 2, 3}, {0, 1, 2, 4}}, {}};
  CHECK(contains(error(bad), "tets 0 and 1 overlap"));
  bad = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {0.2, 0.2, -1}},
         {{0, 1, 2, 3}, {0, 2, 1, 4}, {0, 2, 1, 5}},
         {}};  // a face with three tets, the first two on opposite sides
  CHECK(contains(error(bad), "overlap"));
}

TEST_CASE("finish: small and large units give the same mesh") {
  for (const double scale : {1e-6, 1.0, 1e6}) {
    TetMesh mesh = make_block(glm::dvec3(scale), {2, 2, 2});
    CHECK(mesh.surface.size() == 48);
    CHECK(report(mesh).euler_characteristic == 1);
  }
}

TEST_CASE("tet files: every writer's file reads back the same") {
  Folder folder;
  TetMesh mesh = make_block({1.0 / 3, 0.7, 1e-3}, {3, 2, 1});
  for (const char* name : {"a.node", "b.ele", "c.msh"}) {
    CAPTURE(name);
    write_mesh(folder.path / name, mesh);
    check_same(load_tets(folder.path / name), mesh);
    check_same(load_mesh(folder.path / name, "unused"), mesh);
  }
  CHECK(fs::exists(folder.path / "a.ele"));
  CHECK(fs::exists(folder.path / "b.node"));
  for (const char* name : {"d.ply", "d.obj", "d.off", "d.stl"}) {
    CAPTURE(name);
    write_mesh(folder.path / name, mesh);
    SurfaceMesh surface = load_surface(folder.path / name);
    const SurfaceCheck check = check_surface(surface);
    CHECK(check.defect == "");
    CHECK(check.flipped_triangles == 0);
    CHECK(surface.triangles.size() == mesh.surface.size());
    CHECK(surface.positions.size() == report(mesh).surface_vertices);
    CHECK(check.volume == doctest::Approx(mesh_volume(mesh)).epsilon(1e-5));
  }
  for (const auto& entry : fs::directory_iterator(folder.path)) CHECK(!contains(entry.path().string(), ".part"));
}

TEST_CASE("tet files: writing is whole or not at all") {
  Folder folder;
  const TetMesh mesh = make_block({1, 1, 1}, {1, 1, 1});
  CHECK(contains(error_of([&] { write_mesh(folder.path / "none" / "a.msh", mesh); }), "1 cannot be written: "));
  CHECK(contains(error_of([&] { write_mesh(folder.path / "a.vtk", mesh); }), "unknown mesh format '.vtk'"));
  fs::create_directory(folder.path / "b.ele");
  CHECK(contains(error_of([&] { write_mesh(folder.path / "b.node", mesh); }), "cannot be written"));
  CHECK(!fs::exists(folder.path / "b.node"));
  for (const auto& entry : fs::directory_iterator(folder.path)) CHECK(entry.path().filename() == "b.ele");
}

TEST_CASE("tet files: node and ele, from 0 or 1, comments, attributes, second order") {
  Folder folder;
  folder.write("one.node", node4);
  folder.write("one.ele", "1 4 0\n1 1 2 3 4\n# end\n");
  folder.write("zero.node", "4 3 1 1\n0 0 0 0 7.5 1\n1 1 0 0 7.5 1\n2 0 1 0 7.5 1\n3 0 0 1 7.5 1\n");
  folder.write("zero.ele", "1 10 1\n0 1 0 2 3 4 5 6 7 8 9 1\n");
  for (const char* name : {"one.ele", "one.node", "zero.ele"}) {
    CAPTURE(name);
    const TetMesh mesh = load_tets(folder.path / name);
    CHECK(mesh.positions.size() == 4);
    CHECK(mesh_volume(mesh) == doctest::Approx(1.0 / 6));
  }
}

TEST_CASE("tet files: bad node and ele") {
  Folder folder;
  const auto error = [&](const std::string& node, const std::string& ele) {
    folder.write("x.node", node);
    folder.write("x.ele", ele);
    const std::string text = error_of([&] { load_tets(folder.path / "x.ele"); });
    CHECK(text.starts_with("2 "));
    return text;
  };
  const std::string ele = "1 4 0\n1 1 2 3 4\n";
  CHECK(contains(error(node4, "1 4 0\n1 1 2 3 5\n"), "tet names node 5, outside 1 .. 4: "));
  CHECK(contains(error(node4, "1 4 0\n1 1 2 3 5\n"), "x.ele line 2"));
  CHECK(contains(error(node4, "2 4 0\n1 1 2 3 4\n"), "ends before its last tet"));
  CHECK(contains(error(node4, "2000000000 4 0\n1 1 2 3 4\n"), "bytes can hold"));
  CHECK(contains(error(node4, "1 4 0\n1 1 2 3\n"), "line has no node of the tet"));
  CHECK(contains(error(node4, "1 3 0\n1 1 2 3\n"), "3 nodes per tet"));
  CHECK(contains(error("4 2 0 0 # and a comment long enough for four nodes\n", ele), "not three-dimensional"));
  CHECK(contains(error("4 3 0 0\n1 0 0 zero # and a comment as above\n", ele), "'zero' is not a number"));
  CHECK(contains(error("4 3 0 0\n5 0 0 0 # and a comment as above\n", ele), "neither 0 nor 1"));
  CHECK(contains(error("2 3 0 0\n1 0 0 0\n3 0 0 0\n", ele), "node 3 stands where 2 should"));
  CHECK(contains(error("4 3 0 0\n1 1e300 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n", ele), "further out than 1e+30"));
  CHECK(contains(error("-4 3 0 0\n", ele), "number of nodes is -4"));
  fs::remove(folder.path / "x.node");
  CHECK(contains(error_of([&] { load_tets(folder.path / "x.ele"); }), "no such file"));
  CHECK(contains(error_of([&] { load_mesh(folder.write("x.txt", "1"), ""); }), "unknown mesh format"));
  CHECK(contains(error_of([&] { load_mesh(folder.path, ""); }), "is a folder"));
}

TEST_CASE("tet files: msh 4.1 and 2.2 with other elements, sparse numbers, unused nodes") {
  Folder folder;
  const std::string v4 =
      "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 1\n1 0 0 0 1 1 1 0 0\n$EndEntities\n"
      "$Nodes\n2 5 10 70\n2 1 0 1\n99\n5 5 5\n3 1 0 4\n10\n20\n30\n70\n0 0 0\n1 0 0\n0 1 0\n0 0 "
      "1\n$EndNodes\n"
      "$Elements\n2 2 1 2\n2 1 2 1\n1 10 20 30\n3 1 4 1\n2 20 10 30 70\n$EndElements\n";
  const std::string v2 =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n10 0 0 0\n20 1 0 0\n30 0 1 0\n70 0 0 1e0\n$EndNodes\n"
      "$Elements\n3\n1 15 2 0 1 10\n2 2 2 0 1 10 20 30\n3 4 3 0 1 0 10 20 30 70\n$EndElements\n";
  for (const auto& text : {v4, v2}) {
    const TetMesh mesh = load_tets(folder.write("m.msh", text));
    CHECK(mesh.positions.size() == 4);
    CHECK(mesh.tets.size() == 1);
    CHECK(mesh_volume(mesh) == doctest::Approx(1.0 / 6));
  }
  const auto error = [&](std::string text, const std::string& part, const std::string& by) {
    const std::size_t at = text.find(part);
    REQUIRE(at != std::string::npos);
    folder.write("m.msh", text.replace(at, part.size(), by));
    return error_of([&] { load_tets(folder.path / "m.msh"); });
  };
  CHECK(contains(error(v4, "4.1 0 8", "4.1 1 8"), "binary file does not say the order of its bytes"));
  CHECK(contains(error(v4, "4.1 0 8", "4 0 8"), ".msh version 4 is not supported"));
  CHECK(contains(error(v4, "$MeshFormat\n4.1", "$Comments\n4.1"), "not Gmsh's .msh"));
  CHECK(contains(error(v4, "2 20 10 30 70", "2 20 10 30 71"), "names node 71, which is not there"));
  CHECK(contains(error(v4, "2 5 10 70", "2 6 10 70"), "6 nodes declared, 5 found"));
  CHECK(contains(error(v4, "2 5 10 70", "2 999999999999 10 70"), "bytes can hold"));
  CHECK(contains(error(v2, "20 1 0 0", "10 1 0 0"), "node 10 appears twice"));
  CHECK(contains(error(v2, "$Elements", "$Nodes\n0\n$Elements"), "0 nodes declared, 4 found"));
  CHECK(contains(error(v2, "3 4 3 0 1 0 10 20 30 70", "3 2 3 0 1 0 10 20 30"), "no tetrahedron"));
  CHECK(contains(error(v2, v2.substr(v2.find("$Elements")), ""), "mesh has no tetrahedron"));
  CHECK(contains(error(v2, v2.substr(v2.find("3 4 3 0")), ""), "ends before its last element"));
}
