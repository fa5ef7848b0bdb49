#include "sim/solver.h"

#include <bit>

#include "sim/layout.h"

namespace tetpbd {

const std::vector<SolverMode>& solver_modes() {
  static const std::vector<SolverMode> rows = {
      {"node", "Jacobi on the GPU, a thread a vertex gathers all its constraints in one dispatch",
       create_node_solver},
      {"constraint", "Jacobi on the GPU, a thread a constraint adds to its vertices with integer atomics",
       create_constraint_solver},
      {"cpu", "non-linear Gauss-Seidel on one CPU core, the paper's baseline", create_cpu_solver},
      {"cpu-double", "the same in double precision: what stability is held against", create_cpu_double_solver},
  };
  return rows;
}

std::vector<Substitutions> kind_words(const ConstraintSystem& system) {
  std::vector<Substitutions> rows;
  for (std::size_t k = 0; k < system.lists.size(); ++k) {
    if (!system.present[k]) continue;
    const std::size_t index = rows.size();
    rows.push_back({{"KIND", constraint_kinds()[k].name},
                    {"ARITY", std::to_string(constraint_kinds()[k].arity)},
                    {"INDEX", std::to_string(index)},
                    {"BINDING", std::to_string(BIND_RECORDS + index)},
                    {"KIND_ROW", std::to_string(k / 4)},
                    {"KIND_COLUMN", std::to_string(k % 4)}});
  }
  return rows;
}

std::vector<Buffer> record_buffers(const ConstraintSystem& system) {
  std::vector<Buffer> buffers;
  for (std::size_t k = 0; k < system.lists.size(); ++k) {
    if (!system.present[k]) continue;
    const ConstraintList& list = system.lists[k];
    const std::size_t arity = std::size_t(list.arity);
    std::vector<std::uint32_t> words;
    words.reserve(list.count() * (arity + 1));
    for (std::size_t c = 0; c < list.count(); ++c) {
      words.insert(words.end(), list.vertices.begin() + std::ptrdiff_t(c * arity),
                   list.vertices.begin() + std::ptrdiff_t((c + 1) * arity));
      words.push_back(std::bit_cast<std::uint32_t>(float(list.rest[c])));
    }
    buffers.emplace_back(std::string("records ") + constraint_kinds()[k].name, words);
  }
  return buffers;
}

}  // namespace tetpbd
