// How a scene becomes a model: meshes loaded or made, filled, placed and deformed.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>

#include "app/commands.h"
#include "app/lab/progress.h"
#include "app/obstacles.h"
#include "app/scene.h"
#include "render/obstacles.h"
#include "sim/contact/starts.h"
#include "sim/error.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t most_tets = 30'000'000;

// The body's own tets, without a surface that it carries.
TetMesh mesh_of(const BodyDescription& body, const std::string& scene) {
  if (const auto& b = body.block)
    return b->taper > 0 ? make_spindle(b->size, b->cells, b->taper, b->mirror)
                        : make_block(b->size, b->cells, b->mirror);
  if (body.sheet) return make_sheet(body.sheet->size, body.sheet->cells);
  if (body.tet) {
    TetMesh mesh{{body.tet->begin(), body.tet->end()}, {{0, 1, 2, 3}}, {}};
    finish_tets(mesh, fmt::format("body '{}' of scene '{}'", body.name, scene));
    return mesh;
  }
  if (body.thickness > 0) return sheet_of(load_surface(body.mesh), body.mesh.string());
  return load_mesh(body.mesh, body.tetgen);
}

/// A body's tets, and what rides on them where it is not their own boundary. Tets of a file stay as flat as they are
/// unless the body is soft: a hard one takes no shorter steps for them.
Filled body_of(const BodyDescription& body, const std::string& scene, bool soft) {
  const fs::path& file = body.mesh.empty() ? body.surface : body.mesh;
  const bool made = body.block || body.sheet || body.tet || body.thickness > 0;
  const bool filled_here = !made && is_surface_file(file) && fs::is_regular_file(file);
  const auto options_for = [&](const std::vector<glm::dvec3>& positions) {
    FillOptions options = fill_options(body.mesh.empty() ? "lattice" : body.fill, body.tetgen, body.tets, body.spacing,
                                       fmt::format("body '{}' of scene '{}'", body.name, scene));
    const double height = bounds(positions).high.y - bounds(positions).low.y;
    options.scale = body.scale * (body.height > 0 && height > 0 ? body.height / (height * body.scale.y) : 1.0);
    options.progress = fill_progress(printable(file.string()));
    return options;
  };
  Filled result;
  if (filled_here) {
    SurfaceMesh surface = load_surface(file);
    for (glm::dvec3& p : surface.positions) p = upright(p, body.up);
    result = fill(surface, options_for(surface.positions), file.string());
  } else {
    result.mesh = mesh_of(body, scene);
    for (glm::dvec3& p : result.mesh.positions) p = upright(p, body.up);
  }
  if (!made && !filled_here) {
    FillOptions options = options_for(result.mesh.positions);
    if (!soft && options.by.empty() && !options.sized) options.by = "file";
    result = refill(std::move(result.mesh), options, file.string());
  }
  if (!result.note.empty())
    print_error(fmt::format("tetpbd: {}: {}\n", printable(file.string()), printable(result.note)));
  if (!body.surface.empty() && !(filled_here && body.mesh.empty())) {
    SurfaceMesh fine = load_surface(body.surface);
    for (glm::dvec3& p : fine.positions) p = upright(p, body.up) * result.scale;
    result.carried = carry(fine, result.mesh, body.surface.string());
    result.fit.gap = NAN;  // how far it is from the tets has not been measured
  }
  return result;
}

// By tet, the number from 1 on of the last region that its middle is in, and its density over the body's.
struct TetRegions {
  std::vector<std::uint8_t> number;
  std::vector<double> density;
};
TetRegions find_regions(const BodyDescription& body, const TetMesh& mesh, const Bounds& own, const std::string& scene) {
  TetRegions found{std::vector<std::uint8_t>(mesh.tets.size()), std::vector<double>(mesh.tets.size(), 1)};
  const glm::dvec3 extent = own.high - own.low;
  const double largest = std::max({extent.x, extent.y, extent.z});
  for (std::size_t r = 0; r < body.regions.size(); ++r) {
    const BodyDescription::Region& region = body.regions[r];
    const auto place = [&] { return fmt::format("'regions.{}' of body '{}' of {}", r, body.name, scene); };
    if (region.tag && mesh.tags.size() != mesh.tets.size())
      throw Error("the body's tets have no tags", place(),
                  "name a .msh with physical groups or an .ele with an attribute, or give a box");
    bool any = false;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
      glm::dvec3 middle(0);
      for (const std::uint32_t v : mesh.tets[t]) middle += mesh.positions[v] / 4.0;
      const glm::dvec3 at = middle - own.low;
      bool inside = region.tag && mesh.tags[t] == *region.tag;
      if (region.box)
        inside = glm::all(glm::lessThanEqual(region.box->low * extent, at)) &&
                 glm::all(glm::lessThanEqual(at, region.box->high * extent));
      if (region.radius > 0) inside = glm::distance(at, region.centre * extent) <= region.radius * largest;
      if (!inside) continue;
      any = true, found.number[t] = std::uint8_t(r + 1);
      found.density[t] = region.density.value_or(body.density) / body.density;
    }
    if (!any) throw Error("a region holds no tet", place(), "make it larger; low, high and centre are fractions");
  }
  return found;
}

// Moves so many of these points, m, about the middle of where they start.
Fixture fixture_of(const Path& from_start, std::vector<std::uint32_t> vertices,
                   const std::vector<glm::dvec3>& positions) {
  std::vector<glm::dvec3> held;
  for (const std::uint32_t v : vertices) held.push_back(positions[v]);
  Fixture fixture{0, 0, std::move(vertices), from_start};
  fixture.path.centre = bounds(held).centre();
  for (Path::Key& key : fixture.path.keyframes) key.centre += fixture.path.centre;
  return fixture;
}

// How many times the mass of each vertex is that of a body of one density.
std::vector<double> region_mass_factors(const TetMesh& mesh, const TetRegions& regions) {
  std::vector<double> mass(mesh.positions.size()), plain(mesh.positions.size());
  const std::vector<double> volumes = tet_volumes(mesh);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const std::uint32_t v : mesh.tets[t]) {
      const double own = volumes[t] * fill_of(mesh, t);
      mass[v] += regions.density[t] * own, plain[v] += own;
    }
  for (std::size_t v = 0; v < mass.size(); ++v) mass[v] = plain[v] > 0 ? mass[v] / plain[v] : 1;
  return mass;
}

void add_carried(CarriedSurface& all, const CarriedSurface& more, std::size_t first_tet) {
  const auto base = std::uint32_t(all.vertices.size());
  for (auto [tet, weights] : more.vertices) all.vertices.push_back({tet + std::uint32_t(first_tet), weights});
  for (const auto& [a, b, c] : more.triangles) all.triangles.push_back({a + base, b + base, c + base});
}

// By fixed box, which vertices are in it.
std::vector<std::vector<char>> find_fixed(const BodyDescription& body, std::size_t vertices,
                                          const std::function<bool(std::size_t, const PartBox&)>& is_in,
                                          const std::string& scene) {
  std::vector<std::vector<char>> in_fixed(body.fixed.size());
  for (std::size_t b = 0; b < body.fixed.size(); ++b) {
    for (std::size_t i = 0; i < vertices; ++i) in_fixed[b].push_back(is_in(i, body.fixed[b]));
    if (!std::ranges::count(in_fixed[b], 1))
      throw Error("a fixed region holds no vertex", fmt::format("'fixed.{}' of body '{}' of {}", b, body.name, scene),
                  "low and high are fractions of the body's bounding box: make it larger");
  }
  return in_fixed;
}

void multiply_heavy(const BodyDescription& body, std::vector<double>& mass_factors,
                    const std::function<bool(std::size_t, const PartBox&)>& is_in, int seed) {
  std::mt19937 generator{std::uint32_t(seed)};
  for (std::size_t i = 0; i < mass_factors.size(); ++i)
    for (const BodyDescription::Box& heavy : body.heavy) {
      const bool chosen = double(generator()) / 4294967296.0 < heavy.share;
      if (chosen && is_in(i, heavy)) mass_factors[i] *= heavy.ratio;
    }
}

void add_moving_fixtures(Model& model, const BodyDescription& body, const std::vector<std::vector<char>>& in_fixed,
                         const std::vector<glm::dvec3>& start) {
  for (std::size_t b = 0; b < body.fixed.size(); ++b) {
    if (!moves(body.fixed[b].path)) continue;
    std::vector<std::uint32_t> held;
    for (std::uint32_t i = 0; i < start.size(); ++i)
      if (in_fixed[b][i]) held.push_back(i);
    model.fixtures.push_back(fixture_of(body.fixed[b].path, std::move(held), start));
    Fixture& made = model.fixtures.back();
    made.body = model.bodies.size(), made.region = b;
    for (std::uint32_t& v : made.vertices) v += std::uint32_t(model.positions.size());
  }
}

/// Adds the next body; whether it carries a surface of its own.
bool place_body(Model& model, const BodyDescription& body, const Scene& scene, Filled filled) {
  const std::size_t number = model.bodies.size();
  TetMesh& mesh = filled.mesh;
  const CarriedSurface& carried = filled.carried;
  const bool sized = !mesh.fill.empty();  // before it was filled
  if (!mesh.tets.empty())                 // a sheet is drawn as itself
    add_carried(model.carried, carried.triangles.empty() ? carry_boundary(mesh) : carried, model.rest.tets.size());
  if (!sized)
    for (auto& p : mesh.positions) p *= body.scale;
  if (model.rest.tets.size() + mesh.tets.size() > most_tets)
    throw Error("the scene is too large", fmt::format("body '{}' of {}", body.name, scene.name),
                fmt::format("keep to {} tets in all", most_tets));
  const glm::dmat3 turn = rotation_of(body.rotation);
  // Fixed and heavy vertices are chosen in the mesh's own frame, before it is turned.
  const Bounds own = bounds(mesh.positions);
  const glm::dvec3 extent = glm::max(own.high - own.low, glm::dvec3(1e-300));
  // A flat side of a surface is nearly flat on its lattice: a box as thin as a plane takes what is near it.
  const glm::dvec3 least = mesh.fill.empty() ? glm::dvec3(0) : 0.3 * mean_edge(mesh) / extent;
  const auto is_in = [&](std::size_t vertex, const PartBox& box) {
    const glm::dvec3 away = (mesh.positions[vertex] - own.low) / extent - 0.5 * (box.low + box.high);
    return glm::all(glm::lessThanEqual(glm::abs(away), glm::max(0.5 * (box.high - box.low) + 1e-9, least)));
  };
  TetRegions regions;
  std::vector<double> mass_factors(mesh.positions.size(), 1);
  if (!body.regions.empty())
    regions = find_regions(body, mesh, own, scene.name), mass_factors = region_mass_factors(mesh, regions);
  const auto in_fixed = find_fixed(body, mesh.positions.size(), is_in, scene.name);
  choose_parts({model, mesh, turn, is_in}, scene.attachments, scene.forces, body.fibres);
  std::vector<std::uint32_t> fixed;
  for (std::uint32_t i = 0; i < mesh.positions.size(); ++i)
    if (std::ranges::any_of(in_fixed, [&](const auto& inside) { return bool(inside[i]); })) fixed.push_back(i);
  multiply_heavy(body, mass_factors, is_in, scene.settings.seed);
  if (body.height > 0 && !(own.high.y > own.low.y))
    throw Error("a flat sheet has no height", fmt::format("body '{}' of {}", body.name, scene.name),
                "give scale or size");
  if (const std::string units = question_units(own.high - own.low);
      !body.mesh.empty() && body.height == 0 && !units.empty())
    print_error(fmt::format("tetpbd: {}: body '{}' is {}\n", scene.name, body.name, units));
  const double scale = body.height > 0 && !sized ? body.height / (own.high.y - own.low.y) : 1.0;
  for (auto& p : mesh.positions) p = turn * ((p - own.centre()) * scale);
  const Bounds placed = bounds(mesh.positions);
  const glm::dvec3 bottom(placed.centre().x, placed.low.y, placed.centre().z);
  for (auto& p : mesh.positions) p += body.position - bottom;
  if (mesh.tets.empty()) mesh.thickness = body.thickness > 0 ? body.thickness : 1e-3 * placed.size();
  std::vector<glm::dvec3> start = mesh.positions;
  deform(start, mesh, body.deform, unsigned(scene.settings.seed) + 0x9e3779b9u * unsigned(number));
  Fit& fit = filled.fit;  // a lattice is as large as it will be
  fit.thinnest_at = turn * (fit.thinnest_at - own.centre()) + body.position - bottom;
  if ((!body.mesh.empty() || !body.surface.empty()) && !mesh.tets.empty())
    model.fills.push_back({number, filled.note, fit});
  add_moving_fixtures(model, body, in_fixed, start);
  if (const auto& has = scene.settings.bodies; !has.empty() && !has[number].regions.empty()) {
    model.regions.resize(model.rest.tets.size());
    model.regions.insert(model.regions.end(), regions.number.begin(), regions.number.end());
  }
  add_body(model, body.name, mesh, body.density, start, body.velocity, body.spin, fixed, mass_factors);
  return !carried.triangles.empty();
}

// Bytes that could be used without swapping; infinite where the system does not say.
double available_memory() {
  std::ifstream file("/proc/meminfo");
  const std::string text{std::istreambuf_iterator<char>(file), {}}, key = "MemAvailable:";
  const std::size_t at = text.find(key);
  return at == text.npos ? INFINITY : 1024 * std::strtod(text.c_str() + at + key.size(), nullptr);
}

// Before copies are made: once they are too many, the system ends the program without a word.
void require_memory(const Model& one, const Scene& scene) {
  constexpr double bytes_an_element =
      1500;  // of model, constraints and what makes them; 1060 with `soft-beam` in newton
  const double elements = double(std::max(one.rest.tets.size(), one.rest.surface.size()));
  const double needed = bytes_an_element * elements * scene.copies, available = available_memory();
  if (needed <= available && elements * scene.copies <= double(most_tets)) return;
  throw Error(fmt::format("{} copies of {} tets need about {:.3g} bytes, and {:.3g} are free", scene.copies,
                          one.rest.tets.size(), needed, available),
              fmt::format("--copies {}", scene.copies),
              fmt::format("take at most {:.0f}", std::floor(std::min(available / bytes_an_element, double(most_tets)) /
                                                            std::max(1.0, elements))));
}

}  // namespace

std::shared_ptr<Model> build_model(const Scene& scene) {
  auto model = std::make_shared<Model>();
  bool carries = false;
  const std::size_t each = scene.bodies.size() / std::size_t(scene.copies);
  std::vector<Filled> filled;  // of one copy
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyDescription& body = scene.bodies[b];
    if (b < each) filled.push_back(body_of(body, scene.name, compliant(material_of(scene.settings, b))));
    carries = place_body(*model, body, scene, filled[b % each]) || carries;
    if (b + 1 == each && scene.copies > 1) require_memory(*model, scene);
  }
  if (!carries) model->carried = {};
  if (!model->regions.empty()) model->regions.resize(model->rest.tets.size());
  for (const Obstacle& obstacle : scene.obstacles) {
    model->obstacles.push_back(obstacle);
    load_field(model->obstacles.back());
  }
  renumber(*model);
  model->start_motions = separate_starts(*model, scene.settings);
  for (const StartMotion& motion : model->start_motions)
    print_error(fmt::format("tetpbd: {}: {}\n", scene.name, describe(motion)));
  finish_parts(*model, scene.attachments, scene.forces, scene.settings, scene.name);
  return model;
}

Camera scene_camera(const Scene& scene, const Model& model, float aspect) {
  if (scene.camera) return *scene.camera;
  Bounds box = bounds(model.positions);
  const Bounds rest = bounds(model.rest.positions);
  box.low = glm::min(box.low, rest.low);
  box.high = glm::max(box.high, rest.high);
  box = with_obstacles(box, model, 0, 2 * box.size());
  if (scene.settings.ground) box.low.y = std::min(box.low.y, scene.settings.ground_height);
  Camera camera;
  frame_box(camera, glm::vec3(box.low), glm::vec3(box.high), aspect);
  return camera;
}

}  // namespace tetpbd
