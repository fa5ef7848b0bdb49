#include "app/window/grab.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "sim/contact/moving_obstacle.h"

namespace tetpbd {

namespace {

constexpr std::size_t most_neighbours = 32;
constexpr std::size_t most_held = 128;

// A hold falls behind by so much of its radius: with more its own tets are sheared by more than a half.
constexpr double slack_of_radius = 0.3;

// The vertex may go this part of an edge in one step. A tet turns inside out when a vertex passes its
// opposite face, about 0.8 of an edge away; a quarter leaves the solver several steps to answer, also while
// the read-back that sets the pace is a few steps old.
constexpr double edges_a_step = 0.25;

// So many edges from the mean of its neighbours the vertex stops, and beyond turns back: what does not follow
// is held somewhere (a clamped end, another pin), and pulling on would only draw out a spike of flat tets.
constexpr double edges_at_most = 2.5;

// It stays within this many edges of a vertex that something holds back; a read-back is some steps old.
constexpr double edges_ahead = 4;

// Takes in the watched positions that have come back, and asks for the next.
void watch(Grab& grab, const Buffer& positions, bool wait = false) {
  if (const auto copy = poll_readback<Position>(grab.copied, grab.copy, "reading a vertex", wait)) {
    grab.neighbours = glm::dvec3(0);
    for (const Position& p : *copy) {
      grab.seen = glm::dvec3(p.high) + glm::dvec3(p.low);
      grab.neighbours += grab.seen;
    }
    // The vertex is the last.
    grab.neighbours = (grab.neighbours - grab.seen) / double(copy->size() - 1);
  }
  if (grab.copied) return;
  for (std::size_t i = 0; i < grab.watched.size(); ++i)
    positions.copy_to(grab.copy, i * sizeof(Position), grab.watched[i] * sizeof(Position), sizeof(Position));
  grab.copied = Fence::here();
}

// How much farther than when it was caught.
double apart(const Grab& grab) { return glm::distance(grab.seen - grab.neighbours, grab.resting); }

// Tets, and triangles (which those of a sheet need) with a corner twice.
void for_each_element(const TetMesh& mesh, const auto& visit) {
  std::ranges::for_each(mesh.tets, visit);
  if (mesh.thickness > 0)
    for (const auto& [a, b, c] : mesh.surface) visit(Tet{a, b, c, c});
}

// Those within the radius (m) at rest and joined to the vertex there, for another limb may be as near; the
// nearest first.
std::vector<std::uint32_t> around(const TetMesh& rest, std::uint32_t vertex, double radius) {
  const auto far = [&](std::uint32_t v) { return glm::distance(rest.positions[v], rest.positions[vertex]); };
  const auto within = [&](std::uint32_t v) { return far(v) < radius; };
  std::set<std::uint32_t> found{vertex};
  std::vector<Tet> near;
  for_each_element(rest, [&](const Tet& tet) {
    if (std::ranges::any_of(tet, within)) near.push_back(tet);
  });
  for (std::size_t before = 0; before < found.size();) {
    before = found.size();
    for (const Tet& tet : near)
      if (std::ranges::any_of(tet, [&](std::uint32_t v) { return found.contains(v); }))
        std::ranges::copy_if(tet, std::inserter(found, found.end()), within);
  }
  std::vector<std::uint32_t> order(found.begin(), found.end());
  std::ranges::stable_sort(order, {}, far);
  std::iter_swap(order.begin(), std::ranges::find(order, vertex));  // others may coincide with it
  order.resize(std::min(order.size(), most_held));
  return order;
}

}  // namespace

bool Hold::has(std::uint32_t vertex) const { return std::ranges::find(vertices, vertex) != vertices.end(); }

Hold take_hold(const Sim& sim, std::uint32_t vertex, double radius) {
  Hold hold;
  hold.was_pinned = is_pinned(sim, vertex);
  const TetMesh& rest = sim.model->rest;
  const double metres = hold.was_pinned ? 0 : radius * sim.model->size;
  hold.slack = slack_of_radius * metres;
  const State state = read_state(sim);
  for (const std::uint32_t v : around(rest, vertex, metres)) {
    if (v != vertex && is_pinned(sim, v)) continue;  // somebody wants it where it is
    const double far = glm::distance(rest.positions[v], rest.positions[vertex]);
    const double near = v == vertex ? 1 : 1 - far * far / (metres * metres);
    hold.vertices.push_back(v);
    hold.starts.push_back(state.positions[v]);
    hold.behind.push_back(1 - near * near);
  }
  return hold;
}

void pin_held(Sim& sim, const Hold& hold) { pin(sim, hold.vertices); }

void unpin_held(Sim& sim, const Hold& hold) {
  if (!hold.was_pinned) unpin(sim, hold.vertices);
}

void move_held(Sim& sim, const Hold& hold, const glm::dvec3& to) {
  std::vector<glm::dvec3> places{to};
  const glm::dvec3 moved = to - hold.starts.front();
  const double distance = glm::length(moved), slack = std::min(hold.slack, distance);
  for (std::size_t i = 1; i < hold.vertices.size(); ++i) {
    glm::dvec3 place = hold.starts[i];
    if (distance > 0) place += moved * (1 - hold.behind[i] * slack / distance);
    places.push_back(out_of_obstacles(*sim.model, sim.settings, simulated_time(sim), place));
  }
  move_pinned(sim, hold.vertices, places);
}

Grab begin_grab(const Sim& sim, const Hold& hold, const Pick& pick) {
  Grab grab;
  grab.slack = hold.slack;
  grab.hit = glm::dvec3(pick.ray.origin) + double(pick.distance) * glm::dvec3(pick.ray.direction);
  const TetMesh& rest = sim.model->rest;
  const std::set<std::uint32_t> held(hold.vertices.begin(), hold.vertices.end());
  int edges = 0;
  for_each_element(rest, [&](const Tet& tet) {
    if (std::ranges::none_of(tet, [&](std::uint32_t v) { return held.contains(v); })) return;
    const bool own = std::ranges::count(tet, hold.caught()) > 0;
    for (const std::uint32_t v : tet) {
      if (own && v != hold.caught())
        grab.edge += glm::distance(rest.positions[v], rest.positions[hold.caught()]), ++edges;
      if (!held.contains(v) && grab.watched.size() < most_neighbours && !std::ranges::count(grab.watched, v))
        grab.watched.push_back(v);
    }
  });
  grab.edge /= std::max(edges, 1);
  if (grab.watched.empty()) grab.watched.push_back(hold.vertices.back());  // all of the body is held
  grab.watched.push_back(hold.caught());
  grab.copy = Buffer("watched positions", grab.watched.size() * sizeof(Position), nullptr, GL_STREAM_READ);
  watch(grab, sim.positions);
  watch(grab, sim.positions, true);
  grab.start = grab.position = grab.seen;
  grab.resting = grab.seen - grab.neighbours;
  return grab;
}

void aim(Grab& grab, const Lane& lane, const Camera& camera, const Ray& cursor) {
  watch(grab, lane.positions());
  const glm::dvec3 forward(camera.target - eye(camera)), origin(cursor.origin), along(cursor.direction);
  // At the depth of the hit, and as far beside the cursor as the vertex was: catching it moves nothing.
  const double reach = glm::dot(grab.hit - origin, forward) / glm::dot(along, forward);
  grab.target = origin + along * reach + grab.start - grab.hit;
  // A pinned vertex has no contact with obstacles, so it is kept out of them here.
  grab.target = out_of_obstacles(*lane.sim.model, lane.sim.settings, lane.time(), grab.target);
}

void lead(Grab& grab) {
  const double limit = edges_at_most * grab.edge + grab.slack;
  // Part of the full speed that the body can follow now, below 0 backwards.
  const double pace = std::clamp((limit - apart(grab)) / limit, -1.0, 1.0);
  const glm::dvec3 way = (pace < 0 ? grab.neighbours + grab.resting : grab.target) - grab.position;
  const double distance = glm::length(way), most = edges_a_step * grab.edge * std::abs(pace);
  grab.position += distance > most ? way * (most / distance) : way;
  const glm::dvec3 ahead = grab.position - grab.seen;
  const double too_far = glm::length(ahead) / (edges_ahead * grab.edge);
  if (too_far > 1) grab.position = grab.seen + ahead / too_far;
}

}  // namespace tetpbd
