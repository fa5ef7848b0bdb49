#include "sim/solvers/clusters.h"

#include <algorithm>
#include <cmath>

#include "sim/mesh/tet_mesh.h"
#include "sim/rotation.h"

namespace tetpbd {

namespace {

constexpr double spacing = 0.6;  // of a body's diagonal: eight clusters for a compact body

glm::dvec3 cell_of(const glm::dvec3& size) {
  const double diagonal = glm::length(size);
  glm::dvec3 cell;
  for (int a = 0; a < 3; ++a) {
    const double cells = std::max(1.0, std::round(size[a] / (spacing * diagonal)));
    cell[a] = size[a] > 0 ? size[a] / cells : std::max(diagonal, 1e-30);
  }
  return cell;
}

// Calls visit(vertex, weight, arm in m) for every vertex of a cluster.
template <class F>
void for_each_vertex(const Clusters& clusters, const layout::Cluster& cluster, const Body& body, F&& visit) {
  glsl::ShapeMatching matching;
  for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v)
    if (const int weight = matching.cluster_weight(clusters.rest[v], cluster.node))
      visit(v, weight, matching.cluster_arm(clusters.rest[v], cluster.centre, cluster.cell));
}
// Of all bodies: those of others have no weight.
template <class F>
void for_each_vertex(const Clusters& clusters, const layout::Cluster& cluster, F&& visit) {
  Body all;
  all.vertices = clusters.rest.size();
  for_each_vertex(clusters, cluster, all, visit);
}

}  // namespace

Clusters build_clusters(const Model& model) {
  glsl::ShapeMatching matching;
  Clusters result;
  result.rest.resize(model.rest.positions.size());
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    if (body.vertices == 0) continue;
    const auto from = model.rest.positions.begin() + std::ptrdiff_t(body.first_vertex);
    const Bounds box = bounds({from, from + std::ptrdiff_t(body.vertices)});
    const glm::dvec3 cell = cell_of(box.high - box.low);
    const glm::ivec3 nodes = glm::ivec3(glm::round((box.high - box.low) / cell)) + 1;
    // 64 bodies in a row lie apart, more than meet in a patch.
    const glm::vec3 origin(float(8 * (b % 64)), 0, 0);
    double heaviest = 0;
    std::vector<double> masses(std::size_t(nodes.x * nodes.y * nodes.z));
    for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v) {
      const glm::dvec3 at = (model.rest.positions[v] - box.low) / cell;
      result.rest[v] = glm::vec4(origin + glm::vec3(at), 0);
      heaviest = std::max(heaviest, model.masses[v]);
      const glm::ivec3 low = glm::clamp(glm::ivec3(at), glm::ivec3(0), nodes - 2);
      for (int corner = 0; corner < 8; ++corner) {
        const glm::ivec3 node = low + glm::ivec3(corner & 1, corner >> 1 & 1, corner >> 2);
        const glm::dvec3 share = glm::max(1.0 - glm::abs(at - glm::dvec3(node)), 0.0);
        masses[std::size_t((node.z * nodes.y + node.y) * nodes.x + node.x)] +=
            share.x * share.y * share.z * model.masses[v];
      }
    }
    // Weight times steps times deviation fit 64 bits (clusters.glsl), the first two 31.
    const double unit = std::min(std::exp2(16.0) / heaviest,
                                 0.99 * std::exp2(22.0) / *std::max_element(masses.begin(), masses.end()));
    for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v)
      result.rest[v].w = float(model.masses[v] * unit);
    for (int k = 0; k < nodes.z; ++k)
      for (int j = 0; j < nodes.y; ++j)
        for (int i = 0; i < nodes.x; ++i) {
          layout::Cluster cluster{};
          cluster.node = origin + glm::vec3(i, j, k);
          cluster.cell = glm::vec3(cell);
          cluster.steps_per_metre =
              float(16320 / (2 * glm::length(cell)));  // no arm is longer than two cells
          double weight = 0;
          glm::dvec3 centre(0);
          for_each_vertex(result, cluster, body, [&](std::size_t v, int w, const glm::vec3&) {
            weight += w, centre += double(w) * glm::dvec3(result.rest[v]);
          });
          if (weight == 0) continue;
          cluster.weight = float(weight);
          cluster.centre = glm::vec3(centre / weight);
          glm::dvec3 sum(0);
          glm::dmat3 squares(0);
          for_each_vertex(result, cluster, body, [&](std::size_t, int w, const glm::vec3& arm) {
            const glm::dvec3 steps(matching.cluster_steps(arm, cluster.steps_per_metre));
            sum += double(w) * steps, squares += double(w) * glm::outerProduct(steps, steps);
          });
          squares -= glm::outerProduct(sum, sum) / weight;
          cluster.steps = glm::vec3(sum);
          cluster.squares = glm::vec3(squares[0][0], squares[1][1], squares[2][2]);
          cluster.products = glm::vec3(squares[1][2], squares[0][2], squares[0][1]);
          const double trace = squares[0][0] + squares[1][1] + squares[2][2];
          // Points on a line have no inverse: then a small one, and about the line nothing turns.
          const glm::dmat3 inverse =
              trace > 0 ? glm::inverse(glm::dmat3(trace * (1 + 1e-6)) - squares) : glm::dmat3(0);
          cluster.inverse_squares = glm::vec3(inverse[0][0], inverse[1][1], inverse[2][2]);
          cluster.inverse_products = glm::vec3(inverse[1][2], inverse[0][2], inverse[0][1]);
          result.clusters.push_back(cluster);
        }
  }
  return result;
}

std::vector<ClusterPose> cluster_poses(const Clusters& clusters, const std::vector<glm::dvec3>& positions) {
  std::vector<ClusterPose> poses;
  for (const layout::Cluster& cluster : clusters.clusters) {
    glm::dvec3 x(0), arms(0);
    for_each_vertex(clusters, cluster, [&](std::size_t v, int weight, const glm::vec3& arm_m) {
      const glm::dvec3 arm(arm_m);
      x += double(weight) * positions[v], arms += double(weight) * arm;
    });
    x /= double(cluster.weight), arms /= double(cluster.weight);
    glm::dmat3 A(0);
    for_each_vertex(clusters, cluster, [&](std::size_t v, int weight, const glm::vec3& arm_m) {
      const glm::dvec3 arm(arm_m);
      A += double(weight) * glm::outerProduct(positions[v] - x, arm - arms);
    });
    ClusterPose pose;
    pose.R = best_rotation(A).R;
    pose.place = x - pose.R * arms;
    poses.push_back(pose);
  }
  return poses;
}

std::vector<glm::dvec3> cluster_pulls(const Clusters& clusters, const std::vector<glm::dvec3>& positions) {
  std::vector<glm::dvec3> pulls(positions.size());
  const std::vector<ClusterPose> poses = cluster_poses(clusters, positions);
  for (std::size_t h = 0; h < poses.size(); ++h)
    for_each_vertex(clusters, clusters.clusters[h], [&](std::size_t v, int weight, const glm::vec3& arm_m) {
      const glm::dvec3 arm(arm_m);
      pulls[v] +=
          double(weight) / double(clusters.rest[v].w) * (poses[h].place + poses[h].R * arm - positions[v]);
    });
  return pulls;
}

double relaxation(double omega, double clusters) {
  return clusters > 0 ? std::min(omega, 3 * (1.2 - clusters)) : omega;
}

}  // namespace tetpbd
