#include "app/grab.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tetpbd {

namespace {

constexpr std::size_t most_neighbours = 32;

// The vertex may go this part of an edge in one step. A tet turns inside out when a vertex passes its
// opposite face, about 0.8 of an edge away; a quarter leaves the solver several steps to answer, also while
// the read-back that sets the pace is a few steps old. In metres a second it is edge / (4 dt): 1.5 m/s for a
// 1 m bunny.
constexpr double edges_a_step = 0.25;

// So many edges from the mean of its neighbours the vertex stops, and beyond turns back: what does not follow
// is held somewhere (a clamped end, another pin), and pulling on would only draw out a spike of flat tets.
constexpr double edges_at_most = 2.5;

std::vector<std::uint32_t> with_neighbours(const TetMesh& mesh, std::uint32_t vertex) {
  std::vector<std::uint32_t> found{vertex};
  for (const Tet& tet : mesh.tets) {
    if (std::find(tet.begin(), tet.end(), vertex) == tet.end()) continue;
    for (const std::uint32_t v : tet)
      if (found.size() <= most_neighbours && std::find(found.begin(), found.end(), v) == found.end())
        found.push_back(v);
  }
  return found;
}

glm::dvec3 mean_of_neighbours(const std::vector<glm::dvec3>& positions) {
  glm::dvec3 sum{0};
  for (std::size_t i = 1; i < positions.size(); ++i) sum += positions[i];
  return positions.size() > 1 ? sum / double(positions.size() - 1) : positions[0];
}

// Starts a copy unless one is under way.
void request(Grab& grab, const Sim& sim) {
  if (grab.copied.sync()) return;
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_COPY_READ_BUFFER, sim.current_positions().id());
  glBindBuffer(GL_COPY_WRITE_BUFFER, grab.copy.id());
  for (std::size_t i = 0; i < grab.watched.size(); ++i)
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER,
                        GLintptr(grab.watched[i] * sizeof(Position)), GLintptr(i * sizeof(Position)),
                        sizeof(Position));
  grab.copied = Fence::here();
  glFlush();
}

}  // namespace

Grab begin_grab(Sim& sim, const Pick& pick) {
  Grab grab;
  grab.vertex = pick.vertex;
  grab.was_pinned = is_pinned(sim, pick.vertex);
  grab.hit = glm::dvec3(pick.ray.origin) + double(pick.distance) * glm::dvec3(pick.ray.direction);
  grab.watched = with_neighbours(sim.model->rest, pick.vertex);
  grab.copy = Buffer("watched positions", grab.watched.size() * sizeof(Position), nullptr, GL_STREAM_READ);
  const auto& rest = sim.model->rest.positions;
  std::vector<glm::dvec3> around;
  double length = 0;
  for (const std::uint32_t v : grab.watched) {
    around.push_back(rest[v]);
    length += glm::length(rest[v] - rest[pick.vertex]);
  }
  if (around.size() > 1) grab.edge = length / double(around.size() - 1);
  grab.resting = glm::length(rest[pick.vertex] - mean_of_neighbours(around));
  pin(sim, pick.vertex);
  request(grab, sim);  // after pinning: from here on the vertex is where the copy says
  return grab;
}

void aim(Grab& grab, const Sim& sim, const Camera& camera, const Ray& cursor,
         std::span<const glm::dvec4> planes) {
  if (const auto copy = take<Position>(grab.copied, grab.copy, "reading a vertex")) {
    std::vector<glm::dvec3> now;
    for (const Position& p : *copy) now.push_back(glm::dvec3(p.high) + glm::dvec3(p.low));
    if (!grab.placed) {
      grab.start = grab.position = now.front();
      grab.offset = grab.start - grab.hit;
      grab.placed = true;
    }
    grab.neighbours = mean_of_neighbours(now);
    const double apart = glm::length(now.front() - grab.neighbours), limit = edges_at_most * grab.edge;
    grab.pace = std::clamp((limit - apart) / std::max(limit - grab.resting, 0.1 * limit), -1.0, 1.0);
  }
  request(grab, sim);
  const glm::dvec3 forward(glm::normalize(camera.target - eye(camera))), origin(cursor.origin),
      along(cursor.direction);
  const double towards = glm::dot(along, forward);
  if (towards > 1e-3)
    grab.target = origin + along * (glm::dot(grab.hit - origin, forward) / towards) + grab.offset;
  // A pinned vertex has infinite mass and no contact, so it is kept out of the ground and walls here.
  for (const glm::dvec4& plane : planes) {
    const glm::dvec3 normal(plane);
    grab.target += normal * std::max(0.0, plane.w - glm::dot(normal, grab.target));
  }
}

void lead(Grab& grab, Sim& sim) {
  if (!grab.placed) return;
  const glm::dvec3 goal = grab.pace < 0 ? grab.neighbours : grab.target, way = goal - grab.position;
  const double distance = glm::length(way), most = edges_a_step * grab.edge * std::abs(grab.pace);
  grab.position += distance > most ? way * (most / distance) : way;
  move_pinned(sim, grab.vertex, grab.position);
}

void end_grab(Grab& grab, Sim& sim) {
  if (!grab.was_pinned) unpin(sim, grab.vertex);
}

}  // namespace tetpbd
