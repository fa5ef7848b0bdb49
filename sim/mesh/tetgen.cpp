#include <fmt/format.h>

#include <cmath>

#include "sim/mesh/bytes.h"
#include "sim/mesh/contained.h"
#include "sim/error.h"
#include "sim/mesh/mesh_cache.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/tetgen_switches.h"

#if TETPBD_TETGEN
#include <sys/resource.h>
#include <tetgen.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#endif

namespace tetpbd {

#if TETPBD_TETGEN
namespace {

constexpr std::size_t tetgen_bytes = std::size_t{16} << 30;  // three million tets take 0.6 GB
constexpr double diagnosis_seconds = 60;

// All functions down to diagnose() run in the child: a tetgenio frees what it is given with delete[], and on
// bad input TetGen 1.5 frees its mesh twice and dies, whatever is caught.

void fill(tetgenio& in, const SurfaceMesh& surface) {
  in.firstnumber = 0;
  in.numberofpoints = static_cast<int>(surface.positions.size());
  in.pointlist = new REAL[surface.positions.size() * 3];
  for (std::size_t v = 0; v < surface.positions.size(); ++v)
    for (int axis = 0; axis < 3; ++axis)
      in.pointlist[v * 3 + static_cast<std::size_t>(axis)] = surface.positions[v][axis];
  in.numberoffacets = static_cast<int>(surface.triangles.size());
  in.facetlist = new tetgenio::facet[surface.triangles.size()];
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    tetgenio::facet& facet = in.facetlist[t];
    tetgenio::init(&facet);
    facet.numberofpolygons = 1;
    facet.polygonlist = new tetgenio::polygon[1];
    facet.polygonlist->numberofvertices = 3;
    facet.polygonlist->vertexlist = new int[3];
    for (std::size_t k = 0; k < 3; ++k)
      facet.polygonlist->vertexlist[k] = static_cast<int>(surface.triangles[t][k]);
  }
}

std::string mesh_in_child(const SurfaceMesh& surface, std::string switches) {
  tetgenio in, out;
  fill(in, surface);
  tetrahedralize(switches.data(), &in, &out);
  TetMesh mesh;
  for (int v = 0; v < out.numberofpoints; ++v)
    mesh.positions.emplace_back(out.pointlist[3 * v], out.pointlist[3 * v + 1], out.pointlist[3 * v + 2]);
  for (int t = 0; t < out.numberoftetrahedra; ++t) {
    const int* corners = out.tetrahedronlist + static_cast<std::ptrdiff_t>(t) * out.numberofcorners;
    Tet tet;
    for (std::size_t k = 0; k < 4; ++k) tet[k] = static_cast<std::uint32_t>(corners[k] - out.firstnumber);
    mesh.tets.push_back(tet);
  }
  std::string bytes;
  put_array(bytes, mesh.positions);
  put_array(bytes, mesh.tets);
  return bytes;
}

struct Intersections {
  std::uint64_t pairs = 0;
  glm::dvec3 first{0};
};

// TetGen's switch d only prints its pairs ("Facet #4 intersects facet #5 at triangles: ..."), so its output
// is read.
std::string intersections_in_child(const SurfaceMesh& surface) {
  std::FILE* printed = std::tmpfile();
  if (!printed) throw std::runtime_error("no temporary file");
  std::signal(SIGXFSZ, SIG_IGN);  // n triangles can have n^2 pairs: what goes beyond is not printed
  const rlimit most{64u << 20, 64u << 20};
  ::setrlimit(RLIMIT_FSIZE, &most);
  std::fflush(stdout);
  ::dup2(::fileno(printed), STDOUT_FILENO);
  tetgenio in, out;
  fill(in, surface);
  std::string switches = "pd";
  tetrahedralize(switches.data(), &in, &out);
  std::fflush(stdout);
  std::rewind(printed);
  Intersections found;
  char line[512];
  while (std::fgets(line, sizeof line, printed)) {
    unsigned long facet = 0;  // counted from 1
    if (std::sscanf(line, " Facet #%lu", &facet) != 1 || facet < 1 || facet > surface.triangles.size())
      continue;
    if (found.pairs++ > 0) continue;
    const Triangle& t = surface.triangles[facet - 1];
    found.first = (surface.positions[t[0]] + surface.positions[t[1]] + surface.positions[t[2]]) / 3.0;
  }
  std::string bytes;
  put_array(bytes, std::vector<Intersections>{found});
  return bytes;
}

Intersections diagnose(const SurfaceMesh& surface) {
  const ContainedResult answer =
      run_contained([&] { return intersections_in_child(surface); }, {diagnosis_seconds, tetgen_bytes});
  std::vector<Intersections> found;
  std::string_view bytes = answer.bytes;
  if (answer.end != ContainedResult::End::done || !take_array(bytes, found) || found.size() != 1) return {};
  return found[0];
}

[[noreturn]] void throw_failure(const SurfaceMesh& surface, const ContainedResult& answer,
                                const std::string& switches, double time_limit, const std::string& source) {
  if (answer.end == ContainedResult::End::timed_out)
    throw Error(fmt::format("tetrahedralising with {} took longer than {:g} s", switches, time_limit), source,
                "allow larger tets (a), ask for less quality (q), or use a coarser surface");
  const Intersections found = diagnose(surface);
  if (found.pairs > 0)
    throw Error("surface intersects itself",
                fmt::format("{} of triangles, first near ({:.6g}, {:.6g}, {:.6g}) in {}",
                            found.pairs == 1 ? "1 pair" : fmt::format("{} pairs", found.pairs), found.first.x,
                            found.first.y, found.first.z, source),
                "repair it (in MeshLab: select self-intersecting faces, delete them, close the holes)");
  throw Error(fmt::format("TetGen failed with {} ({})", switches,
                          answer.end == ContainedResult::End::done ? "it made no tet" : answer.reason),
              source, "try other switches, such as pYq1.85o/140, or remesh the surface");
}

}  // namespace

TetMesh tetrahedralise(const SurfaceMesh& given, const std::string& wanted_switches, double time_limit,
                       const std::string& source) {
  const std::string switches = checked_switches(wanted_switches);
  const CacheKey key = mesh_key(given, switches);
  if (std::optional<TetMesh> kept = read_mesh(key)) return std::move(*kept);

  SurfaceMesh surface = given;
  const SurfaceCheck check = check_surface(surface);
  if (!check.defect.empty()) throw Error(check.defect, check.place + " in " + source, check.mend);

  const ContainedResult answer =
      run_contained([&] { return mesh_in_child(surface, switches); }, {time_limit, tetgen_bytes});
  TetMesh mesh;
  std::string_view bytes = answer.bytes;
  const bool whole = answer.end == ContainedResult::End::done && take_array(bytes, mesh.positions) &&
                     take_array(bytes, mesh.tets);
  if (!whole || mesh.tets.empty()) throw_failure(surface, answer, switches, time_limit, source);
  finish_tets(mesh, source);
  // TetGen fills everything inside the outermost surface. Where parts lie inside one another their volumes
  // count twice.
  if (check.components > 1 && std::abs(mesh_volume(mesh) - check.volume) > 1e-6 * check.volume)
    throw Error("parts of the surface lie inside one another",
                fmt::format("they enclose {:.6g} m^3, the tets fill {:.6g} m^3 in {}", check.volume,
                            mesh_volume(mesh), source),
                "remove the inner parts: cavities are not supported");
  keep_mesh(key, mesh);
  return mesh;
}

#else

TetMesh tetrahedralise(const SurfaceMesh&, const std::string&, double, const std::string& source) {
  throw Error("built without TetGen, so surfaces cannot be filled", source,
              "give a tetrahedral mesh (.node/.ele, .msh) or build with -DTETPBD_TETGEN=ON");
}

#endif

}  // namespace tetpbd
