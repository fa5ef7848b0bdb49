// Disks that are full, programs that die, signals, folders in the way: one line, a status, whole files,
// nothing left.
#include <doctest/doctest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/mesh/mesh_samples.h"

namespace {

using samples::contains;
using samples::Folder;
namespace fs = std::filesystem;

std::string content(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// tetpbd with these words, in the folder. `prepare` runs in the child before it becomes the program.
struct Program {
  const Folder& folder;
  pid_t pid;
  Program(
      const Folder& in, std::vector<std::string> words, const std::function<void()>& prepare = [] {})
      : folder(in), pid((std::fflush(nullptr), ::fork())) {
    REQUIRE(pid >= 0);
    if (pid != 0) return;
    if (::chdir(folder.path.c_str()) != 0 || !std::freopen("stdout", "w", stdout) ||
        !std::freopen("stderr", "w", stderr))
      ::_exit(99);
    for (const int number : {SIGINT, SIGTERM, SIGXFSZ, SIGPIPE}) ::signal(number, SIG_DFL);
    prepare();
    words.insert(words.begin(), TEST_PROGRAM);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    ::execv(TEST_PROGRAM, arguments.data());
    ::_exit(98);
  }
  /// Its exit status; 128 + number where a signal ended it.
  int wait() {
    int status = 0;
    while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  std::string err() const { return content(folder.path / "stderr"); }
};

template <class Condition>
bool soon(const Condition& condition) {
  for (int i = 0; i < 6000; ++i, std::this_thread::sleep_for(std::chrono::milliseconds(10)))
    if (condition()) return true;
  return false;
}

/// One line that holds `word`, and no temporary file anywhere.
void check_failed(Program& program, const std::string& word, int wanted = 1) {
  const int status = program.wait();
  const std::string err = program.err();
  CAPTURE(err);
  CHECK(status == wanted);
  CHECK(err.starts_with("tetpbd: "));
  CHECK(std::count(err.begin(), err.end(), '\n') == 1);
  CHECK(contains(err, word));
  for (const auto& entry : fs::recursive_directory_iterator(program.folder.path)) {
    CAPTURE(entry.path().string());
    CHECK(!contains(entry.path().filename().string(), ".part"));
  }
}

const std::vector<std::string> plain_run = {"run", "--scene", "beam",  "--steps",   "4", "--iterations",
                                            "1",   "--size",  "64x48", "--samples", "0", "--positions"};

std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

const std::vector<std::string> short_run = with(plain_run, {"--png-every", "2"});

std::function<void()> files_of_at_most(rlim_t bytes) {
  return [bytes] {
    const rlimit most{bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &most);
  };
}

/// A program `name` that does what the shell script says, first in PATH.
std::function<void()> instead_of(const Folder& folder, const std::string& name, const std::string& script) {
  fs::create_directories(folder.path / "bin");
  const fs::path file = folder.path / "bin" / name;
  std::ofstream(file) << "#!/bin/sh\n" << script;
  ::chmod(file.c_str(), 0755);
  return [path = (folder.path / "bin").string()] { ::setenv("PATH", (path + ":" + std::getenv("PATH")).c_str(), 1); };
}

std::string cube_off() {
  return "OFF\n8 12 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n3 0 2 1\n3 1 2 3\n3 4 5 6\n3 "
         "5 7 6\n"
         "3 0 1 4\n3 1 5 4\n3 2 6 3\n3 3 6 7\n3 0 4 2\n3 2 4 6\n3 1 3 5\n3 3 7 5\n";
}

}  // namespace

TEST_CASE("faults: a full disk") {
  const Folder folder;
  Program nothing(folder, with(short_run, {"--out", "a"}), files_of_at_most(150));
  check_failed(nothing, "cannot be written");
  CHECK(fs::is_empty(folder.path / "a"));
  Program some(folder, with(plain_run, {"--out", "b"}), files_of_at_most(7000));
  check_failed(some, ".npy");  // statistics fit, positions do not
  CHECK(!fs::exists(folder.path / "b/positions.npy"));
  CHECK(nlohmann::json::parse(content(folder.path / "b/stats.json")).contains("timing"));
  Program video(folder, with(plain_run, {"--out", "c", "--video", "c.gif", "--video-every", "1"}),
                files_of_at_most(2500));  // scene.json fits
  check_failed(video, "c.gif");
  CHECK(!fs::exists(folder.path / "c.gif"));
  Program compare(folder,
                  {"compare", "--scene", "beam", "--modes", "node", "--iterations", "1", "--substeps", "1", "--steps",
                   "2", "--out", "d"},
                  files_of_at_most(600));
  check_failed(compare, "d/films/");
  CHECK(fs::is_empty(folder.path / "d/films"));
  Program bench(folder,
                {"bench", "--scenes", "beam", "--modes", "cpu", "--iterations", "1", "--frames", "1", "--warm-up", "0",
                 "--repeats", "1", "--no-render", "--out", "e"},
                files_of_at_most(200));
  check_failed(bench, "bench.");
  CHECK(fs::is_empty(folder.path / "e"));
  Program full(folder, {"info"}, [] {
    if (!std::freopen("/dev/full", "w", stdout)) ::_exit(97);
  });
  check_failed(full, "standard output");
  Program explain(folder, {"run", "--scene", "beam", "--explain"}, [] {
    if (!std::freopen("/dev/full", "w", stdout)) ::_exit(97);
    std::setvbuf(stdout, nullptr, _IONBF, 0);
  });
  check_failed(explain, "standard output");
  Program mute(folder, {"run", "--scene", "none"}, [] {
    if (!std::freopen("/dev/full", "w", stderr)) ::_exit(97);
  });
  CHECK(mute.wait() == 2);
}

TEST_CASE("faults: folders and files in the way") {
  const Folder folder;
  folder.write("file", "x");
  for (const char* out : {"file", "file/out", "/proc/none", "/dev/full"}) {
    CAPTURE(out);
    Program run(folder, with(short_run, {"--out", out}));
    check_failed(run, out, 2);
  }
  fs::create_directories(folder.path / "a/stats.json");
  Program taken(folder, with(plain_run, {"--out", "a"}));
  check_failed(taken, "stats.json");
  for (const char* scene : {"file", "a", "none.json", "/dev/full", "/dev/zero"}) {
    CAPTURE(scene);
    Program run(folder, {"run", "--scene", scene});
    check_failed(run, scene, 2);
  }
  for (const char* mesh : {"none.ply", "a", "/dev/zero", "none.node"}) {
    CAPTURE(mesh);
    Program run(folder, {"mesh", mesh});
    check_failed(run, mesh, 2);
  }
  Program line(folder, {"mesh", "two\nlines\x1b[2J.ply"});
  check_failed(line, "two?lines?[2J.ply", 2);
  Program range(folder, {"run", "--steps", "0"});
  check_failed(range, "--steps: must be a whole number from 1 to 1000000000, not '0'", 2);
  Program format(folder, {"mesh", "none.ply", "--out", "a.vtk"});
  check_failed(format, "unknown mesh format '.vtk'", 2);
  CHECK(content(folder.path / "stdout").empty());
}

TEST_CASE("faults: shards that are damaged are not merged") {
  const Folder folder;
  Program whole(folder, {"compare", "--scene", "beam", "--modes", "cpu", "--iterations", "1", "--substeps", "1",
                         "--steps", "2", "--out", "part"});
  REQUIRE(whole.wait() == 0);
  const fs::path file = folder.path / "part/compare.json";
  const nlohmann::json good = nlohmann::json::parse(content(file));
  const auto refused = [&](const std::string& text) {
    CAPTURE(text);
    std::ofstream(file) << text;
    Program merge(folder, {"compare", "--merge", "part", "--out", "all"});
    check_failed(merge, "not a finished comparison", 2);
  };
  std::vector<nlohmann::json> changed;
  for (const char* key : {"device", "steps", "shard", "combinations"}) {
    nlohmann::json without = good, other = good;
    without.erase(key), other[key] = "x";
    changed.push_back(without), changed.push_back(other);
  }
  for (const char* key : {"mode", "iterations", "wall_ms_per_step", "finite"}) {
    nlohmann::json without = good, other = good;
    without["rows"][0].erase(key), other["rows"][0][key] = nlohmann::json::array();
    changed.push_back(without), changed.push_back(other);
  }
  for (const nlohmann::json& document : changed) refused(document.dump());
  refused(good.dump().substr(0, 200));
  refused("{\"device\": " + std::string(100000, '['));
  refused("");
  std::ofstream(file) << good.dump();
  Program merge(folder, {"compare", "--merge", "part", "--out", "all"});
  CHECK(merge.wait() == 0);
}

TEST_CASE("faults: ffmpeg that is missing, fails at once, or dies on the way") {
  const Folder folder;
  const auto film = with(short_run, {"--out", "a", "--video", "'-q \"$(touch run)\nx.mp4", "--video-every", "1"});
  Program missing(folder, film, [] { ::setenv("PATH", "/nowhere", 1); });
  check_failed(missing, "install ffmpeg");
  fs::create_directories(folder.path / "locked");
  fs::create_symlink("/usr/bin/setsid", folder.path / "locked/setsid");
  std::ofstream(folder.path / "locked/ffmpeg") << "nobody may run this";
  Program locked(folder, film, [&] { ::setenv("PATH", (folder.path / "locked").c_str(), 1); });
  check_failed(locked, "install ffmpeg");
  Program fails(folder, film, instead_of(folder, "ffmpeg", "echo no such codec >&2; exit 1\n"));
  check_failed(fails, "no such codec");
  Program dies(folder, film, instead_of(folder, "ffmpeg", "head -c 20000 >/dev/null; kill -9 $$\n"));
  check_failed(dies, "ffmpeg ended early");
  fs::remove_all(folder.path / "bin");
  Program works(folder, film);  // and a name full of quotes, blanks and line breaks is only a name
  CHECK(works.wait() == 0);
  CHECK(works.err() == "");
  CHECK(content(folder.path / "'-q \"$(touch run)\nx.mp4").substr(4, 4) == "ftyp");
  CHECK(!fs::exists(folder.path / "run"));
}

TEST_CASE("faults: interrupted, what was finished is whole") {
  const Folder folder;
  // A first signal after the first result is there.
  const auto interrupt = [&](const std::vector<std::string>& words, int number, const std::function<bool()>& begun) {
    CAPTURE(words[0]);
    Program program(folder, words);
    CHECK(soon(begun));
    ::kill(program.pid, number);
    check_failed(program, "interrupted");
  };
  const auto printed = [&](std::size_t lines) {
    return [&folder, lines] {
      const std::string out = content(folder.path / "stdout");
      return std::size_t(std::count(out.begin(), out.end(), '\n')) >= lines;
    };
  };
  interrupt({"run", "--scene", "beam", "--steps", "100000000", "--out", "run", "--size", "64x48", "--samples", "0",
             "--png-every", "5", "--video", "run.mp4"},
            SIGTERM, [&] { return fs::exists(folder.path / "run/frame_00010.png"); });
  CHECK(nlohmann::json::parse(content(folder.path / "run/stats.json"))["timing"]["steps"].get<long>() >= 10);
  CHECK(content(folder.path / "run.mp4").substr(4, 4) == "ftyp");
  fs::remove(folder.path / "stdout");
  std::string many = "1";
  for (int i = 0; i < 2000; ++i) many += ",1";
  interrupt({"bench",
             "--scenes",
             "beam",
             "--modes",
             "cpu",
             "--iterations",
             "1",
             "--substeps",
             many,
             "--frames",
             "5",
             "--warm-up",
             "0",
             "--repeats",
             "1",
             "--no-render",
             "--out",
             "bench",
             "--constraint-sets",
             "stretch"},
            SIGINT, printed(7));
  CHECK(nlohmann::json::parse(content(folder.path / "bench/bench.json"))["rows"].size() >= 2);
  {
    Program program(folder, {"compare", "--scene", "beam", "--modes", "cpu", "--iterations", many, "--substeps", "1",
                             "--steps", "5", "--out", "compare"});
    std::this_thread::sleep_for(std::chrono::seconds(2));
    ::kill(program.pid, SIGINT);
    check_failed(program, "interrupted");
    for (const auto& entry : fs::directory_iterator(folder.path / "compare"))
      if (entry.path().extension() == ".json") CHECK(nlohmann::json::parse(content(entry.path()))["rows"].size() >= 1);
  }
  // A step of hours: the second signal does not wait for it.
  Program stubborn(folder, {"run", "--scene", "beam", "--mode", "cpu", "--iterations", "100000", "--substeps", "100000",
                            "--out", "stubborn"});
  CHECK(soon([&] { return fs::exists(folder.path / "stubborn"); }));
  std::this_thread::sleep_for(std::chrono::seconds(1));
  ::kill(stubborn.pid, SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ::kill(stubborn.pid, SIGINT);
  CHECK(stubborn.wait() == 128 + SIGINT);
  fs::remove(folder.path / "stubborn/scene.json");                            // that is whole from the start
  for (const auto& entry : fs::directory_iterator(folder.path / "stubborn"))  // temporary ones, as the guide says
    CHECK(contains(entry.path().filename().string(), ".part"));
}

TEST_CASE("faults: an interrupted reproduce keeps the tables it has") {
  const Folder folder;
  Program program(folder, {"reproduce", "--quick", "--out", "r"});
  CHECK(soon([&] { return fs::exists(folder.path / "r/tables/table4.csv"); }));
  ::kill(program.pid, SIGTERM);
  check_failed(program, "interrupted");
  CHECK(contains(content(folder.path / "r/tables/table4.csv"), "Bunny,pYq1.85o/140"));
  CHECK(!fs::exists(folder.path / "r/report.html"));
}

namespace {

// The child that fills the surface, once it is there.
pid_t child_of(pid_t parent) {
  std::istringstream children(content(fmt::format("/proc/{0}/task/{0}/children", parent)));
  pid_t child = 0;
  children >> child;
  return child;
}

}  // namespace

TEST_CASE("faults: TetGen's child is killed, runs out of memory, or is interrupted") {
  const Folder folder;
  folder.write("cube.off", cube_off());
  // Ten million tets: minutes.
  const std::vector<std::string> long_work = {"mesh", "cube.off", "--tetgen", "pqa1e-7", "--out", "cube.msh"};
  const auto meddle = [&](const std::function<void(pid_t, pid_t)>& action, const char* word) {
    CAPTURE(word);
    Program program(folder, long_work);
    // The first child reads the file; the one after the report of the surface fills it.
    pid_t child = 0;
    REQUIRE(soon([&] {
      const std::string name = content(fmt::format("/proc/{}/statm", child = child_of(program.pid)));
      std::istringstream words(name);
      long mapped = 0, resident = 0;
      words >> mapped >> resident;
      return child > 0 && resident > 10000;  // pages: 40 MB of tets
    }));
    REQUIRE(child > 0);
    action(program.pid, child);
    check_failed(program, word, std::string(word) == "interrupted" ? 1 : 2);
    CHECK(!fs::exists(folder.path / "cube.msh"));
    CHECK(::kill(child, 0) != 0);
  };
  meddle([](pid_t, pid_t child) { ::kill(child, SIGKILL); }, "signal 9");
  meddle(
      [](pid_t, pid_t child) {
        const rlimit most{1 << 20, 1 << 20};
        ::prlimit(child, RLIMIT_AS, &most, nullptr);
      },
      "TetGen failed");
  meddle([](pid_t parent, pid_t) { ::kill(parent, SIGINT); }, "interrupted");
}

TEST_CASE("faults: cache folders that cannot be used cost time alone") {
  const Folder folder;
  folder.write("cube.off", cube_off());
  const std::vector<std::string> words = {"mesh", "cube.off", "--out", "cube.msh"};
  Program first(folder, words);
  CHECK(first.wait() == 0);
  const std::string made = content(folder.path / "cube.msh");
  fs::path kept;
  for (const auto& entry : fs::directory_iterator(folder.cache())) kept = entry.path();
  const auto again = [&](const std::string& how, const std::function<void()>& damage, const std::string& cache = "") {
    CAPTURE(how);
    damage();
    fs::remove(folder.path / "cube.msh");
    Program program(folder, words, [&] {
      if (!cache.empty()) ::setenv("TETPBD_CACHE", cache.c_str(), 1);
    });
    CHECK(program.wait() == 0);
    CHECK(program.err() == "");
    CHECK(content(folder.path / "cube.msh") == made);
  };
  const auto nothing = [] {};
  again("a device", nothing, "/dev/full");
  again("read-only", nothing, "/proc");
  again("a file", nothing, (folder.path / "cube.off").string());
  again("garbage", [&] { std::ofstream(kept, std::ios::binary) << std::string(5000, '\x91'); });
  again("empty", [&] { std::ofstream(kept, std::ios::trunc).close(); });
  again("a folder", [&] { fs::remove(kept), fs::create_directory(kept); });
  again("a pipe", [&] { fs::remove(kept), ::mkfifo(kept.c_str(), 0600); });
}
