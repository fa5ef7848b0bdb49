// Suggestions for words that are not known.
#pragma once

#include <string>
#include <vector>

namespace tetpbd {

/// "did you mean 'colour'? ", or an empty text where no known word is near. Near are words that begin with this one or
/// differ from it in at most a third of its letters (left out, put in, exchanged, two of them swapped).
std::string did_you_mean(const std::string& word, const std::vector<std::string>& known);

}  // namespace tetpbd
