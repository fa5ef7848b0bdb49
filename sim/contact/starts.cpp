#include "sim/contact/starts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "sim/contact/cell_grid.h"
#include "sim/contact/convex.h"
#include "sim/contact/moving_obstacle.h"
#include "sim/contact/pairs.h"
#include "sim/contact/surfaces.h"
#include "sim/error.h"

namespace tetpbd {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double touching = 1e-6;  // of a body's size: what is less deep than this is contact and no overlap

struct Cell : ConvexCell {
  Bounds box;
  bool bolted = false;  // has a fixed vertex
};

// A body as it stands, by its cells: tets, or the triangles of a sheet.
struct Shape {
  std::string name;
  std::vector<Cell> cells;
  Bounds box;
  double size = 0, mass = 0, offset = 0;  // offset: m, that its surface keeps from others, in the mean
  bool held = false;                      // has a fixed vertex
  CellGrid grid{1};                       // of cells, by number
};

struct Place {
  std::string name;
  MovingObstacle obstacle;
};

struct World {
  std::vector<Place> places;
  std::vector<Shape> shapes;
};

Bounds moved(const Bounds& box, const glm::dvec3& by) { return {box.low + by, box.high + by}; }
Cell moved(Cell cell, const glm::dvec3& by) {
  for (glm::dvec3& corner : cell.corners) corner += by;
  cell.box = moved(cell.box, by);
  return cell;
}

void fill_grid(Shape& shape) {
  double longest = 0;
  for (const Cell& cell : shape.cells) longest = std::max(longest, cell.box.size());
  shape.grid = CellGrid(longest > 0 ? longest : 1);
  for (std::size_t c = 0; c < shape.cells.size(); ++c) shape.grid.add(shape.cells[c].box, std::uint32_t(c));
}

Shape make_shape(const Model& model, const Body& body) {
  Shape shape;
  shape.name = body.name;
  const auto& x = model.positions;
  const auto add = [&](const auto& element) {
    Cell& cell = shape.cells.emplace_back();
    cell.corners.fill(x[element[0]]);
    cell.box = {x[element[0]], x[element[0]]};
    for (const std::uint32_t v : element) {
      cell.corners[std::size_t(cell.count++)] = x[v];
      cell.box = {glm::min(cell.box.low, x[v]), glm::max(cell.box.high, x[v])};
      cell.bolted = cell.bolted || !(model.inverse_masses[v] > 0);
    }
    shape.held = shape.held || cell.bolted;
  };
  for (std::size_t t = 0; t < body.tets; ++t) add(model.rest.tets[body.first_tet + t]);
  for (std::size_t t = 0; t < body.triangles && body.is_sheet(); ++t) add(model.rest.surface[body.first_triangle + t]);
  for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v) shape.mass += model.masses[v];
  shape.box = body_bounds(body, x);
  shape.size = shape.box.size();
  return shape;
}

std::vector<Place> make_places(const Model& model, const Settings& settings) {
  std::vector<Place> places;
  const auto add = [&](const std::string& name, const Obstacle& o) {
    places.push_back({name, moving_obstacle(o, 0, 0)});
  };
  Obstacle ground;
  ground.centre = {0, settings.ground_height, 0}, ground.normal = {0, 1, 0};
  if (settings.ground) add("the ground", ground);
  for (std::size_t i = 0; i < model.obstacles.size(); ++i)
    add(fmt::format("obstacle {} ({})", i, model.obstacles[i].kind->name), model.obstacles[i]);
  return places;
}

// How deep a point of the cell lies in the obstacle, m, found by halving the cell until no part of it can be deeper
// than `enough`: a distance changes by no more than one moves.
double find_depth(const MovingObstacle& obstacle, const ConvexCell& cell, double enough, int halvings) {
  glm::dvec3 centre{0};
  for (int c = 0; c < cell.count; ++c) centre += cell.corners[std::size_t(c)] / double(cell.count);
  double radius = 0, longest = 0;
  std::pair<std::size_t, std::size_t> edge;
  for (std::size_t i = 0; i < std::size_t(cell.count); ++i) {
    radius = std::max(radius, glm::distance(cell.corners[i], centre));
    for (std::size_t j = 0; j < i; ++j)
      if (const double length = glm::distance(cell.corners[i], cell.corners[j]); length > longest)
        longest = length, edge = {i, j};
  }
  const double depth = -obstacle.surface_at(centre).distance;
  if (depth > enough || depth + radius <= enough || halvings == 0 || longest == 0) return depth;
  ConvexCell near = cell, far = cell;
  near.corners[edge.second] = far.corners[edge.first] = 0.5 * (cell.corners[edge.first] + cell.corners[edge.second]);
  if (cell.count == 3) near.corners[3] = near.corners[0], far.corners[3] = far.corners[0];
  return std::max(find_depth(obstacle, near, enough, halvings - 1), find_depth(obstacle, far, enough, halvings - 1));
}

struct Depth {
  double depth = 0;      // m
  glm::dvec3 normal{0};  // out of the obstacle, where it is deepest
};

// No point of the shape is deeper, where corners and centres of cells say how deep; at least as deep as touching,
// where a cell spans the whole obstacle. Cells with fixed vertices are bolted to what they are in.
Depth depth_in(const MovingObstacle& obstacle, const Shape& shape, const glm::dvec3& by) {
  Depth deepest;
  const Bounds box = moved(shape.box, by);
  if (!obstacle.kind->flat && obstacle.surface_at(box.centre()).distance > 0.5 * box.size()) return deepest;
  const double enough = touching * shape.size;
  for (const Cell& cell : shape.cells) {
    if (cell.bolted) continue;
    for (int c = 0; c < cell.count; ++c) {
      const auto surface = obstacle.surface_at(cell.corners[std::size_t(c)] + by);
      if (-surface.distance > deepest.depth) deepest = {-surface.distance, surface.normal};
    }
  }
  if (deepest.depth > enough || obstacle.kind->flat) return deepest;
  for (const Cell& cell : shape.cells) {
    if (cell.bolted) continue;
    deepest.depth = std::max(deepest.depth, find_depth(obstacle, moved(cell, by), enough, 12));
    if (deepest.depth > enough) break;
  }
  return deepest;
}

// Calls f with each pair of cells of the two that overlap by more than touching, or are nearer than a gap, but for
// those whose boxes say enough.
template <class Skip, class F>
void for_each_overlap(const Shape& a, const glm::dvec3& by, const Shape& b, Skip&& skip, F&& f, double gap = 0) {
  if (are_apart(grown(moved(a.box, by), gap), b.box)) return;
  const double enough = touching * std::min(a.size, b.size);
  std::vector<std::uint32_t> near;
  for (const Cell& own : a.cells) {
    Cell cell = moved(own, by);
    cell.box = grown(cell.box, gap);
    if (are_apart(cell.box, b.box)) continue;
    near.clear();
    b.grid.for_each(cell.box, [&](std::uint32_t c) { near.push_back(c); });
    std::ranges::sort(near);
    const auto same = std::ranges::unique(near);
    near.erase(same.begin(), same.end());
    for (const std::uint32_t c : near)
      if (!are_apart(cell.box, b.cells[c].box) && !skip(cell.box, b.cells[c].box) &&
          overlap_depth(cell, b.cells[c], gap) > enough)
        if (!f(cell, b.cells[c])) return;
  }
}

constexpr auto never = [](const Bounds&, const Bounds&) { return false; };

bool overlap(const Shape& a, const Shape& b, double gap = 0) {
  bool any = false;
  for_each_overlap(
      a, glm::dvec3(0), b, never,
      [&](const Cell&, const Cell&) {
        any = true;
        return false;
      },
      gap);
  return any;
}

// m, until nothing further is needed; infinite beyond `limit`. `least_further`: no shorter way from there does.
template <class F>
double find_travel(int most_tries, double limit, F&& least_further) {
  double travel = 0;
  for (int tries = 0; tries < most_tries && travel < limit; ++tries) {
    const double further = least_further(travel);
    if (further == 0) return travel;
    travel += further;
  }
  return infinite;
}

// m, along a direction until there is a gap between the two; infinite beyond `limit`.
double find_travel(const Shape& a, const Shape& b, const glm::dvec3& direction, double gap, double limit) {
  return find_travel(40, limit, [&](double travel) {
    double further = 0;
    const auto exit = [&](const Cell& own, const Cell& other) {
      further = std::max(further, exit_distance(own, other, direction, further, gap));
      return true;
    };
    for_each_overlap(a, travel * direction, b, never, exit, gap);
    return further;
  });
}

// What one body has to be free of.
struct Wanted {
  const World& world;
  std::size_t body;
  bool bodies;  // also of other bodies
};

// m, along a direction from `by` on: no shorter motion frees the body, and this may not do yet. 0: it is free.
double least_further(const Wanted& wanted, const glm::dvec3& by, const glm::dvec3& direction) {
  const Shape& shape = wanted.world.shapes[wanted.body];
  double further = 0;
  for (const Place& place : wanted.world.places) {
    const Depth in = depth_in(place.obstacle, shape, by);
    if (in.depth <= touching * shape.size) continue;
    const double along = glm::dot(in.normal, direction);
    if (place.obstacle.kind->flat && along < 1e-6) return infinite;
    further = std::max(further, place.obstacle.kind->flat ? in.depth / along : in.depth);
  }
  // Cells part no later than their boxes.
  const auto parts_sooner = [&](const Bounds& own, const Bounds& other) {
    double least = infinite;
    for (int a = 0; a < 3; ++a)
      if (direction[a] > 0)
        least = std::min(least, (other.high[a] - own.low[a]) / direction[a]);
      else if (direction[a] < 0)
        least = std::min(least, (own.high[a] - other.low[a]) / -direction[a]);
    return least <= further;
  };
  for (std::size_t o = 0; o < wanted.world.shapes.size() && wanted.bodies; ++o)
    if (o != wanted.body)
      for_each_overlap(shape, by, wanted.world.shapes[o], parts_sooner, [&](const Cell& own, const Cell& other) {
        further = std::max(further, exit_distance(own, other, direction, further));
        return true;
      });
  return further;
}

// m, along a direction until the body is free; infinite beyond `limit`.
double find_travel(const Wanted& wanted, const glm::dvec3& direction, double limit) {
  return find_travel(400, limit, [&](double travel) { return least_further(wanted, travel * direction, direction); });
}

// Ways out: the axes and diagonals of space, normals of obstacles where the body is deepest, and away from the middle
// of each other body.
std::vector<glm::dvec3> ways_out(const Wanted& wanted) {
  std::vector<glm::dvec3> ways;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k)
        if (i || j || k) ways.push_back(glm::normalize(glm::dvec3(i, j, k)));
  const Shape& shape = wanted.world.shapes[wanted.body];
  const auto add = [&](const glm::dvec3& way) {
    if (glm::length(way) > 1e-9 * shape.size) ways.push_back(glm::normalize(way));
  };
  for (const Place& place : wanted.world.places) {
    const Depth in = depth_in(place.obstacle, shape, glm::dvec3(0));
    if (in.depth <= touching * shape.size) continue;
    add(in.normal * shape.size);
    if (place.obstacle.kind->flat) continue;
    add(shape.box.centre() - place.obstacle.pose.centre);
    for (int a = 0; a < 3; ++a)
      add(shape.size * place.obstacle.pose.axes[a]), add(-shape.size * place.obstacle.pose.axes[a]);
  }
  for (std::size_t o = 0; o < wanted.world.shapes.size() && wanted.bodies; ++o)
    if (o != wanted.body && !are_apart(shape.box, wanted.world.shapes[o].box))
      add(shape.box.centre() - wanted.world.shapes[o].box.centre());
  return ways;
}

// The shortest motion that frees a body, over the ways out and what turning the best of them a little gives.
std::optional<glm::dvec3> find_shortest_motion(const Wanted& wanted) {
  double least = infinite;
  glm::dvec3 best{0};
  const auto attempt = [&](const glm::dvec3& way) {
    const double travel = find_travel(wanted, way, least);
    if (!(travel < least)) return false;
    least = travel, best = way;
    return true;
  };
  for (const glm::dvec3& way : ways_out(wanted)) attempt(way);
  if (least == infinite) return std::nullopt;
  for (double turn = 0.3; turn > 0.005;) {  // rad
    const glm::dvec3 across =
        glm::normalize(glm::cross(best, std::abs(best.y) < 0.9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0)));
    const glm::dvec3 up = glm::cross(across, best), from = best;
    bool better = false;
    for (const glm::dvec3& side : {across, -across, up, -up})
      better = attempt(glm::normalize(from + std::tan(turn) * side)) || better;
    if (!better) turn *= 0.5;
  }
  return least * best;
}

class Separation {
 public:
  Separation(Model& model, const Settings& settings) : model_(model), settings_(settings) {
    world_.places = make_places(model, settings);
    for (const Body& body : model.bodies) world_.shapes.push_back(make_shape(model, body));
  }

  std::vector<StartMotion> run() {
    for (std::size_t b = 0; b < world_.shapes.size(); ++b) free_of_obstacles(b);
    if (!bodies_touch(model_, settings_)) return std::move(motions_);
    const Surfaces surfaces = lay_out_surfaces(model_, settings_.contact_distance);
    for (std::size_t b = 0; b < world_.shapes.size(); ++b) {
      fill_grid(world_.shapes[b]);
      world_.shapes[b].offset = mean_offset(model_.bodies[b], surfaces);
    }
    for (std::size_t b = 0; b < world_.shapes.size(); ++b)
      for (std::size_t o = 0; o < b; ++o)
        if (overlap(world_.shapes[b], world_.shapes[o])) part(b, o);
    keep_gaps();
    return std::move(motions_);
  }

 private:
  // Moves bodies that touch apart by their offset, upwards where one lies on the other: what is pressed together from
  // the start has no gap in which contact could act. Where the gap does not fit they stay.
  void keep_gaps() {
    constexpr double nearest = 0.1;  // of the offset, that contact can do with
    constexpr int rounds = 40;
    std::vector<glm::dvec3> motions(world_.shapes.size(), glm::dvec3(0));
    bool any = true;
    for (int round = 0; round < rounds && any; ++round) {
      any = false;
      for (std::size_t b = 0; b < world_.shapes.size(); ++b)
        for (std::size_t o = 0; o < b; ++o) {
          Shape &one = world_.shapes[b], &other = world_.shapes[o];
          const double gap = std::min(one.offset, other.offset);
          if (!overlap(one, other, nearest * gap) || (one.held && other.held)) continue;
          const glm::dvec3 way = shortest_gap(one, other, gap);
          if (way == glm::dvec3(0)) continue;
          const double upwards = way.y * (settings_.gravity < 0 ? -1 : 1);
          const bool level = std::abs(upwards) < 1e-6 * glm::length(way);
          const bool first = other.held || (!one.held && (level ? one.mass <= other.mass : upwards > 0));
          any = true;
          shift(first ? b : o, first ? way : -way);
          motions[first ? b : o] += first ? way : -way;
        }
    }
    for (std::size_t b = 0; b < motions.size(); ++b)
      if (motions[b] != glm::dvec3(0)) note(b, "", motions[b]);
  }

  // The shortest motion of `one` that leaves a gap, along an axis of space or away from the middle of the other.
  static glm::dvec3 shortest_gap(const Shape& one, const Shape& other, double gap) {
    std::vector<glm::dvec3> ways = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}};
    const glm::dvec3 apart = one.box.centre() - other.box.centre();
    if (glm::length(apart) > 0) ways.push_back(glm::normalize(apart));
    double least = one.size;
    glm::dvec3 best(0);
    for (const glm::dvec3& way : ways)
      if (const double travel = find_travel(one, other, way, gap, least); travel < least)
        least = travel, best = travel * way;
    return best;
  }

  void free_of_obstacles(std::size_t b) {
    const Shape& shape = world_.shapes[b];
    std::vector<std::string> names;
    for (const Place& place : world_.places)
      if (depth_in(place.obstacle, shape, glm::dvec3(0)).depth > touching * shape.size) names.push_back(place.name);
    if (names.empty()) return;
    const std::string from = fmt::format("{}", fmt::join(names, " and "));
    const auto motion = shape.held ? std::nullopt : find_shortest_motion({world_, b, false});
    if (!motion) refuse(shape, from);
    move(b, from, *motion);
  }

  // The one whose motion takes less, mass times its square; a body that is held stays.
  void part(std::size_t b, std::size_t o) {
    std::optional<glm::dvec3> best;
    std::size_t mover = b;
    for (const std::size_t each : {b, o}) {
      const Shape& shape = world_.shapes[each];
      const auto motion = shape.held ? std::nullopt : find_shortest_motion({world_, each, true});
      const auto effort = [&](const glm::dvec3& way, std::size_t body) {
        return world_.shapes[body].mass * glm::dot(way, way);
      };
      if (motion && (!best || effort(*motion, each) < effort(*best, mover))) best = motion, mover = each;
    }
    const std::string other = fmt::format("body '{}'", world_.shapes[mover == b ? o : b].name);
    if (!best) refuse(world_.shapes[b], other);
    move(mover, other, *best);
  }

  [[noreturn]] void refuse(const Shape& shape, const std::string& from) const {
    throw Error("a body starts inside something and cannot be moved out",
                fmt::format("body '{}' in {}", shape.name, from),
                shape.held ? "it has fixed vertices: place it elsewhere, or fix the vertices that are inside"
                           : "place it elsewhere");
  }

  void move(std::size_t b, const std::string& from, const glm::dvec3& motion) {
    shift(b, motion);
    note(b, from, motion);
  }

  void shift(std::size_t b, const glm::dvec3& motion) {
    const Body& body = model_.bodies[b];
    for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v) model_.positions[v] += motion;
    Shape& shape = world_.shapes[b];
    shape.box = moved(shape.box, motion);
    for (Cell& cell : shape.cells) cell = moved(cell, motion);
    fill_grid(shape);
  }

  void note(std::size_t b, const std::string& from, const glm::dvec3& motion) {
    motions_.push_back({model_.bodies[b].name, from, motion, world_.shapes[b].mass * settings_.gravity * motion.y});
  }

  Model& model_;
  const Settings& settings_;
  World world_;
  std::vector<StartMotion> motions_;
};

}  // namespace

std::vector<StartMotion> separate_starts(Model& model, const Settings& settings) {
  return Separation(model, settings).run();
}

std::string describe(const StartMotion& m) {
  if (m.from.empty())
    return fmt::format("body '{}' touched others at the start and was moved away by ({:.3g}, {:.3g}, {:.3g}) m", m.body,
                       m.motion.x, m.motion.y, m.motion.z);
  return fmt::format("body '{}' started {:.3g} m inside {} and was moved out by ({:.3g}, {:.3g}, {:.3g}) m", m.body,
                     glm::length(m.motion), m.from, m.motion.x, m.motion.y, m.motion.z);
}

}  // namespace tetpbd
