// What somebody may have meant who wrote a word that is not known.
#pragma once

#include <string>
#include <vector>

namespace tetpbd {

/// "did you mean 'colour'? ", or nothing where no known word is near: of those that begin with it or differ
/// in a third of its letters at most (left out, put in, another one, two that changed places), the nearest.
std::string did_you_mean(const std::string& word, const std::vector<std::string>& known);

}  // namespace tetpbd
