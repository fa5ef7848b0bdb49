// What the window remembers from one run to the next, in a file of the cache folder.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tetpbd {

struct Preferences {
  bool dark = false;
  double panel = 320;                  ///< its width, in window coordinates of a display of scale 1
  double plots = 128;                  ///< their height, likewise
  double text = 1;                     ///< size of text and widgets, on top of the display's scale
  int width = 0, height = 0;           ///< of the window, in its coordinates; 0: nobody has changed it
  int samples = -1;                    ///< of MSAA; -1: nobody has chosen
  int shadow = -1;                     ///< 0 or 1, likewise
  int hints = 0;                       ///< how often the first hints were shown
  std::map<std::string, bool> open{};  ///< parts of the panel that somebody opened or folded
  std::vector<std::string> recent{};   ///< scenes and meshes, the newest first
  bool operator==(const Preferences&) const = default;
};

inline constexpr double least_panel = 240, most_panel = 900, least_plots = 80, most_plots = 900, least_text = 0.5,
                        most_text = 3;

/// Defaults where there is no file, or a damaged one.
Preferences read_preferences(const std::filesystem::path& file);
void write_preferences(const std::filesystem::path& file, const Preferences& preferences);
/// To the front of the recent files.
void remember(Preferences& preferences, const std::filesystem::path& file);

}  // namespace tetpbd
