#include "app/export.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "app/commands.h"
#include "app/window/probe.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

std::vector<glm::vec3> rows_of(const Model& model, const std::vector<glm::dvec3>& vectors) {
  std::vector<glm::vec3> rows;
  for (const glm::dvec3& v : in_original_order(model, vectors)) rows.emplace_back(v);
  return rows;
}

// Of each vertex; bodies own ranges of them, in either order.
std::vector<std::uint32_t> body_numbers(const Model& model) {
  std::vector<std::uint32_t> numbers;
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b) numbers.insert(numbers.end(), model.bodies[b].vertices, b);
  return numbers;
}

// What is seen: the fine surface that rides on the tets, else their boundary.
SurfaceMesh seen_surface(const Model& model, const std::vector<glm::dvec3>& positions) {
  SurfaceMesh surface{carried_positions(model.carried, model.rest.tets, positions), model.carried.triangles};
  if (surface.triangles.empty()) {
    surface = {in_original_order(model, positions), in_original_numbers(model, model.rest.surface)};
  } else {  // and sheets, which carry none
    const auto base = std::uint32_t(surface.positions.size());
    surface.positions.insert(surface.positions.end(), positions.begin(), positions.end());
    for (const Body& body : model.bodies)
      for (std::size_t t = 0; body.is_sheet() && t < body.triangles; ++t) {
        const auto& [i, j, k] = model.rest.surface[body.first_triangle + t];
        surface.triangles.push_back({i + base, j + base, k + base});
      }
  }
  for (glm::dvec3& p : surface.positions) p = glm::vec3(p);
  drop_unused_vertices(surface.positions, surface.triangles);
  return surface;
}

// Samples follow: the vertices of the OBJ, in its order.
std::string pc2_header(std::size_t vertices, long frames) {
  const auto bytes = [](auto value) { return bytes_of(std::vector{value}); };
  return std::string("POINTCACHE2\0", 12) + bytes(std::int32_t(1)) + bytes(std::int32_t(vertices)) + bytes(0.0f) +
         bytes(1.0f) + bytes(std::int32_t(frames));
}

// VTK's XML: arrays follow the text as they are, each behind its length.
std::string vtu_text(const Sim& sim, const State& state, const std::vector<glm::vec3>& positions) {
  const Model& model = *sim.model;
  const std::size_t tets = model.rest.tets.size();
  std::string data;
  const auto array = [&]<class T>(const char* type, const char* name, const std::vector<T>& values) {
    const std::string tag =
        fmt::format("<DataArray type=\"{}\" Name=\"{}\"{} format=\"appended\" offset=\"{}\"/>\n", type, name,
                    std::is_same_v<T, glm::vec3> ? " NumberOfComponents=\"3\"" : "", data.size());
    data += bytes_of(std::vector{std::uint64_t(values.size() * sizeof(T))}) + bytes_of(values);
    return tag;
  };
  std::vector<glm::vec3> moved = rows_of(model, model.rest.positions);
  std::ranges::transform(positions, moved, moved.begin(), std::minus{});
  std::array<std::vector<float>, 3> values;
  std::vector<std::uint32_t> ends;
  const auto& x = state.positions;
  std::vector<float> stored(has_averages(sim.system) ? x.size() : 0);  // of smoothed tets, by vertex
  for (std::size_t v = 0; v < stored.size(); ++v)
    stored[v] =
        average_energy(sim.system.averages, v, x, energy_material(solved_material(body_at(model, v), sim.settings)));
  for (std::size_t t = 0; t < tets; ++t) {
    const auto [a, b, c, d] = model.rest.tets[t];
    const glm::vec4 material = tet_energy_material(model, sim.settings, t);
    TetValues now = tet_values(model, t, {x[a], x[b], x[c], x[d]}, material);
    for (const std::uint32_t corner : {a, b, c, d})
      if (material.z == 3) now.energy += 0.25f * stored[corner];
    values[0].push_back(now.volume), values[1].push_back(now.strain), values[2].push_back(now.energy);
    ends.push_back(std::uint32_t(4 * (t + 1)));
  }
  // The triangles of sheets, which have no tet.
  std::vector<Triangle> sheets;
  for (const Body& body : model.bodies)
    for (std::size_t t = 0; body.is_sheet() && t < body.triangles; ++t) {
      sheets.push_back(model.rest.surface[body.first_triangle + t]);
      ends.push_back(std::uint32_t(4 * tets + 3 * sheets.size()));
      for (auto& list : values) list.push_back(0);
    }
  std::vector<std::uint32_t> corners;
  for (const Tet& tet : original_tets(model)) corners.insert(corners.end(), tet.begin(), tet.end());
  for (const Triangle& t : in_original_numbers(model, sheets)) corners.insert(corners.end(), t.begin(), t.end());
  std::vector<std::uint8_t> types(tets, 10);  // VTK's numbers
  types.resize(ends.size(), 5);
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" "
      "header_type=\"UInt64\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n",
      positions.size(), types.size());
  text += "<Points>\n" + array("Float32", "Points", positions) + "</Points>\n<Cells>\n";
  text += array("Int32", "connectivity", corners) + array("Int32", "offsets", ends);
  text += array("UInt8", "types", types) + "</Cells>\n<PointData>\n";
  text += array("Float32", "displacement", moved);
  text += array("Float32", "velocity", rows_of(model, state.velocities));
  text += array("Int32", "body", body_numbers(model)) + "</PointData>\n<CellData>\n";
  text += array("Float32", "volume_error", values[0]) + array("Float32", "strain", values[1]);
  if (any_material(sim.settings, has_energy)) text += array("Float32", "energy_density", values[2]);
  return text + "</CellData>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_" + data +
         "\n</AppendedData>\n</VTKFile>\n";
}

}  // namespace

void write_arrays(const Sim& sim, const std::filesystem::path& folder) {
  const Model& model = *sim.model;
  const State state = read_state(sim);
  write_npy(folder / "positions.npy", rows_of(model, state.positions));
  write_npy(folder / "velocities.npy", rows_of(model, state.velocities));
  write_npy(folder / "rest.npy", rows_of(model, model.rest.positions));
  write_npy(folder / "tets.npy", original_tets(model));
  write_npy(folder / "faces.npy", in_original_numbers(model, model.rest.surface));
  write_npy(folder / "bodies.npy", body_numbers(model));
  if (model.carried.triangles.empty()) return;
  const SurfaceMesh surface = seen_surface(model, state.positions);
  write_npy(folder / "surface.npy", std::vector<glm::vec3>(surface.positions.begin(), surface.positions.end()));
  write_npy(folder / "surface_faces.npy", surface.triangles);
}

Export::Export(const Sim& sim, const RunOptions& options)
    : folder(options.out),
      vtk(std::ranges::count(options.exports, "vtk") > 0),
      ply(std::ranges::count(options.exports, "ply") > 0),
      every(options.positions_every > 0 ? options.positions_every : steps_per_frame(sim.settings.dt)) {
  if (vtk) make_output_folder(folder / "vtk"), remove_frames(folder / "vtk", ".vtu");
  if (ply) make_output_folder(folder / "ply"), remove_frames(folder / "ply", ".ply");
  if (options.positions_every > 0) trajectory.emplace(folder / "trajectory.npy").add(npy_header(true, {}));
  if (std::ranges::count(options.exports, "pc2")) cache.emplace(folder / "surface.pc2").add(pc2_header(0, 0));
}

void add_frame(Export& files, const Sim& sim) {
  const State state = read_state(sim);
  const std::vector<glm::vec3> positions = rows_of(*sim.model, state.positions);
  const std::string name = fmt::format("frame_{:05}", sim.steps);
  if (files.trajectory) files.trajectory->add(bytes_of(positions));
  if (files.vtk) {
    write_file(files.folder / "vtk" / (name + ".vtu"), vtu_text(sim, state, positions));
    files.times += fmt::format("<DataSet timestep=\"{:.9g}\" file=\"vtk/{}.vtu\"/>\n", simulated_time(sim), name);
  }
  if (files.cache || files.ply) {
    const SurfaceMesh surface = seen_surface(*sim.model, state.positions);
    files.surface_vertices = surface.positions.size();
    if (files.ply) write_surface(files.folder / "ply" / (name + ".ply"), surface);
    if (files.cache && files.count == 0) write_surface(files.folder / "surface.obj", surface);
    if (files.cache)
      files.cache->add(bytes_of(std::vector<glm::vec3>(surface.positions.begin(), surface.positions.end())));
  }
  ++files.count;
}

void close(Export& files, const Sim& sim) {
  const std::size_t frames = std::size_t(files.count);
  if (auto& file = files.trajectory) {
    file->overwrite_start(npy_header(true, {frames, sim.model->positions.size(), 3}));
    file->close();
  }
  if (auto& file = files.cache) {
    file->overwrite_start(pc2_header(files.surface_vertices, files.count));
    file->close();
  }
  if (files.vtk)
    write_file(files.folder / "frames.pvd",
               "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n" + files.times +
                   "</Collection>\n</VTKFile>\n");
}

}  // namespace tetpbd
