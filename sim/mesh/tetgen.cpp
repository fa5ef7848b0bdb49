#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <regex>
#include <sstream>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/mesh/cache.h"
#include "sim/mesh/subprocess.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {
namespace fs = std::filesystem;
namespace {

struct TemporaryFolder {
  fs::path path;
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "tetpbd_XXXXXX").string();
    if (!::mkdtemp(name.data())) throw Error("cannot make a folder for TetGen", name, "set TMPDIR", 1);
    path = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

// $TETPBD_TETGEN_PROGRAM, else the program beside this one (a bundle has its own), else that in PATH.
std::string tetgen_program() {
  if (const char* named = std::getenv("TETPBD_TETGEN_PROGRAM")) return named;
  std::error_code failed;
  const char* path = std::getenv("PATH");
  std::istringstream folders(fs::read_symlink("/proc/self/exe", failed).parent_path().string() + ":" +
                             (path ? path : ""));
  for (std::string folder; std::getline(folders, folder, ':');)
    if (fs::exists(fs::path(folder) / "tetgen", failed)) return fs::path(folder) / "tetgen";
  return "tetgen";
}

SubprocessEnd run_tetgen(const std::string& switches, const fs::path& input, double seconds) {
  const std::string program = tetgen_program();
  SubprocessEnd end = run_subprocess({program, "-" + switches, input.string()}, {seconds});
  if (end.kind == SubprocessEnd::not_started)
    throw Error("TetGen cannot be started, so surfaces cannot be filled", program,
                "install the package tetgen, or name the program in TETPBD_TETGEN_PROGRAM");
  return end;
}

// TetGen's switch d prints a line for each pair: "  Facet #4 intersects facet #5 at triangles: ...", counted from 1.
void throw_intersections(const SurfaceMesh& surface, const fs::path& input, const std::string& source) {
  const std::string printed = run_tetgen("pd", input, 60).output;
  const std::string mark = "  Facet #";
  std::size_t pairs = 0;
  for (std::size_t at = 0; (at = printed.find(mark, at)) != printed.npos; ++at) ++pairs;
  if (pairs == 0) return;
  const std::size_t facet = std::strtoul(printed.c_str() + printed.find(mark) + mark.size(), nullptr, 10);
  const Triangle& t = surface.triangles.at(std::max<std::size_t>(facet, 1) - 1);
  const glm::dvec3 first = (surface.positions[t[0]] + surface.positions[t[1]] + surface.positions[t[2]]) / 3.0;
  throw NotSolid("surface intersects itself",
                 fmt::format("{} pair{} of triangles, first near {} in {}", pairs, pairs == 1 ? "" : "s",
                             point_text(first), source),
                 "repair it (in MeshLab: select self-intersecting faces, delete them, close the holes)");
}

// TetGen's own format, which names a point in each cavity.
void write_with_cavities(const fs::path& file, const SurfaceMesh& surface, const std::vector<glm::dvec3>& cavities) {
  std::string text = fmt::format("{} 3 0 0\n", surface.positions.size());
  const auto put_points = [&](const std::vector<glm::dvec3>& points) {
    for (std::size_t i = 0; i < points.size(); ++i)
      text += fmt::format("{} {:.17g} {:.17g} {:.17g}\n", i, points[i].x, points[i].y, points[i].z);
  };
  put_points(surface.positions);
  text += fmt::format("{} 0\n", surface.triangles.size());
  for (const auto& [a, b, c] : surface.triangles) text += fmt::format("3 {} {} {}\n", a, b, c);
  text += fmt::format("{}\n", cavities.size());
  put_points(cavities);
  write_file(file, text + "0\n");
}

TetMesh run(const SurfaceMesh& surface, const std::vector<glm::dvec3>& cavities, const std::string& switches,
            double seconds, const std::string& source) {
  const TemporaryFolder folder;
  const fs::path input = folder.path / (cavities.empty() ? "surface.off" : "surface.smesh"),
                 output = folder.path / "surface.1.node";
  if (cavities.empty())
    write_surface(input, surface);
  else
    write_with_cavities(input, surface, cavities);
  const SubprocessEnd end = run_tetgen(switches + "F", input, seconds);  // F writes no files of faces
  if (end.kind == SubprocessEnd::timed_out)
    throw NotSolid(fmt::format("tetrahedralising with {} took longer than {:g} s", switches, seconds), source,
                   "allow larger tets (a), ask for less quality (q), use a coarser surface, or --fill lattice");
  if (end.kind == SubprocessEnd::done && fs::exists(output)) return read_node_ele(output);
  throw_intersections(surface, input, source);
  throw NotSolid(fmt::format("TetGen failed with {} ({})", switches,
                             end.kind == SubprocessEnd::done ? "it made no tet" : end.reason),
                 source, "try other switches, --fill lattice, or remesh the surface");
}

}  // namespace

std::string checked_switches(const std::string& switches) {
  const std::string clean = switches.substr(switches.starts_with('-'));
  const std::string where = fmt::format("TetGen switches '{}'", switches);
  const char* hint = "use p with Y, q, a and others, for example pYq1.85o/140 (docs: Meshes)";
  if (clean.size() > 200) throw Error("too long", where, hint);
  const std::regex known("(?:[pYqOSTMXAVCDLlbxzJQ][0-9./]*(?:e[-+]?[0-9]+)?|a[0-9.]+(?:e[-+]?[0-9]+)?|o/[0-9.]+)*");
  std::smatch match;
  std::regex_search(clean, match, known, std::regex_constants::match_continuous);
  if (match.length() != std::ptrdiff_t(clean.size()))
    throw Error(fmt::format("'{}' is not for filling a surface", match.suffix().str()), where, hint);
  if (clean.find('p') == clean.npos) throw Error("'p' is missing", where, hint);
  return clean.find('Q') == clean.npos ? clean + "Q" : clean;
}

TetMesh tetrahedralise(const SurfaceMesh& given, const std::string& wanted_switches, double time_limit,
                       const std::string& source) {
  const std::string switches = checked_switches(wanted_switches);
  const std::uint64_t key = mesh_key(given, switches, tetgen_program());
  if (std::optional<TetMesh> kept = read_mesh(key)) return std::move(*kept);

  SurfaceMesh surface = given;
  const SurfaceCheck check = check_surface(surface);
  if (check.hopeless) throw Error(check.defect, check.place + " in " + source, check.hint);
  if (!check.defect.empty()) throw NotSolid(check.defect, check.place + " in " + source, check.hint);
  TetMesh mesh = run(surface, check.cavities, switches, time_limit, source);
  try {
    finish_tets(mesh, source);
  } catch (const Error& flat) {
    throw NotSolid("TetGen made no mesh of it", flat.what(), "try other switches or --fill lattice");
  }
  // Parts that meet were taken for one inside the other, or not; the volumes do not add up then.
  if (check.components > 1 && std::abs(mesh_volume(mesh) - check.volume) > 1e-6 * check.volume)
    throw NotSolid(
        "parts of the surface overlap",
        fmt::format("they enclose {:.6g} m^3, the tets fill {:.6g} m^3 in {}", check.volume, mesh_volume(mesh), source),
        "unite the parts that overlap");
  keep_mesh(key, mesh);
  return mesh;
}

}  // namespace tetpbd
