#include "app/lab/reference_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/files.h"
#include "app/lab/run.h"
#include "app/lab/truth.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/mesh/cache.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

using nlohmann::ordered_json;

constexpr const char* format_name = "tetpbd motion 1";

std::string hex(std::uint64_t key) { return fmt::format("{:016x}", key); }

void print_motion(const Scene& scene, const Motion& motion) {
  double error = 0, before = 0, after = 0, apex = 0;
  bool risen = false;
  for (const Motion::Row& row : motion.rows) {
    error = std::max(error, row.error);
    if (!risen) before = std::max(before, -row.velocity.y);
    risen = risen || row.velocity.y > 0;
    if (risen) after = std::max(after, row.velocity.y), apex = std::max(apex, row.centre.y);
  }
  const Motion::Row& last = motion.rows.back();
  fmt::print("{}: {} in steps of {:.3g} s, {:.3g} s of motion, {} instants kept\n", scene.name, motion.method,
             motion.step, last.time, motion.kept.size());
  fmt::print("  own error {:.2g} of the size: the most that steps twice as long are away\n", error);
  if (risen && before > 0)
    fmt::print("  centre of mass: {:.4g} m/s down, then {:.4g} m/s up to {:.4g} m\n", before, after, apex);
  fmt::print("  at the end: centre {:.5g} m high, energy {:.6g} J ({:.6g} kinetic)\n", last.centre.y,
             last.kinetic + last.potential, last.kinetic);
}

// The cache's file of this scene's motion; empty without a cache folder.
std::filesystem::path cached_motion(std::uint64_t scene) { return cache_file("motion_" + hex(scene)); }

// A line of JSON, then the kept positions as float64, frames x N x 3, in the first order of vertices.
void write_motion(const std::filesystem::path& file, const Model& model, const Motion& motion) {
  ordered_json head = {{"format", format_name},
                       {"scene", hex(motion.scene)},
                       {"method", motion.method},
                       {"dt", motion.dt},
                       {"step", motion.step},
                       {"vertices", model.masses.size()},
                       {"kept", motion.kept},
                       {"columns", {"time", "x", "y", "z", "vx", "vy", "vz", "kinetic", "potential", "error"}}};
  for (const Motion::Row& r : motion.rows)
    head["rows"].push_back({r.time, r.centre.x, r.centre.y, r.centre.z, r.velocity.x, r.velocity.y, r.velocity.z,
                            r.kinetic, r.potential, r.error});
  std::string text = head.dump() + "\n";
  for (const auto& positions : motion.positions) {
    const auto rows = in_original_order(model, positions);
    text.append(reinterpret_cast<const char*>(rows.data()), rows.size() * sizeof rows[0]);
  }
  write_file(file, text);
}

// Throws Error for what is no such file, or of another scene than `scene` (scene_key).
Motion read_motion(const std::filesystem::path& file, const Model& model, std::uint64_t scene) {
  std::ifstream in(file, std::ios::binary);
  std::string line;
  std::getline(in, line);
  const ordered_json head = ordered_json::parse(line, nullptr, false);
  Motion motion;
  const std::size_t count = model.masses.size();
  try {
    if (head.at("format") != format_name) throw std::exception();
    motion.scene = std::stoull(head.at("scene").get<std::string>(), nullptr, 16);
    motion.method = head.at("method"), motion.dt = head.at("dt"), motion.step = head.at("step");
    motion.kept = head.at("kept").get<std::vector<long>>();
    for (const auto& r : head.at("rows").get<std::vector<std::array<double, 10>>>())
      motion.rows.push_back({r[0], {r[1], r[2], r[3]}, {r[4], r[5], r[6]}, r[7], r[8], r[9]});
    if (motion.scene == scene)
      for (std::size_t k = 0; k < motion.kept.size(); ++k) {
        std::vector<glm::dvec3> rows(count), positions(count);
        in.read(reinterpret_cast<char*>(rows.data()), std::streamsize(count * sizeof rows[0]));
        if (!in) throw std::exception();
        for (std::size_t i = 0; i < count; ++i) positions[i] = rows[model.original[i]];
        motion.positions.push_back(positions);
      }
    if (motion.rows.empty() || motion.kept.empty()) throw std::exception();
  } catch (const std::exception&) {
    throw Error("not the motion of a scene", file.string(), "make it again: tetpbd reference");
  }
  if (motion.positions.empty())
    throw Error("the motion of another scene", file.string(),
                "its mesh, start, material, element, world or dt differ: tetpbd reference makes this one's");
  return motion;
}

std::filesystem::path find_and_keep(const Scene& scene, const Model& model, const ReferenceOptions& options) {
  const ConstraintSystem system = build_constraints(model, scene.settings);
  const ReferenceInput input{model, system, scene.settings, model.inverse_masses};
  const std::uint64_t key = motion_key(model, scene.settings, options.method);
  const std::filesystem::path file = options.out.empty() ? cached_motion(key) : options.out;
  if (file.empty()) throw Error("nowhere to keep it", "there is no cache folder", "give --out FILE");
  std::error_code ignored;  // a folder that cannot be made is named when the file is written
  if (options.out.empty()) std::filesystem::create_directories(file.parent_path(), ignored);
  const long steps = options.steps > 0 ? options.steps : duration_in_steps(scene);
  Progress progress(options.method == "ten-node" ? "the motion on finer meshes" : "the reference motion", steps,
                    options.progress);
  const Motion motion = find_motion(input, steps, options.method, file.string() + ".unfinished",
                                    [&](long done) { progress.update(done); });
  write_motion(file, model, motion);
  print_motion(scene, motion);
  return file;
}

std::optional<Motion> kept_motion(const Model& model, std::uint64_t scene, const std::filesystem::path& file) {
  const std::filesystem::path from = file.empty() ? cached_motion(scene) : file;
  std::error_code ignored;
  if (file.empty() && !std::filesystem::exists(from, ignored)) return std::nullopt;
  return read_motion(from, model, scene);
}

}  // namespace

std::optional<Motion> right_motion(const Model& model, const Settings& settings, const std::filesystem::path& file) {
  return kept_motion(model, scene_key(model, settings), file);
}

std::optional<Motion> rigid_motion(const Model& model, const Settings& settings, long steps) {
  if (any_material(settings, compliant)) return std::nullopt;
  try {
    return find_motion({model, {}, settings, model.inverse_masses}, steps);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return std::nullopt;
  }
}

void require_motion(const Scene& scene, const Model& model, long steps) {
  const auto known = right_motion(model, scene.settings);
  if (!known || known->kept.back() < steps) find_and_keep(scene, model, {.steps = steps});
}

std::shared_ptr<const Truth> require_truth(const Scene& scene, long steps, const std::filesystem::path& mesh) {
  const Scene finer = finer_scene(scene, mesh);
  const std::shared_ptr<const Model> model = build_model(finer);
  const ReferenceOptions options{.steps = steps, .method = "ten-node"};
  const std::uint64_t key = motion_key(*model, finer.settings, options.method);
  auto known = kept_motion(*model, key, {});
  if (!known || known->kept.back() < steps) known = kept_motion(*model, key, find_and_keep(finer, *model, options));
  return std::make_shared<const Truth>(Truth{model, std::move(*known)});
}

int run_reference(const Scene& scene, const ReferenceOptions& options) {
  catch_interrupts();
  Scene own = options.method == "ten-node" ? finer_scene(scene) : scene;
  // A run chooses a mode that has them.
  if (any_material(own.settings, smoothed) && own.mode_open) set_mode(own.settings, "newton", own.name);
  fmt::print("{}\n", find_and_keep(own, *build_model(own), options).string());
  return 0;
}

}  // namespace tetpbd
