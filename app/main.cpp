// The command line: which command its words start.
#include <csignal>
#include <cstdio>
#include <sstream>
#include <utility>

#include "app/files.h"
#include "app/options.h"
#include "sim/error.h"
#include "sim/gl/gpu.h"
#include "sim/interrupt.h"

using namespace tetpbd;

namespace {

/// Of these words, which no command took, the first flag, else the first: what it may have been.
[[noreturn]] void refuse_unknown(const CLI::App& app, const std::vector<std::string>& words) {
  const auto parsed = app.get_subcommands();
  const std::string command = parsed.empty() ? "" : " " + parsed[0]->get_name();
  const auto flag = std::ranges::find_if(words, [](const auto& word) { return word.starts_with("-"); });
  const std::string word = flag == words.end() ? words.at(0) : flag->substr(0, flag->find('='));
  std::string mend;
  std::vector<std::string> known;
  const auto take = [&](auto& self, const CLI::App& from) -> void {
    for (const CLI::Option* option : from.get_options())
      for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (const CLI::App* group : from.get_subcommands([](const CLI::App* one) { return one->get_name().empty(); }))
      self(self, *group);
  };
  const auto commands = app.get_subcommands([](const CLI::App* one) { return !one->get_name().empty(); });
  for (const CLI::App* one : commands) {
    if (parsed.empty()) known.push_back(one->get_name());
    if (one->get_option_no_throw(word)) mend += fmt::format("it is an option of tetpbd {}; ", one->get_name());
  }
  for (const CLI::App* one : parsed) take(take, *one);
  take(take, app);
  throw Error(fmt::format("not known here: {}", fmt::join(words, " ")), "tetpbd" + command,
              fmt::format("{}{}see tetpbd{} --help", did_you_mean(word, known), mend, command));
}

}  // namespace

std::function<int()> tetpbd::parse_command_line(std::vector<std::string> words) {
  CLI::App app("tetpbd: Position-Based Dynamics of tetrahedral soft bodies on a GPU", "tetpbd");
  app.set_version_flag("--version", TETPBD_VERSION);
  app.require_subcommand(0, 1);
  app.fallthrough();
  std::string shaders;
  app.add_option("--shaders", shaders,
                 "folder to read shaders from instead of the embedded ones; edits take effect at once in the window");
  Arguments arguments;
  for (const Command& command : commands()) {
    CLI::App& added = *app.add_subcommand(command.name, command.help);
    command.add_options(added, arguments);
    added.final_callback([&arguments, start = command.start] { arguments.start = start; });
  }

  // Options without a command belong to the window: tetpbd --scene beam.
  if (!words.empty() && words[0].starts_with("--") && words[0] != "--help" && words[0] != "--version" &&
      !words[0].starts_with("--shaders"))
    words.insert(words.begin(), "view");
  std::reverse(words.begin(), words.end());  // the order CLI11 takes them in
  try {
    app.parse(words);
  } catch (const CLI::ExtrasError&) {
    refuse_unknown(app, app.remaining(true));
  } catch (const CLI::ParseError& problem) {
    if (problem.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(problem, text, text);
      return [text = text.str()] { return std::fputs(text.c_str(), stdout) < 0 ? 1 : 0; };
    }
    const auto parsed = app.get_subcommands();
    throw Error(problem.what(), "command line",
                fmt::format("see tetpbd {}--help", parsed.empty() ? "" : parsed[0]->get_name() + " "));
  }
  for (const auto& [one, other] : arguments.apart)
    if (one->count() > 0 && other->count() > 0)
      throw Error(fmt::format("{} does not go with {}", other->get_name(), one->get_name()), "command line",
                  "leave out one of the two");
  if (!shaders.empty()) set_shader_folder(shaders);
  if (!arguments.start) {
    arguments.start = start_view;
    arguments.overrides.by_device = true;
    arguments.scene = first_of_window;
    open_scene(arguments);
  }
  return [a = std::move(arguments)] {
    if (a.start != start_view || !a.run.record.empty()) catch_interrupts();  // else there is nothing to finish
    if (!a.run.dump_shaders.empty()) {
      make_output_folder(a.run.dump_shaders);
      set_shader_dump(a.run.dump_shaders.string());
    }
    return a.explain ? print_explanation(*a.opened, a.run.gpu, a.run.steps ? a.run.steps : 3) : a.start(a);
  };
}

static int fail(const std::string& line, int status) {
  std::fflush(stdout);
  print_error("tetpbd: " + printable(line) + "\n");
  return status;
}

int main(int argc, char** argv) {
  // A full quota is then an error of write(), which is reported and cleaned up after.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    const int status = parse_command_line({argv + std::min(argc, 1), argv + argc})();
    if (std::fflush(stdout) != 0 || std::ferror(stdout))
      throw Error("cannot write", "standard output", "is the disk full?", 1);
    return status;
  } catch (const Error& error) {
    return fail(error.what(), error.exit_status);
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(fmt::format("{}: {}: give another path", error.path1().string(), error.code().message()), 2);
  } catch (const std::bad_alloc&) {
    return fail(fmt::format("out of memory: {}: use a smaller mesh", argc > 1 ? argv[1] : "start"), 1);
  } catch (const std::exception& error) {
    if (std::ferror(stdout)) return fail("cannot write: standard output: is the disk full?", 1);
    return fail(fmt::format("unexpected: {}: please report this", error.what()), 1);
  }
}
