#include "app/window/preferences.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/files.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t most_recent = 8, most_names = 64;

}  // namespace

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Preferences, dark, panel, plots, text, width, height, samples, shadow,
                                                hints, open, recent)

Preferences read_preferences(const fs::path& file) {
  Preferences read;
  try {
    read = nlohmann::json::parse(std::ifstream(file, std::ios::binary)).get<Preferences>();
  } catch (const nlohmann::json::exception&) {
    return {};
  }
  read.panel = std::clamp(read.panel, least_panel, most_panel);
  read.plots = std::clamp(read.plots, least_plots, most_plots);
  read.text = std::clamp(read.text, least_text, most_text);
  if (read.width < 480 || read.height < 320 || read.width > 16384 || read.height > 16384) read.width = read.height = 0;
  if (!std::ranges::count(std::array{0, 2, 4, 8}, read.samples)) read.samples = -1;
  if (read.open.size() > most_names) read.open.clear();
  if (read.recent.size() > most_recent) read.recent.resize(most_recent);
  return read;
}

void write_preferences(const fs::path& file, const Preferences& preferences) {
  fs::create_directories(file.parent_path());
  write_file(file, json_text(nlohmann::json(preferences), 1) + "\n");
}

void remember(Preferences& preferences, const fs::path& file) {
  std::error_code error;
  const fs::path whole = fs::absolute(file, error);
  const std::string name = (error ? file : whole).lexically_normal().string();
  auto& recent = preferences.recent;
  std::erase(recent, name);
  recent.insert(recent.begin(), name);
  if (recent.size() > most_recent) recent.resize(most_recent);
}

}  // namespace tetpbd
