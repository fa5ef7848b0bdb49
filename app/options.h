// Kinds of options of the command line, and what words can set.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>

#include "app/commands.h"
#include "sim/model/did_you_mean.h"

namespace tetpbd {

inline constexpr long most_steps = 1000000000;
inline constexpr const char* first_of_window = "bunny";  // soft, and solved by PBD: its settings matter at sight

/// What words can set, with its defaults.
struct Arguments {
  int (*start)(const Arguments&) = nullptr;  ///< the command; none: the window
  std::string scene = "bunny-drop";
  SceneOverrides overrides;
  std::optional<Scene> opened;  ///< from these, by commands that take a scene
  std::vector<std::array<int, 2>> sizes{{1280, 720}};
  bool explain = false;
  RunOptions run;  ///< its device and picture are those of every command that opens a scene
  SoakOptions soak;
  ReferenceOptions reference;
  BenchOptions bench;
  CompareOptions compare;
  MapOptions map;
  bool varied = false;  ///< an axis of the map by --vary
  bool hard_cases = false;
  ReproduceOptions reproduce;
  MeshOptions mesh;
  bool selftest = false;
  std::vector<std::array<const CLI::Option*, 2>> apart;  ///< never together: one would be dropped
};

/// A command of the program.
struct Command {
  const char *name, *help;
  void (*add_options)(CLI::App&, Arguments&);
  int (*start)(const Arguments&);
};
const std::vector<Command>& commands();
/// The window, where words name no command.
int start_view(const Arguments& arguments);
/// Opens what the words name, once all are known.
void open_scene(Arguments& arguments);

/// "1280x720", "2/8": two whole numbers in a range.
std::array<int, 2> two_numbers(const std::string& flag, const std::string& text, char between, int low, int high);

/// One of these words; as a transform() its number takes its place, which is an enum's value.
template <class Words>
CLI::Validator one_of(const Words& words) {
  return CLI::Validator(
      [=](std::string& text) {
        const auto found = std::ranges::find(words, text);
        if (found == words.end())
          return fmt::format("{}must be one of {}, not '{}'", did_you_mean(text, {words.begin(), words.end()}),
                             fmt::join(words, ", "), text);
        text = std::to_string(found - words.begin());
        return std::string();
      },
      "");
}

/// Text, a path, or a list. An empty one is refused: an unset shell variable would run another experiment.
template <class T>
CLI::Option* add(CLI::App& command, const char* flag, T& target, const std::string& help) {
  CLI::Option* option = command.add_option(flag, target, help);
  option->check([](const std::string& text) { return std::string(text.empty() ? "must not be empty" : ""); });
  if constexpr (!std::is_constructible_v<std::filesystem::path, T>) option->delimiter(',');
  return target.empty() ? option : option->capture_default_str();
}

/// A number in a range, or a list of them. A default outside the range is for the help to say.
template <class T, class N>
void add(CLI::App& command, const char* flag, T& target, N low, N high, const std::string& help) {
  CLI::Option* option = command.add_option(flag, target, help);
  const auto in_range = [=](const std::string& text) {
    N value{};
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
    return fmt::format("must be a {} from {} to {}, not '{}'", std::is_integral_v<N> ? "whole number" : "number", low,
                       high, text);
  };
  option->check(in_range, fmt::format("[{} .. {}]", low, high));
  bool shown = false;
  if constexpr (std::is_same_v<T, N>) shown = target >= low && target <= high;
  if constexpr (std::is_same_v<T, std::vector<N>>) option->delimiter(','), shown = !target.empty();
  if (shown) option->capture_default_str();
}

void add_gpu(CLI::App& command, int& gpu);
void add_progress(CLI::App& command, bool& progress);
CLI::Option* add_sizes(CLI::App& command, const char* flag, std::vector<std::array<int, 2>>& sizes,
                       const std::string& help);
void add_samples(CLI::App& command, int& samples);
/// How surfaces become tets.
void add_fill(CLI::App& command, SceneOverrides& overrides);
void add_copies(CLI::App& command, SceneOverrides& overrides);
void add_up(CLI::App& command, std::string& up, const std::string& of);
void add_overrides(CLI::App& command, SceneOverrides& overrides);
/// A flag for every setting that the command has none of its own for.
void add_parameters(CLI::App& command, SceneOverrides& overrides);
/// --vary, given once for each setting.
void add_vary(CLI::App& command, const std::string& help, const std::function<void(const std::string&)>& take);
/// A list for a setting that varies: --iterations 1,5 means --vary iterations=1,5.
void add_variation(CLI::App& command, const std::string& flags, const std::string& name, std::vector<Variation>& all,
                   const std::string& help);
/// What compare and bench vary, every combination of which is run. Anything else would make other scenes.
void add_variations(CLI::App& command, std::vector<Variation>& all);
void add_scene(CLI::App& command, Arguments& a, bool by_device = false);

}  // namespace tetpbd
