// Everything that needs OpenVDB, because its headers take long to compile.
#include "sim/mesh/distance_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/mesh/cache.h"
#include "sim/parallel.h"

#ifdef TETPBD_OPENVDB
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
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

// Whether every edge has an even number of triangles, so that the surface separates inside from outside.
bool is_closed(const std::vector<Triangle>& triangles) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
  std::ranges::sort(edges);
  for (auto first = edges.begin(); first != edges.end();) {
    const auto next = std::find_if(first, edges.end(), [&](const auto& edge) { return edge != *first; });
    if ((next - first) % 2) return false;
    first = next;
  }
  return true;
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

// Near the surface OpenVDB finds the nearest triangle. From there, sweeps along all diagonals pass triangles on to
// neighbours where they are nearer. A band as wide as the grid would take OpenVDB 20 times as long.
std::vector<float> grid_values(const Polygons& mesh, const glm::ivec3& size, bool is_signed) {
  vdb::Int32Grid nearest(-1);
  constexpr float band = 3;
  vdb::initialize();
  const auto grid =
      vdb::tools::meshToVolume<vdb::FloatGrid>(mesh, *vdb::math::Transform::createLinearTransform(1.0), band, band,
                                               is_signed ? 0 : vdb::tools::UNSIGNED_DISTANCE_FIELD, &nearest);
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
std::vector<float> grid_values(const Polygons&, const glm::ivec3&, bool) { return {}; }
constexpr bool has_openvdb = false;

#endif

void require_openvdb(const std::string& what, const std::string& source) {
  if (!has_openvdb)
    throw Error(what + " needs OpenVDB, without which this program was built", source,
                "install libopenvdb-dev and build again");
}

}  // namespace

bool can_make_distance_fields() { return has_openvdb; }

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
  bool is_signed = is_closed(surface.triangles);
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
