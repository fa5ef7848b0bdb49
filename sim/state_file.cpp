#include "sim/state_file.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <fstream>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/gl/keep_bindings.h"
#include "sim/hash.h"
#include "sim/model/material.h"
#include "sim/snapshot.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

// To be raised with what a state consists of.
constexpr std::array<char, 16> magic = {"tetpbd state 3"};

struct Header {
  std::array<char, 16> begins = magic;
  std::uint64_t checksum = 0;             ///< of all that follows
  std::uint64_t model = 0, settings = 0;  ///< hashes
  std::uint64_t vertices = 0, pinned = 0, work = 0, impulses = 0, wrenches = 0, broken = 0,
                rest_metrics = 0;                        ///< items of lists
  std::uint64_t values = 0, readbacks = 0, buffers = 0;  ///< bytes likewise
  std::int64_t steps = 0, origin_step = 0;
  double origin_time = 0, dt = 0, quantum = 1, h = 0, fall = 0;
  std::int32_t substeps = 1, iterations = 1;
  std::uint32_t needs_predict = 1, read_index = 0, rigid_side = 0, on_cpu = 0;
};
static_assert(sizeof(Header) % 8 == 0);

std::uint64_t hash_of(const Model& model) {
  std::uint64_t hash = hash_values(model.rest.positions);
  hash = hash_values(model.rest.surface, hash_values(model.rest.tets, hash));
  for (const Attachment& a : model.attachments) hash = hash_values(a.vertices, hash);
  return hash_values(model.masses, hash);
}

std::uint64_t hash_of(const Settings& settings) {
  std::uint64_t hash = fnv_basis;
  const auto add = [&](const Settings& one) {
    for (const Parameter& row : parameters()) hash = hash_bytes(parameter_text(one, row) + "\n", hash);
  };
  add(settings);
  Settings own = settings;  // of one body after the other
  own.bodies.clear();
  for (std::size_t b = 0; b < settings.bodies.size(); ++b) {
    static_cast<Material&>(own) = material_of(settings, b);
    own.friction = friction_of(settings, b), own.restitution = restitution_of(settings, b);
    add(own);
    for (const RegionModuli& region : settings.bodies[b].regions)
      hash = hash_values(std::array{region.young_modulus.value_or(-1), region.poisson_ratio.value_or(-1)}, hash);
  }
  return hash;
}

template <class T>
void append(std::string& bytes, const std::vector<T>& list) {
  bytes.append(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T));
}

// Takes lists one after the other from the bytes behind a header.
class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& file) : bytes_(bytes), file_(file) {}
  template <class T>
  std::vector<T> take(std::uint64_t count) {
    if (count > bytes_.size() / sizeof(T)) fail();
    std::vector<T> list(count);
    std::memcpy(static_cast<void*>(list.data()), bytes_.data(), count * sizeof(T));
    bytes_.remove_prefix(count * sizeof(T));
    return list;
  }
  void end() const {
    if (!bytes_.empty()) fail();
  }

 private:
  [[noreturn]] void fail() const { throw Error("the state is damaged", file_.string(), "save it again"); }
  std::string_view bytes_;
  const fs::path& file_;
};

struct Saved {
  Header header;
  State state;
  VertexList pinned;
  Snapshot snapshot;
  std::vector<std::byte> buffers;
};

Saved read_saved(const Sim& sim, const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  Saved saved;
  Header& h = saved.header;
  if (bytes.size() < sizeof h || std::memcmp(bytes.data(), magic.data(), 13) != 0)
    throw Error("this is no state", file.string(), "name one that --save-state wrote");
  std::memcpy(&h, bytes.data(), sizeof h);
  if (h.begins != magic)
    throw Error("the state is of another version of tetpbd", file.string(), "save it again with this one");
  const std::string_view rest = std::string_view(bytes).substr(offsetof(Header, checksum) + sizeof h.checksum);
  if (hash_bytes(rest) != h.checksum) throw Error("the state is damaged", file.string(), "save it again");
  if (h.model != hash_of(*sim.model) || h.vertices != sim.masses.size())
    throw Error("the state is of another model", file.string(), "name the scene, mesh and fill that it was saved with");
  Reader reader(std::string_view(bytes).substr(sizeof h), file);
  saved.state.positions = reader.take<glm::dvec3>(h.vertices),
  saved.state.velocities = reader.take<glm::dvec3>(h.vertices);
  saved.state.work = reader.take<double>(h.work);
  saved.state.impulses = reader.take<PairImpulse>(h.impulses);
  saved.state.wrenches = reader.take<Wrench>(h.wrenches);
  saved.state.rest_metrics = reader.take<double>(h.rest_metrics);
  saved.pinned = reader.take<std::uint32_t>(h.pinned);
  saved.snapshot.broken = reader.take<char>(h.broken);
  saved.snapshot.values = reader.take<std::byte>(h.values);
  for (const std::uint8_t under_way : reader.take<std::uint8_t>(h.readbacks))
    saved.snapshot.readbacks.push_back(under_way != 0);
  saved.buffers = reader.take<std::byte>(h.buffers);
  reader.end();
  saved.snapshot.plan = {h.substeps, h.iterations, h.h};
  saved.snapshot.step = {
      long(h.steps), {long(h.origin_step), h.origin_time}, h.quantum, h.needs_predict != 0, h.read_index, h.rigid_side};
  if (h.on_cpu) saved.snapshot.host = saved.state;
  return saved;
}

VertexList pinned_now(const Sim& sim) {
  VertexList pinned;
  for (std::uint32_t v = 0; v < sim.masses.size(); ++v)
    if (is_pinned(sim, v)) pinned.push_back(v);
  return pinned;
}

void pin_these(Sim& sim, const VertexList& wanted) {
  std::vector<char> is_wanted(sim.masses.size());
  for (const std::uint32_t v : wanted) is_wanted[v] = 1;
  VertexList more, fewer;
  for (std::uint32_t v = 0; v < is_wanted.size(); ++v)
    if (bool(is_wanted[v]) != is_pinned(sim, v)) (is_wanted[v] ? more : fewer).push_back(v);
  pin(sim, more), unpin(sim, fewer);
}

}  // namespace

void save_state(Sim& sim, const fs::path& file) {
  const KeepBindings kept;
  if (check_finite(sim, true)) throw Error("the state is not finite", file.string(), "go back to a good one first", 1);
  const Buffer room("state", std::max<std::size_t>(snapshot_bytes(sim), 4));
  const Snapshot snapshot = take_snapshot(sim, room, 0);
  std::vector<std::byte> buffers(snapshot_bytes(sim));
  if (!buffers.empty()) room.read(0, buffers.size(), buffers.data());
  const State state = read_state(sim);
  const VertexList pinned = pinned_now(sim);
  const std::vector<std::uint8_t> readbacks(snapshot.readbacks.begin(), snapshot.readbacks.end());
  Header h;
  h.model = hash_of(*sim.model), h.settings = hash_of(sim.settings);
  h.vertices = state.positions.size(), h.pinned = pinned.size(), h.work = state.work.size();
  h.impulses = state.impulses.size(), h.wrenches = state.wrenches.size(), h.broken = sim.broken.size();
  h.rest_metrics = state.rest_metrics.size();
  h.values = snapshot.values.size(), h.readbacks = readbacks.size(), h.buffers = buffers.size();
  h.steps = sim.steps, h.origin_step = sim.origin.step, h.origin_time = sim.origin.time, h.dt = sim.settings.dt;
  h.quantum = sim.quantum, h.h = sim.plan.h, h.fall = half_substep_fall(sim.settings, sim.plan);
  h.substeps = sim.plan.substeps, h.iterations = sim.plan.iterations;
  h.needs_predict = sim.needs_predict, h.read_index = sim.read_index, h.rigid_side = sim.rigid_side;
  h.on_cpu = on_cpu(sim);
  std::string bytes(reinterpret_cast<const char*>(&h), sizeof h);
  append(bytes, state.positions), append(bytes, state.velocities), append(bytes, state.work);
  append(bytes, state.impulses), append(bytes, state.wrenches), append(bytes, state.rest_metrics);
  append(bytes, pinned);
  append(bytes, sim.broken);
  append(bytes, snapshot.values), append(bytes, readbacks), append(bytes, buffers);
  const std::size_t behind = offsetof(Header, checksum) + sizeof h.checksum;
  h.checksum = hash_bytes(std::string_view(bytes).substr(behind));
  std::memcpy(bytes.data() + offsetof(Header, checksum), &h.checksum, sizeof h.checksum);
  write_file(file, bytes);
}

bool load_state(Sim& sim, const fs::path& file) {
  const KeepBindings kept;
  if (!fs::is_regular_file(file)) throw Error("no such state", file.string(), "name one that --save-state wrote");
  Saved saved = read_saved(sim, file);
  const Header& h = saved.header;
  if (!saved.snapshot.broken.empty() && saved.snapshot.broken.size() != sim.model->attachments.size())
    throw Error("the state is damaged", file.string(), "save it again");
  set_broken(sim, saved.snapshot.broken);
  pin_these(sim, saved.pinned);
  std::size_t values = 0;
  const Carried now = carried(sim);
  for (const auto& plain : now.values) values += plain.size();
  const bool alike = h.settings == hash_of(sim.settings) && h.on_cpu == std::uint32_t(on_cpu(sim)) &&
                     h.values == values && h.readbacks == now.readbacks.size() && h.buffers == snapshot_bytes(sim);
  if (alike) {
    saved.snapshot.settings = sim.settings;
    saved.buffers.resize(std::max<std::size_t>(saved.buffers.size(), 4));
    restore_snapshot(sim, saved.snapshot, Buffer("state", saved.buffers));
    return true;
  }
  go_on_from(sim, std::move(saved.state), saved.snapshot.step, h.dt, h.fall);
  return false;
}

}  // namespace tetpbd
