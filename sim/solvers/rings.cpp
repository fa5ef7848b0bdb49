#include "sim/solvers/rings.h"

#include <bit>

namespace tetpbd {

namespace {

glm::uvec4 word(const glm::dvec3& v, std::uint32_t last) {
  const auto bits = [](double value) { return std::bit_cast<std::uint32_t>(float(value)); };
  return {bits(v.x), bits(v.y), bits(v.z), last};
}

}  // namespace

std::vector<glm::uvec4> ring_words(const Averages& a) {
  const std::size_t vertices = a.vertices.size();
  const auto neighbours_at = std::uint32_t(2 * vertices),
             parts_at = std::uint32_t(neighbours_at + 2 * a.neighbours.size());
  std::vector<glm::uvec4> words;
  words.reserve(parts_at + a.parts.size());
  for (std::size_t v = 0; v < vertices; ++v) {
    const Averages::Vertex& at = a.vertices[v];
    words.push_back(word({at.volume > 0 ? 1 / at.volume : 0, at.shear, at.bulk}, 0));
    words.push_back({neighbours_at + 2 * a.first_neighbour[v], neighbours_at + 2 * a.first_neighbour[v + 1],
                     parts_at + a.first_part[v], parts_at + a.first_part[v + 1]});
  }
  for (const Averages::Neighbour& n : a.neighbours) {
    words.push_back(word(n.own, n.vertex));
    words.push_back(word(n.other, 0));
  }
  for (const Averages::Part& part : a.parts)
    words.push_back({part.others[0], part.others[1], part.others[2], std::bit_cast<std::uint32_t>(float(part.weight))});
  return words;
}

Pass make_smoothing_pass(Solver& solver, const SolverInput& input) {
  constexpr unsigned group = 128, lanes = 16;
  const std::size_t vertices = input.model.positions.size();
  Buffer rings("rings", ring_words(input.system.averages));
  const std::size_t bytes = rings.bytes() + 4 * 48 * vertices;
  add_buffer(solver, input.tuning, "Rings", std::move(rings));
  add_buffer(solver, input.tuning, "Averages", Buffer("averages", std::vector<glm::vec4>(3 * vertices)));
  std::vector<std::string> defines = quanta_defines(input);
  defines.insert(defines.end(), {define("GROUP_SIZE", group), define("AVERAGE_LANES", lanes)});
  return {Program::compute("solvers/smooth.comp", {}, defines), work_groups(vertices, group / lanes), bytes};
}

}  // namespace tetpbd
