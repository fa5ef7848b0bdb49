#include "sim/mesh/lattice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "sim/interrupt.h"
#include "sim/mesh/lattice_cells.h"
#include "sim/mesh/thickness.h"
#include "sim/parallel.h"

namespace tetpbd {
namespace {

// Raises small shares, because what is lighter and softer would be crushed by what is behind it, and then scales those
// below 1 so that the volume is right: that of a closed surface, which samples miss by some thousandths.
void settle_shares(TetMesh& mesh, const Outward& outward) {
  constexpr float least = 0.7f;
  constexpr double most = 0.05;  // beyond it the surface overlaps itself, or the lattice left something out
  double right = filled_volume(mesh), whole = 0, part = 0;
  if (outward.closed && std::abs(right - outward.volume) < most * outward.volume) right = outward.volume;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    mesh.fill[t] = std::max(mesh.fill[t], least);
    (mesh.fill[t] < 1 ? part : whole) += double(mesh.fill[t]) * tet_volume(mesh, mesh.tets[t]);
  }
  const double factor = part > 0 ? std::clamp((right - whole) / part, 0.1, 1.4) : 1;
  for (float& fill : mesh.fill)
    if (fill < 1) fill *= float(factor);
}

// Vertices of the boundary go to the surface and others between their neighbours, as far as no altitude gets shorter
// than 0.45 of the spacing (0.71 in the lattice), or none gets shorter at all.
void fit(TetMesh& mesh, const Solid& solid, double h, const auto& watch) {
  constexpr int passes = 12;
  constexpr double floor = 0.45;
  const Grouped around = group_by_key(4 * mesh.tets.size(), mesh.positions.size(), [&](std::size_t i, auto&& emit) {
    emit(mesh.tets[i / 4][i % 4], std::uint32_t(i / 4));
  });
  const std::vector<char> outer = outer_vertices(mesh);
  for (int pass = 0; pass < passes; ++pass) {
    watch(double(pass) / passes);
    for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
      const std::uint32_t *first = &around.values[around.first[v]], *end = &around.values[around.first[v + 1]];
      const auto least = [&] {
        double altitude = INFINITY;
        for (const std::uint32_t* t = first; t < end; ++t)
          altitude = std::min(altitude, least_altitude(mesh, mesh.tets[*t]));
        return altitude;
      };
      glm::dvec3& x = mesh.positions[v];
      const glm::dvec3 from = x;
      glm::dvec3 aim(0);
      if (outer[v]) {
        aim = solid.nearest(from).point;
      } else {
        for (const std::uint32_t* t = first; t < end; ++t)
          for (const std::uint32_t w : mesh.tets[*t]) aim += w != v ? mesh.positions[w] : glm::dvec3(0);
        aim = 0.5 * (from + aim / (3.0 * double(end - first)));
      }
      const double before = least();
      for (const double part : {1.0, 0.5, 0.25, 0.1, 0.0}) {
        x = from + part * (aim - from);
        const double now = part > 0 ? least() : before;
        if (now >= floor * h || now >= before) break;
      }
    }
  }
}

// m^3, of what is inside, by points of a grid.
double sampled_volume(const Solid& solid, const Bounds& box) {
  constexpr int across = 40;
  const double cell = std::max({box.high.x - box.low.x, box.high.y - box.low.y, box.high.z - box.low.z}) / across;
  const glm::ivec3 size = glm::max(glm::ivec3(glm::ceil((box.high - box.low) / cell)), 1);
  std::vector<std::size_t> counts(std::size_t(size.z), 0);
  parallel_for(counts.size(), 1, [&](std::size_t z) {
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x)
        counts[z] += solid.winding(box.low + cell * (glm::dvec3(x, y, double(z)) + 0.47)) > inside_winding;
  });
  return std::pow(cell, 3) * double(std::accumulate(counts.begin(), counts.end(), std::size_t(0)));
}

// m^3, of a thin body: rays meet each part of it from two sides.
double thin_volume(const std::vector<Depth>& depths, double area) {
  double volume = 0;
  for (const Depth& d : depths) volume += std::isfinite(d.depth) ? d.depth * area / double(depths.size()) / 2 : 0;
  return volume;
}

// Cells of volume h^3 / 12 fill the body and stick out of its surface by a part of h.
double expected_tets(double volume, double area, double h) { return 12 * (volume + 0.22 * area * h) / std::pow(h, 3); }
double spacing_for(double tets, double volume, double area) {
  double low = 1e-9 * std::cbrt(volume), high = 100 * std::cbrt(volume);
  for (int k = 0; k < 80; ++k) {
    const double h = std::sqrt(low * high);
    (expected_tets(volume, area, h) > tets ? low : high) = h;
  }
  return high;
}

double available_bytes() {
  std::ifstream file("/proc/meminfo");
  std::string word;
  double kilobytes = INFINITY;
  while (file >> word)
    if (word == "MemAvailable:") file >> kilobytes;
  return 1024 * kilobytes;
}

void require_memory(double tets, const Bounds& box, double h, const std::string& source) {
  constexpr double bytes_a_tet = 1500, most_points = 1e9;
  const glm::dvec3 extent = (box.high - box.low) / h + 4.0;
  const double needed = bytes_a_tet * tets, available = available_bytes(), points = extent.x * extent.y * extent.z;
  if (needed <= available && points <= most_points) return;
  throw Error(fmt::format("a lattice with a spacing of {:.3g} m is too fine", h),
              points > most_points
                  ? fmt::format("it has {:.3g} points, of at most {:.0g}, for {}", points, most_points, source)
                  : fmt::format("it takes {:.3g} bytes for {:.3g} tets of {}, and {:.3g} are available", needed, tets,
                                source, available),
              fmt::format("give a spacing of {:.2g} or more",
                          h * std::max(std::cbrt(needed / available), std::cbrt(points / most_points)) * 1.1));
}

// Of the vertices that the surface names, how many are further than a cell from all tets.
double share_outside(const SurfaceMesh& surface, const Solid& boundary, double h) {
  std::vector<char> far(surface.positions.size(), 0);
  parallel_for(far.size(), 256, [&](std::size_t v) {
    const glm::dvec3& p = surface.positions[v];
    far[v] = boundary.nearest(p, h).distance >= h && std::abs(boundary.winding(p)) < inside_winding;
  });
  return double(std::ranges::count(far, 1)) / double(std::max<std::size_t>(far.size(), 1));
}

// How far outer vertices are from the surface: in the mean of squares, and at most.
std::pair<double, double> gap(const TetMesh& mesh, const Solid& solid) {
  const std::vector<char> outer = outer_vertices(mesh);
  std::vector<double> distances(outer.size(), 0);
  parallel_for(outer.size(), 64, [&](std::size_t v) {
    if (outer[v]) distances[v] = solid.nearest(mesh.positions[v]).distance;
  });
  double squares = 0;
  for (const double d : distances) squares += d * d;
  return {std::sqrt(squares / double(std::ranges::count(outer, 1))), std::ranges::max(distances)};
}

std::string note_on(const std::vector<Depth>& depths, double left_out, double outside, std::pair<double, double> gap,
                    double h) {
  constexpr double worth_saying = 0.2;  // of a cell
  std::vector<std::string> notes;
  if (gap.second > worth_saying * h)
    notes.push_back(fmt::format("its boundary, which collides, is {:.2g} m off the surface, {:.2g} m at most",
                                gap.first, gap.second));
  if (outside > 1e-3)
    notes.push_back(fmt::format("{:.2g} % of its vertices enclose nothing and are embedded in the nearest tet", 100 * outside));
  const auto thin = std::ranges::lower_bound(depths, h, {}, &Depth::depth) - depths.begin();
  if (const double share = double(thin) / double(depths.size()), part = thinnest(depths).depth; share > 0.02)
    notes.push_back(fmt::format("{:.0f} % of it is thinner than a cell: {:.3g} m; spacing {:.2g} would do", 100 * share,
                                part, part));
  if (left_out > 1e-3)
    notes.push_back(fmt::format("{:.2g} % of its volume hangs on by less than a cell and is left out", 100 * left_out));
  return fmt::format("{}", fmt::join(notes, "; "));
}

}  // namespace

Lattice fill_with_lattice(const SurfaceMesh& given, const LatticeSize& size, const std::string& source,
                          const std::function<void(double)>& progress) {
  const auto watch = [&](double from, double to) {
    return [&progress, &source, from, to](double part) {
      if (interrupted()) throw Error("interrupted", source, "start again; nothing was written", 1);
      if (progress) progress(from + part * (to - from));
    };
  };
  const SurfaceCheck values = check_values(given);
  if (values.hopeless) throw Error(values.defect, values.place + " in " + source, values.hint);
  const Outward outward = turn_outward(given);
  const SurfaceMesh& surface = outward.surface;
  const Solid solid(surface);
  const Bounds box = bounds(surface.positions);
  const double area = area_of(surface);
  double volume = surface.triangles.empty() ? 0 : sampled_volume(solid, box);
  const std::vector<Depth> depths = measure_depths(surface, solid);
  if (!(volume > 0)) volume = thin_volume(depths, area);  // it is between the grid's points
  if (!(volume > 0))
    throw Error("the surface encloses nothing that a lattice could fill", source,
                "close it, or give \"thickness\", which makes it a sheet");
  Lattice lattice;
  lattice.cavities = outward.cavities;
  double h = size.spacing > 0 ? size.spacing : spacing_for(size.tets, volume, area);
  for (int turn = 0;; ++turn) {
    require_memory(expected_tets(volume, area, h), box, h, source);
    if (const double median = depths.empty() ? INFINITY : depths[depths.size() / 2].depth; 8 * median < h)
      throw Error("half of the body is thinner than an eighth of a cell",
                  fmt::format("{:.3g} m of {:.3g} m, in {}", median, h, source),
                  fmt::format("give a spacing of {:.2g}, or \"thickness\", which makes it a sheet", 2 * median));
    LatticeCells cells(solid, box, h);
    cells.find(watch(0.1 * turn, 0.1 * turn + 0.1));
    if (cells.all().empty())
      throw Error(fmt::format("a lattice with a spacing of {:.3g} m finds nothing inside", h), source,
                  "give a smaller spacing, or more tets");
    const double ratio = double(cells.all().size()) / size.tets;
    if (size.spacing == 0 && turn < 2 && std::abs(ratio - 1) > 0.1) {
      h *= std::pow(ratio, 0.36);
      continue;
    }
    cells.join();
    double left_out = 0;
    lattice.parts = int(cells.keep_parts(outward.patches, lattice.mesh, left_out));
    for (int round = 0;; ++round) {
      finish_tets(lattice.mesh, source);
      fit(lattice.mesh, solid, h, watch(0.3 + 0.22 * round, 0.38 + 0.22 * round));
      cells.fill(lattice.mesh);
      if (round == 2) break;
      cells.peel(lattice.mesh);
      double off = 0;
      lattice.parts = int(cells.keep_parts(outward.patches, lattice.mesh, off));
      left_out += off;
    }
    settle_shares(lattice.mesh, outward);
    const SurfaceMesh outside{lattice.mesh.positions, lattice.mesh.surface};
    const Solid boundary(outside);
    lattice.carried = cells.carry_surface(given, lattice.mesh, boundary, source);
    const auto off = gap(lattice.mesh, solid);
    lattice.note = note_on(depths, left_out, share_outside(surface, boundary, h), off, h);
    const Depth thin = thinnest(depths);
    lattice.fit = {thin.depth, thin.at, off.second, mean_edge(lattice.mesh)};
    break;
  }
  lattice.spacing = h;
  return lattice;
}

}  // namespace tetpbd
