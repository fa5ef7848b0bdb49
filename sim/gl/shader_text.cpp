#include <fmt/format.h>

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <ranges>
#include <sstream>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/gl/gpu.h"

namespace tetpbd {

namespace fs = std::filesystem;

const std::vector<std::pair<std::string, std::string>>& embedded_shaders();

namespace {

struct Dump {
  std::string folder;
  std::map<std::string, std::string> texts;  // by file
} dump;

std::string chosen_folder = std::getenv("TETPBD_SHADERS") ? std::getenv("TETPBD_SHADERS") : "";

std::string read_shader_file(const std::string& name) {
  if (const std::string& folder = shader_folder(); !folder.empty()) {
    std::ifstream file(fs::path(folder) / name, std::ios::binary);
    if (!file)
      throw Error("no such shader", folder + "/" + name, "point --shaders or TETPBD_SHADERS at a copy of shaders/");
    return {std::istreambuf_iterator<char>(file), {}};
  }
  for (const auto& [key, text] : embedded_shaders())
    if (key == name) return text;
  throw Error("no such shader", name, "it is not one of the files of shaders/", 1);
}

// The names that a pattern stands for: of "FOLDER/*.ENDING" all such files inside the program, in order; else itself.
std::vector<std::string> expand_pattern(const std::string& pattern) {
  const std::size_t star = pattern.find('*');
  if (star == std::string::npos) return {pattern};
  std::vector<std::string> names;
  for (const auto& [key, text] : embedded_shaders())
    if (key.starts_with(pattern.substr(0, star)) && key.ends_with(pattern.substr(star + 1))) names.push_back(key);
  return names;
}

std::string substitute(std::string text, const Substitutions& words) {
  for (const auto& [key, value] : words | std::views::reverse)  // KIND_ROW before KIND
    for (std::size_t at; (at = text.find("$" + key)) != std::string::npos;) text.replace(at, key.size() + 1, value);
  return text;
}

}  // namespace

void set_shader_folder(const std::string& folder) {
  if (!folder.empty() && !fs::is_directory(folder))
    throw Error("no such shader folder", folder, "point --shaders at a copy of shaders/");
  chosen_folder = folder;
}

const std::string& shader_folder() { return chosen_folder; }

void set_shader_dump(const std::string& folder) { dump = {folder, {}}; }

void dump_shader(const std::string& label, const std::string& stage, const std::string& text) {
  if (dump.folder.empty()) return;
  std::string name = label;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-') c = '_';
  const std::string ending = stage.substr(stage.rfind('.'));
  for (int number = 1;; ++number) {
    const std::string file = name + (number > 1 ? fmt::format("_{}", number) : "") + ending;
    const auto [at, is_new] = dump.texts.emplace(file, text);
    if (is_new) write_file(fs::path(dump.folder) / file, text);
    if (at->second == text) return;
  }
}

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
  for (int number = 1; std::getline(lines, line); ++number) {
    constexpr std::string_view foreach = "#foreach ", include = "#include \"";
    const std::size_t at = line.find(foreach);
    const bool repeated = at != std::string::npos;
    if (repeated) line.erase(0, at + foreach.size());
    const std::string resume = fmt::format("#line {} {}\n", number + 1, index);
    for (const Substitutions& item : repeated ? words.each : std::vector<Substitutions>(1)) {
      ShaderWords local{item, words.each};
      local.words.insert(words.words.begin(), words.words.end());
      const std::string filled = substitute(line, local.words);
      if (filled.starts_with(include)) {
        const std::string inner = filled.substr(include.size(), filled.rfind('"') - include.size());
        for (const std::string& file : expand_pattern(inner)) result += shader_text(file, local, files);
        result += resume;
      } else {
        result += filled + "\n";
      }
    }
    if (repeated) result += resume;
  }
  return result;
}

}  // namespace tetpbd
