// Surface files, welding and the checks of surfaces.
#include <doctest/doctest.h>
#include <sys/wait.h>

#include <cmath>

#include "sim/mesh/subprocess.h"
#include "tests/mesh/mesh_samples.h"

using namespace tetpbd;
using namespace samples;

TEST_CASE("surface: a sound cube passes and keeps its triangles") {
  SurfaceMesh s = cube();
  const auto before = s.triangles;
  const SurfaceCheck check = check_surface(s);
  CHECK(check.defect == "");
  CHECK(check.components == 1);
  CHECK(check.euler_characteristic == 2);
  CHECK(check.volume == doctest::Approx(1));
  CHECK(check.flipped_triangles == 0);
  CHECK(s.triangles == before);
}

TEST_CASE("surface: every defect is named, counted and placed") {
  SurfaceMesh s = cube({2, 0, 0});
  SUBCASE("open") {
    s.triangles.pop_back();  // 1 7 5, on the side x = 3
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "surface is open");
    CHECK(check.count == 3);
    CHECK(contains(check.place, "3 edges with one triangle only, first near (3, "));
    CHECK(check.hint != "");
  }
  SUBCASE("flat") {
    for (auto& p : s.positions) p.z = 0;
    s.positions[4] += glm::dvec3(0.5, 0.1, 0);  // no duplicate positions matter here: indices differ
    s.triangles = {{0, 1, 3}, {0, 3, 2}, {0, 3, 1}, {0, 2, 3}};
    CHECK(check_surface(s).defect == "triangles appear more than once");
    s = tetrahedron();
    s.positions[3] = {0.25, 0.25, 0};
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "surface is flat");
    CHECK(check.count == 1);
  }
  SUBCASE("a thin plate is not flat") {
    for (auto& p : s.positions) p.z *= 1e-5;
    CHECK(check_surface(s).defect == "");
  }
  SUBCASE("degenerate triangle") {
    s.positions[3] = (s.positions[0] + s.positions[1]) * 0.5;  // on the edge 0 1
    CHECK(check_surface(s).defect == "triangles have no area");
    CHECK(check_surface(s).count == 1);
  }
  SUBCASE("vertex named twice") {
    s.triangles[0] = {0, 2, 2};
    CHECK(check_surface(s).defect == "triangles have no area");
  }
  SUBCASE("small triangles of a large mesh are not degenerate") {
    CHECK(check_surface(s = joined(cube(), cube({1000, 0, 0}, 1e-3))).defect == "");
  }
  SUBCASE("non-manifold edge") {  // two tets sharing the edge 0 3
    s = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}},
         {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {0, 4, 5}, {0, 3, 4}, {0, 5, 3}, {4, 3, 5}}};
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "edges have more than two triangles");
    CHECK(check.count == 1);
    CHECK(contains(check.place, "1 edge, first near (0, 0, 0.5)"));
  }
  SUBCASE("non-manifold vertex") {  // two tets sharing the vertex 0
    s = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}},
         {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {0, 4, 5}, {0, 6, 4}, {0, 5, 6}, {4, 6, 5}}};
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "parts of the surface touch in single vertices");
    CHECK(check.count == 1);
    CHECK(contains(check.place, "(0, 0, 0)"));
  }
  SUBCASE("duplicate triangle, also when turned round") {
    s.triangles.push_back({3, 2, 0});
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "triangles appear more than once");
    CHECK(check.count == 1);
  }
  SUBCASE("not finite") {
    s.positions[5].y = NAN;
    s.positions[6].z = INFINITY;
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "positions are not finite numbers");
    CHECK(check.place == "2 vertices, first vertex 5");
  }
  SUBCASE("index out of range") {
    s.triangles[7][1] = 8;
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "triangles name vertices that are not there");
    CHECK(check.place == "1 index, first in triangle 7");
  }
  SUBCASE("empty and too few") {
    s.triangles.clear();
    CHECK(check_surface(s).defect == "too few triangles to enclose a volume");
    SurfaceMesh empty;
    CHECK(check_surface(empty).defect != "");
  }
  SUBCASE("one-sided: the projective plane on six vertices") {
    s = {
        {{0, 0, 1}, {1, 0, 0}, {0.3, 1, 0}, {-0.8, 0.6, 0.1}, {-0.8, -0.6, 0}, {0.3, -1, 0.2}},
        {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}, {0, 5, 1}, {1, 2, 4}, {2, 3, 5}, {3, 4, 1}, {4, 5, 2}, {5, 1, 3}}};
    const SurfaceCheck check = check_surface(s);
    CHECK(check.euler_characteristic == 1);
    CHECK(check.defect == "surface has only one side");
    CHECK(check.count > 0);
  }
}

TEST_CASE("surface: orientation is mended, part by part") {
  SurfaceMesh s = joined(cube(), cube({3, 0, 0}));
  std::swap(s.triangles[4][0], s.triangles[4][1]);                                        // one in the first part
  for (std::size_t t = 12; t < 24; ++t) std::swap(s.triangles[t][0], s.triangles[t][1]);  // all of the second
  CHECK(signed_volume(s) < 0.9);
  const SurfaceCheck check = check_surface(s);
  CHECK(check.defect == "");
  CHECK(check.components == 2);
  CHECK(check.euler_characteristic == 4);
  CHECK(check.flipped_triangles == 13);
  CHECK(signed_volume(s) == doctest::Approx(2));
  CHECK(check_surface(s).flipped_triangles == 0);
}

TEST_CASE("surface: welding") {
  SurfaceMesh soup;  // a cube as STL has it: three vertices of its own for each triangle, off by less than a
                     // tolerance
  const SurfaceMesh whole = cube();
  for (const Triangle& t : whole.triangles) {
    const auto base = static_cast<std::uint32_t>(soup.positions.size());
    for (const std::uint32_t v : t)
      soup.positions.push_back(whole.positions[v] + glm::dvec3(3e-8 * static_cast<double>(soup.positions.size() % 3)));
    soup.triangles.push_back({base, base + 1, base + 2});
  }
  soup.positions.emplace_back(0.5, 0.5, 0.5);  // no triangle
  SurfaceMesh coarse = soup;
  weld(coarse, 2e-7);
  CHECK(coarse.positions.size() == 8);
  CHECK(check_surface(coarse).defect == "");
  SurfaceMesh fine = soup;
  weld(fine, 1e-9);
  CHECK(fine.positions.size() > 8);

  SurfaceMesh collapsing = cube();
  collapsing.positions[1] = collapsing.positions[0] + glm::dvec3(1e-9, 0, 0);
  weld(collapsing, 1e-7);
  CHECK(collapsing.positions.size() == 7);
  CHECK(collapsing.triangles.size() == 10);
  CHECK(check_surface(collapsing).defect == "");

  SurfaceMesh row;  // pairs 0.9 tolerances apart, wherever they stand in the grid
  for (int i = 0; i < 300; ++i) {
    const glm::dvec3 at(i * 3.7, i * 5.3, i * -7.1);
    row.positions.insert(row.positions.end(), {at, at + glm::dvec3(0.5, 0.5, -0.5), at + glm::dvec3(9, 0, 0)});
    row.positions.push_back(at + glm::dvec3(0, 9, 0));
    const auto v = static_cast<std::uint32_t>(4 * i);
    row.triangles.insert(row.triangles.end(), {{v, v + 2, v + 3}, {v + 1, v + 3, v + 2}});
  }
  weld(row, 1);
  CHECK(row.positions.size() == 900);

  SurfaceMesh bad = cube();
  bad.positions[3].x = NAN;
  weld(bad, 1e-7);
  CHECK(check_surface(bad).place == "1 vertex, first vertex 3");
}

TEST_CASE("surface: the shipped models load sound, with the counts of their table") {
  const struct {
    const char* name;
    std::size_t vertices, triangles;
    int euler;
    double volume;
  } models[] = {{"bunny.ply", 2990, 5976, 2, 0.2087},       {"armadillo.ply", 6362, 12720, 2, 0.0684},
                {"dragon.ply", 5291, 10582, 0, 0.1609},     {"dragon_21k.ply", 10582, 21164, 0, 0.1605},
                {"bunny_50k.ply", 25002, 50000, 2, 0.2074}, {"armadillo_50k.ply", 25002, 50000, 2, 0.0687},
                {"dragon_50k.ply", 25000, 50000, 0, 0.1609}};
  for (const auto& model : models) {
    CAPTURE(model.name);
    SurfaceMesh s = load_surface(fs::path(TEST_MODELS) / model.name);
    CHECK(s.positions.size() == model.vertices);
    CHECK(s.triangles.size() == model.triangles);
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "");
    CHECK(check.flipped_triangles == 0);
    CHECK(check.components == 1);
    CHECK(check.euler_characteristic == model.euler);
    CHECK(check.volume == doctest::Approx(model.volume).epsilon(0.0004));
    CHECK(bounds(s.positions).high.y - bounds(s.positions).low.y == doctest::Approx(1));
  }
}

TEST_CASE("surface files: polygons, comments, each format") {
  Folder folder;
  const auto volume_of = [&](const std::string& name, const std::string& text) {
    SurfaceMesh s = load_surface(folder.write(name, text));
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "");
    CHECK(s.positions.size() == 8);
    return check.volume;
  };
  const std::string quads = "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
  const std::string points = "0 0 0\n2 0 0\n0 2 0\n2 2 0\n0 0 2\n2 0 2\n0 2 2\n2 2 2\n";
  CHECK(volume_of("quads.off", "OFF\n8 6 0\n" + points + quads) == doctest::Approx(8));
  CHECK(volume_of("quads.ply",
                  "ply\nformat ascii 1.0\ncomment a box\nelement vertex 8\nproperty float x\nproperty float y\n"
                  "property float z\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n" +
                      points + quads) == doctest::Approx(8));
  std::string obj = "# a box\no box\n";
  for (std::size_t at = 0; at < points.size(); at += 6) obj += "v " + points.substr(at, 6);
  obj += "v 9 9 9\n";  // without a face
  for (std::size_t at = 0; at < quads.size(); at += 10) {
    obj += "f";
    for (std::size_t k = 2; k < 10; k += 2) obj += fmt::format(" {}", quads[at + k] - '0' + 1);
    obj += "\n";
  }
  CHECK(volume_of("QUADS.OBJ", obj) == doctest::Approx(8));
  std::string stl = "solid box\n";
  const SurfaceMesh box = cube({0, 0, 0}, 2);
  for (const Triangle& t : box.triangles) {
    stl += "facet normal 0 0 0\nouter loop\n";
    for (const std::uint32_t v : t)
      stl += fmt::format("vertex {} {} {}\n", box.positions[v].x, box.positions[v].y, box.positions[v].z);
    stl += "endloop\nendfacet\n";
  }
  CHECK(volume_of("box.stl", stl + "endsolid box\n") == doctest::Approx(8));
}

TEST_CASE("surface files: OFF with colours and comments") {
  Folder folder;
  std::string text = "# colours\nOFF\n# counts\n8 12 0\n";
  for (const auto& p : cube().positions) text += fmt::format("{} {} {} 255 0 0 255\n", p.x, p.y, p.z);
  for (const auto& t : cube().triangles) text += fmt::format("3 {} {} {} 0.5 0.5 0.5\n", t[0], t[1], t[2]);
  SurfaceMesh s;
  const std::string error = error_of([&] { s = load_surface(folder.write("colours.off", text)); });
  CHECK(error == "");
  CHECK(check_surface(s).volume == doctest::Approx(1));
}

TEST_CASE("surface files: a polygon with a notch is cut inside, coordinates keep all digits") {
  Folder folder;
  // An L of six corners as floor and roof, six walls; a fan from its first corner would leave it.
  const std::string prism =
      "v 2 0 1\nv 2 0 0\nv 0 0 0\nv 0 0 2\nv 1 0 2\nv 1 0 1\n"
      "v 2 1 1\nv 2 1 0\nv 0 1 0\nv 0 1 2\nv 1 1 2\nv 1.000000000001 1 1\n"
      "f 1 6 5 4 3 2\nf 7/1 8//2 9/1/2 10 -2 -1\n"
      "f 1 2 8 7\nf 2 3 9 \\\n 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12\n";
  SurfaceMesh s = load_surface(folder.write("prism.obj", prism));
  CHECK(s.triangles.size() == 2 * 4 + 6 * 2);
  CHECK(s.positions[11].x == 1.000000000001);
  double area = 0;
  for (const Triangle& t : s.triangles)
    area += glm::length(glm::cross(s.positions[t[1]] - s.positions[t[0]], s.positions[t[2]] - s.positions[t[0]])) / 2;
  CHECK(area == doctest::Approx(2 * 3 + 8));
  const SurfaceCheck check = check_surface(s);
  CHECK(check.defect == "");
  CHECK(check.volume == doctest::Approx(3));
}

TEST_CASE("surface files: bad input is one clear line with status 2") {
  Folder folder;
  const auto error = [&](const fs::path& file) {
    const std::string text = error_of([&] { load_surface(file); });
    CAPTURE(text);
    CHECK(contains(text, file.string()));
    CHECK(text.starts_with("2 "));
    CHECK(!contains(text, "\n"));
    return text;
  };
  CHECK(contains(error(folder.path / "none.ply"), "no such file"));
  fs::create_directory(folder.path / "folder.ply");
  CHECK(contains(error(folder.path / "folder.ply"), "is a folder"));
  CHECK(contains(error(folder.write("mesh.xyz", "1")), "not a surface format"));
  CHECK(contains(error(folder.write("empty.ply", "")), "file is empty"));
  CHECK(contains(error(folder.write("noise.ply", "not a mesh at all\n")), "cannot be read"));
  CHECK(contains(error(folder.write("noise.off", std::string(300, '\x7f'))), "file"));
  CHECK(contains(error(folder.write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n")), folder.path.string()));
  CHECK(contains(error(folder.write("line.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nl 2 3\n")), folder.path.string()));

  const std::string good = ascii_ply(cube());
  CHECK(load_surface(folder.write("good.ply", good)).triangles.size() == 12);
  SurfaceMesh wrong = cube();
  wrong.triangles[3][1] = 80;
  CHECK(contains(error(folder.write("index.ply", ascii_ply(wrong))), "vertex 80 of 8"));
  std::string text = good;
  text.replace(text.find("vertex 8"), 8, "vertex 4000000000");
  CHECK(contains(error(folder.write("huge.ply", text)), "bytes can hold"));
  CHECK(contains(error(folder.write("huge.off", "OFF\n4000000000 12 0\n0 0 0\n")), "bytes can hold"));
  std::string stl(84, '\0');
  stl[83] = '\x7f';
  CHECK(contains(error(folder.write("huge.stl", stl)), "bytes can hold"));
  CHECK(contains(error(folder.write("index.off",
                                    "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n"
                                    "3 1 2 9\n")),
                 "face 3 names vertex 9 of 4"));
  error(folder.write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"));

  std::ifstream bunny(fs::path(TEST_MODELS) / "bunny.ply", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(bunny)), {});
  REQUIRE(bytes.size() == 113743);
  for (const std::size_t size :
       {bytes.size() - 1, bytes.size() / 2, std::size_t{230}, std::size_t{100}, std::size_t{3}}) {
    CAPTURE(size);
    error(folder.write("truncated.ply", bytes.substr(0, size)));
  }
  std::string lines = good;  // text cut in the middle of its faces
  lines.resize(lines.size() - 30);
  CHECK(error(folder.write("truncated_text.ply", lines)) != "");

  lines = ascii_ply(cube({1000.25, 1000.25, 1000.25}));  // enough bytes for all it claims
  const std::string off = "OFF\n8 12 0\n" + lines.substr(lines.find("end_header\n") + 11);
  CHECK(load_surface(folder.write("whole.off", off)).triangles.size() == 12);
  for (std::size_t cut = 2; cut < 70; ++cut) {  // through the last eight faces
    CAPTURE(cut);
    const std::string ply = error(folder.write("cut.ply", lines.substr(0, lines.size() - cut)));
    CHECK((contains(ply, "file ends before its last face") || contains(ply, "line has no value of the face")));
    const std::string text_off = error(folder.write("cut.off", off.substr(0, off.size() - cut)));
    CHECK((contains(text_off, "file ends before its last face") || contains(text_off, "line has no corner")));
  }

  SurfaceMesh nan = load_surface(folder.write("nan.off",
                                              "OFF\n4 4 0\nnan 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n"
                                              "3 0 3 2\n3 1 2 3\n"));
  CHECK(check_surface(nan).place == "1 vertex, first vertex 0");
}

TEST_CASE("subprocess: output, failures, time and memory limits") {
  using End = SubprocessEnd;
  End end = run_subprocess({"printf", "%s", "two words"}, {60});
  CHECK(end.kind == End::done);
  CHECK(end.output == "two words");
  end = run_subprocess({"sh", "-c", "echo no; exit 3"}, {60});
  CHECK(end.kind == End::failed);
  CHECK(end.reason == "it ended with status 3");
  end = run_subprocess({"sh", "-c", "kill -ABRT $$"}, {60});
  CHECK(end.kind == End::failed);
  CHECK(contains(end.reason, "Aborted"));
  CHECK(run_subprocess({"/nowhere/program"}, {60}).kind == End::not_started);
  CHECK(run_subprocess({"sleep", "60"}, {0.2}).kind == End::timed_out);
  const std::string eat = "x=$(head -c 100000000 /dev/zero | tr '\\0' x); echo ${#x}";
  CHECK(run_subprocess({"sh", "-c", eat}, {60, std::size_t{4} << 30}).output == "100000000\n");
  CHECK(run_subprocess({"sh", "-c", eat}, {60, std::size_t{64} << 20}).output == "");
  CHECK(run_subprocess({"head", "-c", "10000000", "/dev/zero"}, {60, std::size_t{4} << 30, 1000}).output.size() <
        100000);
  int status = 0;
  CHECK(::waitpid(-1, &status, WNOHANG) == -1);  // no child is left
}

TEST_CASE("surface files: triangle strips of PLY") {
  const Folder folder;
  const char* head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  for (const char* strips : {"6 0 2 1 3 0 2\n", "9 0 2 1 3 -1 1 3 0 2\n"}) {
    SurfaceMesh s = load_surface(folder.write("strips.ply", std::string(head) + strips));
    CHECK(s.triangles == std::vector<Triangle>{{0, 2, 1}, {1, 2, 3}, {1, 3, 0}, {0, 3, 2}});
    const SurfaceCheck check = check_surface(s);
    CHECK(check.defect == "");
    CHECK(check.flipped_triangles == 0);
  }
  CHECK(contains(error_of([&] { load_surface(folder.write("bad.ply", std::string(head) + "3 0 1 7\n")); }),
                 "names vertex 7 of 4"));
}
