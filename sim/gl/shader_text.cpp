#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <ranges>
#include <regex>
#include <sstream>

#include "sim/error.h"
#include "sim/gl/program.h"

namespace tetpbd {

namespace fs = std::filesystem;

const std::vector<std::pair<std::string, std::string>>& embedded_shaders();

namespace {

std::string chosen_folder = [] {
  const char* variable = std::getenv("TETPBD_SHADERS");
  return variable ? variable : "";
}();

std::string read_shader_file(const std::string& name) {
  if (const std::string& folder = shader_folder(); !folder.empty()) {
    std::ifstream file(fs::path(folder) / name, std::ios::binary);
    if (!file)
      throw Error("no such shader", folder + "/" + name,
                  "point --shaders or TETPBD_SHADERS at a copy of shaders/");
    return {std::istreambuf_iterator<char>(file), {}};
  }
  for (const auto& [key, text] : embedded_shaders())
    if (key == name) return text;
  throw Error("no such shader", name, "it is not one of the files of shaders/", 1);
}

std::string substitute(std::string text, const Substitutions& words) {
  for (const auto& [key, value] : words | std::views::reverse)  // KIND_ROW before KIND
    for (std::size_t at; (at = text.find("$" + key)) != std::string::npos;)
      text.replace(at, key.size() + 1, value);
  return text;
}

}  // namespace

void set_shader_folder(const std::string& folder) {
  if (!folder.empty() && !fs::is_directory(folder))
    throw Error("no such shader folder", folder, "point --shaders at a copy of shaders/");
  chosen_folder = folder;
}

const std::string& shader_folder() { return chosen_folder; }

std::int64_t shader_folder_version() {
  if (shader_folder().empty()) return 0;
  std::int64_t newest = std::numeric_limits<std::int64_t>::min();  // the file clock starts in 2174
  std::error_code ignored;
  for (const auto& entry : fs::recursive_directory_iterator(shader_folder(), ignored))
    if (entry.is_regular_file(ignored))
      newest = std::max(newest, std::int64_t(entry.last_write_time(ignored).time_since_epoch().count()));
  return newest;
}

std::string shader_text(const std::string& name, const ShaderWords& words, std::vector<std::string>& files) {
  if (files.size() > 100) throw Error("shader includes do not end", name, "remove the circular #include", 1);
  const std::size_t index = files.size();
  files.push_back(name);
  std::istringstream lines(read_shader_file(name));
  std::string line, result = fmt::format("#line 1 {}\n", index);
  const auto expand_line = [&](const std::string& text, const ShaderWords& local, int number) {
    static const std::regex include(R"re(^\s*#include\s+"([^"]+)"\s*$)re");
    std::smatch match;
    const std::string filled = substitute(text, local.words);
    if (filled.find("#include") == std::string::npos || !std::regex_match(filled, match, include))
      result += filled + "\n";
    else
      result += shader_text(match[1], local, files) + fmt::format("#line {} {}\n", number + 1, index);
  };
  for (int number = 1; std::getline(lines, line); ++number) {
    constexpr std::string_view foreach = "#foreach ";
    const std::size_t at = line.find(foreach);
    if (at == std::string::npos) {
      expand_line(line, words, number);
      continue;
    }
    for (const Substitutions& item : words.each) {
      ShaderWords local = words;
      for (const auto& [key, value] : item) local.words[key] = value;
      expand_line(line.substr(at + foreach.size()), local, number);
    }
    result += fmt::format("#line {} {}\n", number + 1, index);
  }
  return result;
}

}  // namespace tetpbd
