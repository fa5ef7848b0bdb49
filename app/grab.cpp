#include "app/grab.h"

#include <algorithm>
#include <cmath>

namespace tetpbd {

namespace {

constexpr std::size_t most_neighbours = 32;

// The vertex may go this part of an edge in one step. A tet turns inside out when a vertex passes its
// opposite face, about 0.8 of an edge away; a quarter leaves the solver several steps to answer, also while
// the read-back that sets the pace is a few steps old.
constexpr double edges_a_step = 0.25;

// So many edges from the mean of its neighbours the vertex stops, and beyond turns back: what does not follow
// is held somewhere (a clamped end, another pin), and pulling on would only draw out a spike of flat tets.
constexpr double edges_at_most = 2.5;

// Takes in the watched positions that have come back, and asks for the next.
void watch(Grab& grab, const Sim& sim, bool wait = false) {
  if (const auto copy = take<Position>(grab.copied, grab.copy, "reading a vertex", wait)) {
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
    sim.positions.copy_to(grab.copy, i * sizeof(Position), grab.watched[i] * sizeof(Position),
                          sizeof(Position));
  grab.copied = Fence::here();
}

double apart(const Grab& grab) { return glm::distance(grab.seen, grab.neighbours); }

}  // namespace

Grab begin_grab(Sim& sim, const Pick& pick) {
  Grab grab;
  grab.vertex = pick.vertex;
  grab.was_pinned = is_pinned(sim, pick.vertex);
  grab.hit = glm::dvec3(pick.ray.origin) + double(pick.distance) * glm::dvec3(pick.ray.direction);
  const TetMesh& rest = sim.model->rest;
  for (const Tet& tet : rest.tets) {
    if (std::ranges::count(tet, pick.vertex) == 0) continue;
    for (const std::uint32_t v : tet)
      if (v != pick.vertex && grab.watched.size() < most_neighbours && !std::ranges::count(grab.watched, v))
        grab.watched.push_back(v);
  }
  for (const std::uint32_t v : grab.watched)
    grab.edge += glm::distance(rest.positions[v], rest.positions[pick.vertex]) / double(grab.watched.size());
  grab.watched.push_back(pick.vertex);
  grab.copy = Buffer("watched positions", grab.watched.size() * sizeof(Position), nullptr, GL_STREAM_READ);
  watch(grab, sim);
  watch(grab, sim, true);
  grab.start = grab.position = grab.seen;
  grab.resting = apart(grab);
  pin(sim, pick.vertex);
  return grab;
}

void aim(Grab& grab, const Sim& sim, const Camera& camera, const Ray& cursor,
         std::span<const glm::dvec4> planes) {
  watch(grab, sim);
  const glm::dvec3 forward(camera.target - eye(camera)), origin(cursor.origin), along(cursor.direction);
  // At the depth of the hit, and as far beside the cursor as the vertex was: catching it moves nothing.
  const double reach = glm::dot(grab.hit - origin, forward) / glm::dot(along, forward);
  grab.target = origin + along * reach + grab.start - grab.hit;
  // A pinned vertex has infinite mass and no contact, so it is kept out of the ground and walls here.
  for (const glm::dvec4& plane : planes) {
    const glm::dvec3 normal(plane);
    grab.target += normal * std::max(0.0, plane.w - glm::dot(normal, grab.target));
  }
}

void lead(Grab& grab, Sim& sim) {
  const double limit = edges_at_most * grab.edge;
  // Part of the full speed that the body can follow now, below 0 backwards.
  const double pace =
      std::clamp((limit - apart(grab)) / std::max(limit - grab.resting, 0.1 * limit), -1.0, 1.0);
  const glm::dvec3 way = (pace < 0 ? grab.neighbours : grab.target) - grab.position;
  const double distance = glm::length(way), most = edges_a_step * grab.edge * std::abs(pace);
  grab.position += distance > most ? way * (most / distance) : way;
  move_pinned(sim, grab.vertex, grab.position);
}

}  // namespace tetpbd
