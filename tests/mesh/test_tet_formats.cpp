// One small mesh in every format of tetrahedra that others write, whole and cut short.
#include <doctest/doctest.h>
#include <zlib.h>

#include <algorithm>
#include <optional>

#include "app/lab/report.h"
#include "sim/mesh/fill.h"
#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

namespace {

const TetMesh sample = irregular_block({2, 1, 2}, {0.1, 0, 0});

/// Numbers as text or as bytes, and what a format puts around them.
struct Writer {
  std::string text{};
  bool bytes = false, big = false;
  template <class T>
  void put(T value) {
    if (!bytes) return (void)(text += fmt::format("{} ", value));
    std::string raw(reinterpret_cast<const char*>(&value), sizeof value);
    if (big) std::reverse(raw.begin(), raw.end());
    text += raw;
  }
  template <class T>
  void put_all(const std::vector<T>& values) {
    for (const T& value : values) put(value);
  }
  void end_line() { text += bytes ? "" : "\n"; }
};

/// Of 10-node tets, what follows the corners is vertex 0.
std::string msh(bool bytes, bool big, bool blocks, bool ten_nodes = false) {
  const std::size_t nodes = sample.positions.size(), tets = sample.tets.size(), type = ten_nodes ? 11 : 4;
  Writer w{fmt::format("$MeshFormat\n{} {} 8\n", blocks ? "4.1" : "2.2", int(bytes)), bytes, big};
  if (bytes) w.put(1), w.text += "\n";
  const auto whole = [&](std::size_t value) { blocks ? w.put(std::uint64_t(value)) : w.put(std::int32_t(value)); };
  const auto ints = [&](const std::vector<std::int32_t>& values) { w.put_all(values); };
  w.text += "$EndMeshFormat\n";
  if (blocks) {  // a point, a surface of group 3, and the volume of groups 7 and 8
    const auto bounds_of = [&](std::size_t count) { w.put_all(std::vector<double>(count, 0.5)); };
    w.text += "$Entities\n";
    whole(1), whole(0), whole(1), whole(1), w.end_line();
    ints({9}), bounds_of(3), whole(0), w.end_line();
    ints({4}), bounds_of(6), whole(1), ints({3}), whole(2), ints({5, -6}), w.end_line();
    ints({1}), bounds_of(6), whole(2), ints({7, 8}), whole(1), ints({4}), w.end_line();
    w.text += "\n$EndEntities\n";
  }
  w.text += "$Nodes\n";
  const auto position = [&](const glm::dvec3& p) { w.put(p.x), w.put(p.y), w.put(p.z), w.end_line(); };
  if (blocks) {
    whole(1), whole(nodes), whole(5), whole(nodes + 4), w.end_line();
    ints({3, 1, 0}), whole(nodes), w.end_line();
    for (std::size_t i = 0; i < nodes; ++i) whole(i + 5), w.end_line();
    for (const glm::dvec3& p : sample.positions) position(p);
  } else {
    w.text += fmt::format("{}\n", nodes);
    for (std::size_t i = 0; i < nodes; ++i) whole(i + 5), position(sample.positions[i]);
  }
  w.text += "\n$EndNodes\n$Elements\n";
  if (blocks)
    whole(2), whole(tets + 1), whole(1), whole(tets + 1), w.end_line();
  else
    w.text += fmt::format("{}\n", tets + 1);
  // A triangle, which is passed over, then the tets.
  const auto block = [&](std::int32_t kind, std::size_t count) {
    if (blocks) ints({kind == 2 ? 2 : 3, 1, kind}), whole(count), w.end_line();
    if (!blocks && bytes) ints({kind, std::int32_t(count), 2});
  };
  const auto element = [&](std::size_t number, std::int32_t kind, std::vector<std::size_t> corners) {
    whole(number);
    if (!blocks && !bytes) ints({kind, 2});
    if (!blocks) ints({7, 1});
    for (const std::size_t v : corners) whole(v + 5);
    w.end_line();
  };
  block(2, 1), element(1, 2, {0, 1, 2}), block(std::int32_t(type), tets);
  for (std::size_t t = 0; t < tets; ++t) {
    std::vector<std::size_t> corners(sample.tets[t].begin(), sample.tets[t].end());
    corners.resize(ten_nodes ? 10 : 4);
    element(t + 2, std::int32_t(type), corners);
  }
  return w.text + "\n$EndElements\n";
}

/// Of a triangle and the tets.
struct Grid {
  std::vector<double> points;
  std::vector<std::int64_t> corners{0, 1, 2}, ends{3};
  std::vector<std::uint8_t> types{5};
};
Grid grid() {
  Grid g;
  for (const glm::dvec3& p : sample.positions) g.points.insert(g.points.end(), {p.x, p.y, p.z});
  for (const Tet& t : sample.tets) {
    g.corners.insert(g.corners.end(), t.begin(), t.end());
    g.ends.push_back(g.ends.back() + 4), g.types.push_back(10);
  }
  return g;
}

std::string vtk(bool bytes, bool lists) {
  const Grid g = grid();
  const std::size_t cells = g.types.size();
  Writer w{fmt::format("# vtk DataFile Version {}\n\n{}\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
                       lists ? "5.1" : "3.0", bytes ? "BINARY" : "ASCII", sample.positions.size()),
           bytes, true};
  w.put_all(g.points);
  if (lists) {
    w.text += fmt::format("\nCELLS {} {}\nOFFSETS vtktypeint64\n", cells + 1, g.corners.size());
    w.put(std::int64_t{0}), w.put_all(g.ends), w.text += "\nCONNECTIVITY vtktypeint64\n", w.put_all(g.corners);
  } else {
    w.text += fmt::format("\nCELLS {} {}\n", cells, cells + g.corners.size());
    for (std::size_t c = 0, at = 0; c < cells; ++c) {
      w.put(std::int32_t(g.ends[c] - std::int64_t(at)));
      for (; at < std::size_t(g.ends[c]); ++at) w.put(std::int32_t(g.corners[at]));
      w.end_line();
    }
  }
  w.text += fmt::format("\nCELL_TYPES {}\n", cells);
  for (const std::uint8_t type : g.types) w.put(std::int32_t(type)), w.end_line();
  return w.text + fmt::format("\nPOINT_DATA {}\nSCALARS x float 1\nLOOKUP_TABLE default\n", sample.positions.size());
}

enum class Vtu { ascii, inlined, appended, appended_base64 };

std::string vtu(Vtu kind, bool big, bool wide, bool packed) {
  const Grid g = grid();
  std::string appended;
  const auto header = [&](const std::vector<std::size_t>& numbers) {
    Writer w{{}, true, big};
    for (const std::size_t n : numbers) wide ? w.put(std::uint64_t(n)) : w.put(std::uint32_t(n));
    return w.text;
  };
  const auto array = [&]<class T>(const char* name, const char* type, const std::vector<T>& values) {
    Writer w{{}, kind != Vtu::ascii, big};
    w.put_all(values);
    const auto tag = [&](const std::string& rest) {
      return fmt::format("<DataArray type=\"{}\" Name='{}' NumberOfComponents=\"3\" {}", type, name, rest);
    };
    if (kind == Vtu::ascii) return tag("format=\"ascii\">\n") + w.text + "</DataArray>\n";
    std::string head = header({w.text.size()}), body = w.text;
    if (packed) {  // in blocks of 50 bytes
      std::vector<std::size_t> sizes{(body.size() + 49) / 50, 50, body.size() % 50};
      std::string blocks;
      for (std::size_t at = 0; at < body.size(); at += 50) {
        char made[200];
        uLongf length = sizeof made;
        const std::string part = body.substr(at, 50);
        REQUIRE(compress(reinterpret_cast<Bytef*>(made), &length, reinterpret_cast<const Bytef*>(part.data()),
                         part.size()) == Z_OK);
        blocks.append(made, length), sizes.push_back(length);
      }
      head = header(sizes), body = blocks;
    }
    // What is compressed has its sizes apart, which may end in '='.
    const std::string coded = packed ? base64(head) + base64(body) : base64(head + body);
    if (kind == Vtu::inlined) return tag("format=\"binary\">\n") + coded + "\n</DataArray>\n";
    const std::size_t offset = appended.size();
    appended += kind == Vtu::appended ? head + body : coded;
    return tag(fmt::format("format=\"appended\" offset=\"{}\"/>\n", offset));
  };
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<!-- a <Piece> -->\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"{}\"{}{}>\n"
      "<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<PointData>\n",
      big ? "BigEndian" : "LittleEndian", wide ? " header_type=\"UInt64\"" : "",
      packed ? " compressor=\"vtkZLibDataCompressor\"" : "", sample.positions.size(), g.types.size());
  text += array("x", "Float64", std::vector<double>{1, 2}) + "</PointData>\n<Points>\n";
  text += array("Points", "Float64", g.points) + "</Points>\n<Cells>\n" + array("connectivity", "Int64", g.corners);
  text += array("offsets", "Int64", g.ends) + array("types", "UInt8", g.types) + "</Cells>\n</Piece>\n";
  text += "</UnstructuredGrid>\n";
  if (!appended.empty())
    text += fmt::format("<AppendedData encoding=\"{}\">\n_{}\n</AppendedData>\n",
                        kind == Vtu::appended ? "raw" : "base64", appended);
  return text + "</VTKFile>\n";
}

std::string medit(bool ten_nodes) {
  std::string text =
      fmt::format("MeshVersionFormatted 2\n# a comment\nDimension\n3\nVertices\n{}\n", sample.positions.size());
  for (const auto& p : sample.positions) text += fmt::format("{} {} {} 0\n", p.x, p.y, p.z);
  text += "Triangles\n1\n1 2 3 7\nTetrahedra" + fmt::format("{}\n{}\n", ten_nodes ? "P2" : "", sample.tets.size());
  for (const auto& [a, b, c, d] : sample.tets)
    text += fmt::format("{} {} {} {} {}1\n", a + 1, b + 1, c + 1, d + 1, ten_nodes ? "1 1 1 1 1 1 " : "");
  return text + "Edges 1 1 2 0\nEnd\n";
}

struct File {
  std::string name, text;
};
std::vector<File> files() {
  std::vector<File> all = {{"10.msh", msh(false, false, false, true)}, {"10bin.msh", msh(true, false, true, true)}};
  for (const bool blocks : {false, true}) {
    all.push_back({fmt::format("text{}.msh", blocks), msh(false, false, blocks)});
    for (const bool big : {false, true})
      all.push_back({fmt::format("bytes{}{}.msh", blocks, big), msh(true, big, blocks)});
  }
  for (const bool bytes : {false, true})
    for (const bool lists : {false, true}) all.push_back({fmt::format("{}{}.vtk", bytes, lists), vtk(bytes, lists)});
  for (const Vtu kind : {Vtu::ascii, Vtu::inlined, Vtu::appended, Vtu::appended_base64})
    for (const bool packed : {false, true})
      for (const bool big : {false, true})
        if (kind != Vtu::ascii || (!packed && !big))
          all.push_back({fmt::format("{}{}{}.vtu", int(kind), packed, big), vtu(kind, big, big != packed, packed)});
  all.push_back({"4.mesh", medit(false)}), all.push_back({"10.mesh", medit(true)});
  return all;
}

bool same(const TetMesh& mesh) { return mesh.positions == sample.positions && mesh.tets == sample.tets; }

}  // namespace

TEST_CASE("tet formats: the same mesh from each, with a byte order mark too") {
  const Folder folder;
  for (const auto& [name, text] : files()) {
    CAPTURE(name);
    const TetMesh mesh = load_mesh(folder.write(name, text), "unused");
    CHECK(same(mesh));
    CHECK(same(load_mesh(folder.write(name, "\xEF\xBB\xBF" + text), "unused")));
    // The physical group, or the reference.
    const bool tagged = name.ends_with(".msh") || name.ends_with(".mesh");
    CHECK(mesh.tags == std::vector<std::int32_t>(tagged ? mesh.tets.size() : 0, name.ends_with(".msh") ? 7 : 1));
  }
}

TEST_CASE("tet formats: a file cut short is refused in one line, or what is left is all there is to it") {
  const Folder folder;
  for (const auto& [name, text] : files())
    for (std::size_t size = 1; size < text.size(); size += size + 40 < text.size() ? 37 : 1) {
      CAPTURE(name);
      CAPTURE(size);
      std::optional<TetMesh> mesh;
      const std::string error = error_of([&] { mesh = load_tets(folder.write(name, text.substr(0, size))); });
      CHECK((mesh ? same(*mesh) : error.starts_with("2 ") && !contains(error, "\n")));
    }
}

TEST_CASE("tet formats: an attribute of TetGen's tets is their part, also of ten-node ones") {
  const Folder folder;
  folder.write("a.node", "5 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n4 0 0 -1\n");
  folder.write("a.ele", "2 4 1\n0 0 1 2 3 4\n1 0 2 1 4 9\n");
  CHECK(load_tets(folder.path / "a.ele").tags == std::vector<std::int32_t>{4, 9});
  folder.write("a.ele", "1 10 1\n0 0 1 2 3 0 0 0 0 0 0 6\n");
  CHECK(load_tets(folder.path / "a.ele").tags == std::vector<std::int32_t>{6});
  folder.write("a.ele", "1 4 0\n0 0 1 2 3\n");
  CHECK(load_tets(folder.path / "a.ele").tags.empty());
  folder.write("a.ele", "1 4 1\n0 0 1 2 3\n");
  CHECK(contains(error_of([&] { load_tets(folder.path / "a.ele"); }), "line has no attribute"));
}

TEST_CASE("tet formats: wrong counts are refused before anything is made of them") {
  const Folder folder;
  const auto error = [&](const std::string& name, std::string text, const std::string& part, const std::string& by) {
    const std::size_t at = text.find(part);
    REQUIRE(at != std::string::npos);
    const fs::path file = folder.write(name, text.replace(at, part.size(), by));
    const std::string line = error_of([&] { load_tets(file); });
    CAPTURE(line);
    CHECK(line.starts_with("2 "));
    CHECK(contains(line, file.string()));
    return line;
  };
  const std::string n = std::to_string(sample.positions.size()), v2 = msh(false, false, false), old = vtk(false, false);
  CHECK(contains(error("a.msh", v2, "$Elements\n25\n", "$Elements\n"), "may be missing"));
  CHECK(contains(error("a.msh", v2, "$Elements\n25\n", "$Elements\n24\n"), "no $EndElements follows"));
  CHECK(contains(error("a.msh", v2, "$Nodes\n" + n, "$Nodes\n5"), "5 nodes declared, but no $EndNodes follows"));
  error("a.msh", msh(true, false, false), "$Elements\n25", "$Elements\n26");
  std::string huge = msh(true, false, true);
  huge.replace(huge.find("$Nodes\n") + 7 + 8, 8, "\xff\xff\xff\xff\xff\xff\xff\x7f");
  CHECK(contains(error("a.msh", huge, "$Nodes", "$Nodes"), "bytes can hold"));
  CHECK(contains(error("a.vtk", old, "POINTS " + n, "POINTS 4000000000"), "bytes can hold"));
  CHECK(contains(error("a.vtk", old, "POINTS " + n, "POINTS 5"), "more numbers than are declared"));
  CHECK(contains(error("a.vtk", old, "CELLS 25", "CELLS 24"), "24 cells declared, 25 found"));
  CHECK(contains(error("a.vtk", old, "CELL_TYPES 25", "CELL_TYPES 24"), "a.vtk line "));
  CHECK(contains(error("a.vtk", old, "UNSTRUCTURED_GRID", "POLYDATA"), "no unstructured grid"));
  CHECK(contains(error("a.vtk", old, "double", "bit"), "'bit' is no type of VTK"));
  CHECK(
      contains(error("a.vtk", vtk(false, true), "OFFSETS vtktypeint64\n0", "OFFSETS vtktypeint64\n1"), "begin with 0"));
  const std::string ascii = vtu(Vtu::ascii, false, false, false), packed = vtu(Vtu::inlined, false, false, true);
  CHECK(contains(error("a.vtu", ascii, "NumberOfPoints=\"" + n, "NumberOfPoints=\"5"), "NumberOfPoints is 5, "));
  const std::string first_tet =
      fmt::format("{} {} {} {} ", sample.tets[0][0], sample.tets[0][1], sample.tets[0][2], sample.tets[0][3]);
  CHECK(contains(error("a.vtu", ascii, "0 1 2 " + first_tet, "0 1 2 0 1 2 99 "), "cell 1 names point 99 of " + n));
  CHECK(contains(error("a.vtu", packed, "ZLib", "LZ4"), "save it as ASCII, uncompressed or compressed by ZLib"));
  CHECK(contains(error("a.vtu", ascii, "\"UnstructuredGrid\"", "\"PolyData\""), "no VTKFile of type"));
  CHECK(contains(error("a.mesh", medit(false), "Tetrahedra\n24", "Tetrahedra\n23"), "more follow than are declared"));
  CHECK(contains(error("a.mesh", medit(false), "Tetrahedra\n24", "Tetrahedra\n25"), "'Edges' is not a"));
  CHECK(contains(error("a.mesh", medit(false), "Dimension\n3", "Dimension\n2"), "not three-dimensional"));
}

TEST_CASE("tet formats: solid cells that are no tets are counted, and refused where there are no tets") {
  const Folder folder;
  // A cube of one cell, and perhaps a tet on it.
  const std::vector<std::string> at{"0 0 0", "1 0 0", "1 1 0", "0 1 0", "0 0 1", "1 0 1", "1 1 1", "0 1 1", "0 0 2"};
  std::string points, nodes, vertices;
  for (std::size_t i = 0; i < at.size(); ++i) {
    points += at[i] + "\n", nodes += fmt::format("{} {}\n", i + 1, at[i]), vertices += at[i] + " 0\n";
  }
  for (const bool tet : {true, false}) {
    const auto with = [&](const char* text) { return tet ? text : ""; };
    const std::pair<const char*, std::string> written[] = {
        {"a.vtk", fmt::format("# vtk DataFile Version 3.0\n\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 9 float\n{}"
                              "CELLS {}\n8 0 1 2 3 4 5 6 7\n{}CELL_TYPES {}\n12\n{}",
                              points, tet ? "2 14" : "1 9", with("4 4 5 7 8\n"), tet ? 2 : 1, with("10\n"))},
        {"a.vtu", fmt::format("<VTKFile type=\"UnstructuredGrid\" version=\"0.1\"><UnstructuredGrid>"
                              "<Piece NumberOfPoints=\"9\" NumberOfCells=\"{}\"><Points><DataArray type=\"Float32\" "
                              "NumberOfComponents=\"3\" format=\"ascii\">{}</DataArray></Points><Cells><DataArray "
                              "type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 3 4 5 6 7 {}</DataArray>"
                              "<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">8 {}</DataArray><DataArray "
                              "type=\"UInt8\" Name=\"types\" format=\"ascii\">12 {}</DataArray></Cells></Piece>"
                              "</UnstructuredGrid></VTKFile>",
                              tet ? 2 : 1, points, with("4 5 7 8"), with("12"), with("10"))},
        {"a.msh", fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n{}$EndNodes\n$Elements\n{}\n"
                              "1 5 2 0 1 1 2 3 4 5 6 7 8\n{}$EndElements\n",
                              nodes, tet ? 2 : 1, with("2 4 2 0 1 5 6 8 9\n"))},
        {"a.mesh",
         fmt::format("MeshVersionFormatted 2\nDimension 3\nVertices\n9\n{}Hexahedra\n1\n1 2 3 4 5 6 7 8 0\n{}End",
                     vertices, with("Tetrahedra\n1\n5 6 8 9 0\n"))}};
    for (const auto& [name, text] : written) {
      CAPTURE(name);
      const fs::path file = folder.write(name, text);
      if (!tet) {
        CHECK(contains(error_of([&] { load_tets(file); }), "2 all 1 solid cells are hexahedra, prisms or the like: "));
        continue;
      }
      const TetMesh mesh = load_tets(file);
      CHECK(mesh.tets.size() == 1);
      CHECK(mesh.other_cells == 1);
      CHECK(refill(mesh, {}, name).note == "hexahedra, prisms and the like are left out: 1");
    }
  }
}

TEST_CASE("tet formats: without tets, in a format that nobody reads, and with counts alone") {
  const Folder folder;
  CHECK(contains(error_of([&] {
                   load_mesh(folder.write("a.vtk",
                                          "# vtk DataFile Version 3.0\n\nASCII\nDATASET "
                                          "UNSTRUCTURED_GRID\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n"
                                          "CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5\n"),
                             "");
                 }),
                 "2 mesh has no tetrahedron: "));
  CHECK(contains(error_of([&] { load_mesh(folder.write("a.meshb", "1"), ""); }),
                 "2 Medit's binary format is not read: "));
  CHECK(contains(error_of([&] { load_mesh(folder.write("a.stp", "1"), ""); }), ".msh .vtk .vtu .mesh (tetrahedra)"));
  folder.write("a.node", "5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n");
  const TetMesh mesh = load_tets(folder.write("a.ele", "2\n1 1 2 3 4\n2 2 3 4 5\n"));
  CHECK(mesh.tets.size() == 2);
  CHECK(mesh_volume(mesh) == doctest::Approx(0.5));
  folder.write("a.ele", "1\n1 1 2 3 4\n2 2 3 4 5\n");
  CHECK(contains(error_of([&] { load_tets(folder.path / "a.ele"); }), "1 tets declared, more follow"));
}

TEST_CASE("text files: a byte order mark, decimal commas, lines of errors") {
  const Folder folder;
  const std::string obj = "# cube\n\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  std::string stl = "solid s\n", off = "OFF\n4 4 0\n0, 0, 0\n1,0,0\n0,1.0,0\n0 0 1\n";
  const SurfaceMesh tet = tetrahedron();
  for (const auto& [a, b, c] : tet.triangles) {
    off += fmt::format("3,{},{},{}\n", a, b, c), stl += "facet\nouter loop\n";
    for (const auto v : {a, b, c})
      stl += fmt::format("vertex {} {} {}\n", tet.positions[v].x, tet.positions[v].y, tet.positions[v].z);
    stl += "endloop\nendfacet\n";
  }
  for (const auto& [name, text] :
       {File{"a.obj", obj}, {"a.stl", stl + "endsolid\n"}, {"a.off", off}, {"a.ply", ascii_ply(tet)}})
    for (const char* mark : {"", "\xEF\xBB\xBF"}) {
      CAPTURE(name);
      CHECK(load_surface(folder.write(name, mark + text)).triangles.size() == 4);
    }
  const auto error = [&](const std::string& name, std::string text, const std::string& part, const std::string& by) {
    text.replace(text.find(part), part.size(), by);
    const fs::path file = folder.write(name, text);
    return error_of([&] { load_surface(file); });
  };
  const auto where = [&](const std::string& name, int line) {
    return fmt::format("{} line {}: ", (folder.path / name).string(), line);
  };
  for (const char* by : {"v 1,5 2,0 3,25", "v 1 2 3,25", "v -1,5 0 0"}) {
    const std::string text = error("a.obj", obj, "v 1 0 0", by);
    CHECK(contains(text, "has a decimal comma: " + where("a.obj", 4) + "export with points"));
  }
  CHECK(contains(error("a.obj", obj, "v 0 1 0", "v 0 one 0"), "'one' is not a number (y): " + where("a.obj", 5)));
  CHECK(contains(error("a.obj", obj, "f 1 2 4", "f 1 2 9"), "face 2 names vertex 9 of 4: " + where("a.obj", 8)));
  CHECK(contains(error("a.obj", obj, "f 1 2 4", "f 1 2 -9"), "names a vertex that is not there: " + where("a.obj", 8)));
  CHECK(contains(error("a.obj", "\xEF\xBB\xBF" + obj, "f 1 2 4", "f 1 2 x"),
                 "'x' is no corner of a face: " + where("a.obj", 8)));
  CHECK(contains(error("a.off", off, "3,0,1,3", "3 0 1 9"), "vertex 9 of 4: " + where("a.off", 8)));
  CHECK(contains(error("a.off", off, "0 0 1", "0 0,0 1"), "'0,0' has a decimal comma: " + where("a.off", 6)));
  CHECK(contains(error("a.ply", ascii_ply(tet), "3 0 1 3", "3 0 1 9"), "vertex 9 of 4: " + where("a.ply", 15)));
  CHECK(contains(error("a.stl", stl + "endsolid\n", "vertex 0 1 0", "vertex 0 1;0 0"), where("a.stl", 5)));
}
