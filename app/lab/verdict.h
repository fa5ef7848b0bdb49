// What a run is worth: the line that it ends in (docs/guide.md, "The verdict").
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sim/measure/metrics.h"

namespace tetpbd {

struct Verdict {
  enum Level { right, doubtful, wrong };
  struct Finding {
    Level level;
    std::string what, remedy;
  };
  std::vector<Finding> findings;  ///< the worst first
  Level level() const { return findings.empty() ? right : findings.front().level; }
};

/// What the ledger says against the solver, if anything.
std::optional<Verdict::Finding> judge_energy(const EnergyLedger& ledger, const Sim& sim);

/// Judges a run whose states were finite. Wrong: a hundred times the energy there was, or bodies that are nowhere near
/// where anything could have taken them. Doubtful: what a look at the pictures may not show.
Verdict judge(const RunErrors& errors, Sim& sim);

/// "verdict: right", or the findings and remedies in one line.
std::string verdict_line(const Verdict& verdict);
nlohmann::ordered_json verdict_json(const Verdict& verdict);

}  // namespace tetpbd
