#include "sim/model/did_you_mean.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace tetpbd {

namespace {

// The number of letters left out, put in, exchanged for others, or swapped with the next (Damerau and Levenshtein).
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before, last, row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before = std::exchange(last, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row.back();
}

}  // namespace

std::string did_you_mean(const std::string& word, const std::vector<std::string>& known) {
  if (word.size() > 60) return {};
  const std::string name = word.substr(word.rfind('/') + 1);
  const auto letters = std::size_t(std::ranges::count_if(name, [](char c) { return c != '-'; }));
  std::size_t least = std::max<std::size_t>(1, letters / 3) + 1;
  std::string nearest;
  for (const std::string& one : known) {
    const bool begun = letters >= 3 && one.starts_with(word);
    const std::size_t apart = begun ? 1 : edit_distance(word, one);
    if (apart < least) least = apart, nearest = one;
  }
  return nearest.empty() ? "" : "did you mean '" + nearest + "'? ";
}

}  // namespace tetpbd
