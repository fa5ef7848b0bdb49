// Everything that needs OpenVDB, because its headers take long to compile.
#include "sim/mesh/wrap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "sim/mesh/cache.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/distance_field.h"
#include "sim/parallel.h"

#ifdef TETPBD_OPENVDB
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>
#endif

namespace tetpbd {
namespace {

void require_extent(const SurfaceMesh& surface, const std::string& source) {
  const SurfaceCheck check = check_values(surface);
  if (check.hopeless) throw Error(check.defect, check.place + " in " + source, check.hint);
  if (surface.triangles.empty() || !(bounds(surface.positions).size() > 0))
    throw Error("surface has no extent", source, "give one with triangles");
}

// Positions in voxels from `origin`, so that floats are equally fine for every size and place of the mesh.
using Grid = std::vector<glm::vec3>;
Grid in_voxels(const std::vector<glm::dvec3>& positions, const glm::dvec3& origin, double voxel) {
  Grid result;
  for (const glm::dvec3& p : positions) result.emplace_back((p - origin) / voxel);
  return result;
}

// Edges with an odd number of triangles; without any, the surface separates inside from outside.
std::vector<std::pair<std::uint32_t, std::uint32_t>> open_edges(const std::vector<Triangle>& triangles) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges, open;
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
  std::ranges::sort(edges);
  for (auto first = edges.begin(); first != edges.end();) {
    const auto next = std::find_if(first, edges.end(), [&](const auto& edge) { return edge != *first; });
    if ((next - first) % 2) open.push_back(*first);
    first = next;
  }
  return open;
}

// Closes small holes, as in scans, by fans, because the wrap would go in and the body be hollow. What is wide open,
// such as a bowl or a cloth, stays so.
void close_holes(SurfaceMesh& surface) {
  constexpr double widest = 0.25;  // of the surface's size
  const auto edges = open_edges(surface.triangles);
  DisjointSets holes(surface.positions.size());
  for (const auto& [a, b] : edges) holes.join(a, b);
  std::map<std::uint32_t, std::vector<glm::dvec3>> rims;  // by root
  for (const auto& [a, b] : edges)
    for (const std::uint32_t v : {a, b}) rims[holes.root(a)].push_back(surface.positions[v]);
  std::map<std::uint32_t, std::uint32_t> middles;
  const double size = bounds(surface.positions).size();
  for (const auto& [root, rim] : rims) {
    if (bounds(rim).size() > widest * size) continue;
    middles[root] = std::uint32_t(surface.positions.size());
    surface.positions.push_back(std::accumulate(rim.begin(), rim.end(), glm::dvec3(0)) / double(rim.size()));
  }
  for (const auto& [a, b] : edges)
    if (const auto middle = middles.find(holes.root(a)); middle != middles.end())
      surface.triangles.push_back({a, b, middle->second});
}

// Sums the solid angles of the triangles (A. Van Oosterom and J. Strackee, 1983): 4 pi inside, 0 outside.
bool is_inside(const glm::dvec3& p, const SurfaceMesh& surface, const std::vector<std::uint32_t>& triangles) {
  double angle = 0;
  for (const std::uint32_t t : triangles) {
    const auto corner = [&](std::size_t k) { return surface.positions[surface.triangles[t][k]] - p; };
    const glm::dvec3 a = corner(0), b = corner(1), c = corner(2);
    const double u = glm::length(a), v = glm::length(b), w = glm::length(c);
    angle += 2 * std::atan2(glm::dot(a, glm::cross(b, c)),
                            u * v * w + glm::dot(a, b) * w + glm::dot(b, c) * u + glm::dot(c, a) * v);
  }
  return std::abs(angle) > 2 * std::numbers::pi;
}

// Drops inner parts: a level set has an inner side where its body is hollow, and a part may lie within another.
void keep_outermost(SurfaceMesh& surface) {
  DisjointSets joined(surface.positions.size());
  for (const Triangle& t : surface.triangles) joined.join(t[0], t[1]), joined.join(t[1], t[2]);
  struct Part {
    double volume = 0;
    std::vector<std::uint32_t> triangles{};
    bool kept = false;
  };
  std::vector<Part> parts(surface.positions.size());  // by root
  for (std::uint32_t i = 0; i < surface.triangles.size(); ++i) {
    const Triangle& t = surface.triangles[i];
    Part& part = parts[joined.root(t[0])];
    part.triangles.push_back(i);
    const auto& p = surface.positions;
    part.volume += glm::dot(p[t[0]], glm::cross(p[t[1]], p[t[2]])) / 6;
  }
  std::erase_if(parts, [](const Part& part) { return part.triangles.empty(); });
  std::ranges::sort(parts, std::ranges::greater{}, [](const Part& part) { return std::abs(part.volume); });
  std::vector<Triangle> kept;
  for (Part& part : parts) {
    const glm::dvec3& p = surface.positions[surface.triangles[part.triangles[0]][0]];
    const auto surrounds = [&](const Part& other) { return other.kept && is_inside(p, surface, other.triangles); };
    part.kept = part.volume * parts[0].volume > 0 && std::ranges::none_of(parts, surrounds);
    if (part.kept)
      for (const std::uint32_t t : part.triangles) kept.push_back(surface.triangles[t]);
  }
  surface.triangles = std::move(kept);
  drop_unused_vertices(surface.positions, surface.triangles);
}

#ifdef TETPBD_OPENVDB

namespace vdb = openvdb;

/// The interface by which OpenVDB reads a mesh.
struct Polygons {
  const Grid& points;
  const std::vector<Triangle>& triangles;
  std::size_t polygonCount() const { return triangles.size(); }
  std::size_t pointCount() const { return points.size(); }
  std::size_t vertexCount(std::size_t) const { return 3; }
  void getIndexSpacePoint(std::size_t t, std::size_t k, vdb::Vec3d& at) const {
    const glm::vec3& p = points[triangles[t][k]];
    at = {p.x, p.y, p.z};
  }
};

vdb::FloatGrid::Ptr distances(const Polygons& mesh, float band, bool is_signed, vdb::Int32Grid* nearest = nullptr) {
  vdb::initialize();
  return vdb::tools::meshToVolume<vdb::FloatGrid>(mesh, *vdb::math::Transform::createLinearTransform(1.0), band, band,
                                                  is_signed ? 0 : vdb::tools::UNSIGNED_DISTANCE_FIELD, nearest);
}

SurfaceMesh level_set(const Polygons& mesh, double distance) {
  const auto grid = distances(mesh, float(distance) + 3, false);
  std::vector<vdb::Vec3s> points;
  std::vector<vdb::Vec3I> triangles;
  std::vector<vdb::Vec4I> quads;
  vdb::tools::volumeToMesh(*grid, points, triangles, quads, distance, 0.0);
  SurfaceMesh surface;
  for (const vdb::Vec3s& p : points) surface.positions.emplace_back(p[0], p[1], p[2]);
  for (const vdb::Vec3I& t : triangles) surface.triangles.push_back({t[0], t[1], t[2]});
  for (const vdb::Vec4I& q : quads) {
    surface.triangles.push_back({q[0], q[1], q[2]});
    surface.triangles.push_back({q[0], q[2], q[3]});
  }
  return surface;
}

// Near the surface OpenVDB finds the nearest triangle. From there, sweeps along all diagonals pass triangles on to
// neighbours where they are nearer. A band as wide as the grid would take OpenVDB 20 times as long.
std::vector<float> grid_values(const Polygons& mesh, const glm::ivec3& size, bool is_signed) {
  vdb::Int32Grid nearest(-1);
  const auto grid = distances(mesh, 3, is_signed, &nearest);
  const auto look = grid->getConstAccessor();
  const auto look_nearest = nearest.getConstAccessor();
  const glm::ivec3 stride(1, size.x, size.x * size.y);
  const std::size_t count = std::size_t(stride.z) * std::size_t(size.z);
  std::vector<float> values(count, INFINITY);
  std::vector<int> owners(count, -1);  // triangles
  const auto each = [&](unsigned turned, const auto& visit) {
    for (int z = 0; z < size.z; ++z)
      for (int y = 0; y < size.y; ++y)
        for (int x = 0; x < size.x; ++x) {
          glm::ivec3 at(x, y, z);
          for (int a = 0; a < 3; ++a)
            if (turned >> a & 1) at[a] = size[a] - 1 - at[a];
          visit(at, std::size_t(at.x + at.y * stride.y + at.z * stride.z));
        }
  };
  const auto offer = [&](const glm::ivec3& at, std::size_t i, int t) {
    if (t < 0 || t == owners[i]) return;
    vdb::Vec3d corners[3], uvw;
    for (std::size_t k = 0; k < 3; ++k) mesh.getIndexSpacePoint(std::size_t(t), k, corners[k]);
    const vdb::Vec3d p(at.x, at.y, at.z);
    const auto d =
        float((vdb::math::closestPointOnTriangleToPoint(corners[0], corners[1], corners[2], p, uvw) - p).length());
    if (d < values[i]) values[i] = d, owners[i] = t;
  };
  each(0, [&](const glm::ivec3& at, std::size_t i) { offer(at, i, look_nearest.getValue({at.x, at.y, at.z})); });
  for (unsigned sweep = 0; sweep < 16; ++sweep)
    each(sweep, [&](const glm::ivec3& at, std::size_t i) {
      for (int a = 0; a < 3; ++a) {
        const int back = sweep >> a & 1 ? 1 : -1, from = at[a] + back;
        if (from >= 0 && from < size[a]) offer(at, i, owners[std::size_t(int(i) + back * stride[a])]);
      }
    });
  if (is_signed)
    each(0, [&](const glm::ivec3& at, std::size_t i) {
      if (look.getValue({at.x, at.y, at.z}) < 0) values[i] = -values[i];
    });
  return values;
}

constexpr bool has_openvdb = true;

#else

struct Polygons {
  const Grid& points;
  const std::vector<Triangle>& triangles;
};
SurfaceMesh level_set(const Polygons&, double) { return {}; }
std::vector<float> grid_values(const Polygons&, const glm::ivec3&, bool) { return {}; }
constexpr bool has_openvdb = false;

#endif

void require_openvdb(const std::string& what, const std::string& source) {
  if (!has_openvdb)
    throw Error(what + " needs OpenVDB, without which this program was built", source,
                "install libopenvdb-dev and build again");
}

}  // namespace

bool can_wrap() { return has_openvdb; }

SurfaceMesh wrap(const SurfaceMesh& surface, const WrapOptions& options, const std::string& source) {
  require_openvdb("wrapping", source);
  require_extent(surface, source);
  const Bounds box = bounds(surface.positions);
  SurfaceMesh closed = surface;
  close_holes(closed);
  std::string defect;
  // A level set may touch itself within a cell, and another grid cuts it elsewhere.
  for (const double finer : {1.0, 1.07, 0.93, 1.15}) {
    const double voxel = box.size() / options.voxels / finer;
    const glm::dvec3 origin = box.low - 0.37 * voxel;  // so that flat sides are between grid points
    const Grid points = in_voxels(closed.positions, origin, voxel);
    SurfaceMesh result = level_set({points, closed.triangles}, options.thickness);
    keep_outermost(result);
    for (glm::dvec3& p : result.positions) p = origin + p * voxel;
    repair(result);
    const SurfaceCheck check = check_surface(result);
    if (check.defect.empty()) return result;
    defect = check.defect;
  }
  throw Error("wrap is no solid: " + defect, source, "take other voxels or more thickness for \"wrap\"");
}

Filled fill_or_wrap(const SurfaceMesh& surface, const std::string& switches, const std::optional<WrapOptions>& options,
                    bool always, const std::string& source) {
  if (!options) return {tetrahedralise(surface, switches, 600, source), ""};
  const std::string how = fmt::format("wrap {} {} {}", options->voxels, options->thickness, always);
  const std::uint64_t key = mesh_key(surface, checked_switches(switches) + how, "");
  const std::string file = fmt::format("{:016x}.wrap", key);
  Filled filled;
  std::vector<char> note;
  if (take_sealed(read_cached(file), key, filled.mesh.positions, filled.mesh.tets, note)) {
    filled.note.assign(note.begin(), note.end());
    finish_tets(filled.mesh, file);
    return filled;
  }
  std::string why = "it has no mesh of its own";
  if (!always) try {
      return {tetrahedralise(surface, switches, 600, source), ""};
    } catch (const NotSolid& refusal) {
      if (!can_wrap())
        throw Error(refusal.what(), "it could be wrapped, but for OpenVDB", "install libopenvdb-dev and build again");
      why = refusal.what();
      why = why.substr(0, why.find(" in " + source));
    }
  filled.mesh = tetrahedralise(wrap(surface, *options, source), switches, 600, "the wrap of " + source);
  filled.note = fmt::format("{}, so it was wrapped with {} voxels across", why, options->voxels);
  keep_cached(file, key, filled.mesh.positions, filled.mesh.tets,
              std::vector<char>(filled.note.begin(), filled.note.end()));
  return filled;
}

DistanceField distance_field(const SurfaceMesh& surface, int voxels, const std::string& source) {
  require_openvdb("a distance field", source);
  require_extent(surface, source);
  constexpr int margin = 3;  // cells
  const Bounds box = bounds(surface.positions);
  const glm::dvec3 extent = box.high - box.low;
  DistanceField field;
  field.spacing = std::max({extent.x, extent.y, extent.z}) / voxels;
  field.size = glm::ivec3(glm::ceil(extent / field.spacing - 1e-9)) + 2 * margin + 1;
  field.origin = box.low - field.spacing * margin;
  const std::uint64_t key = mesh_key(surface, fmt::format("distance {}", voxels), "");
  const std::string file = fmt::format("{:016x}.distance", key);
  const std::size_t count = std::size_t(field.size.x) * std::size_t(field.size.y) * std::size_t(field.size.z);
  if (take_sealed(read_cached(file), key, field.values) && field.values.size() == count) return field;

  const Grid points = in_voxels(surface.positions, field.origin, field.spacing);
  bool is_signed = open_edges(surface.triangles).empty();
  if (is_signed) {
    field.values = grid_values({points, surface.triangles}, field.size, true);
    is_signed = std::ranges::min(field.values) < 0;  // a sheet with two sides has no inside
  }
  if (!is_signed) {
    field.values = grid_values({points, surface.triangles}, field.size, false);
    for (float& value : field.values) value -= 0.5f;
  }
  for (float& value : field.values) value *= float(field.spacing);
  keep_cached(file, key, field.values);
  return field;
}

}  // namespace tetpbd
