#include "sim/mesh/subprocess.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>

#include "sim/error.h"
#include "sim/interrupt.h"

namespace tetpbd {
namespace {

constexpr int not_started = 127;

// Between fork and exec only system calls are safe, because other threads may have had any lock.
[[noreturn]] void execute(char* const* words, int output, std::size_t bytes) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit no_core{0, 0}, memory{bytes, bytes};
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::setrlimit(RLIMIT_AS, &memory);
  const int null = ::open("/dev/null", O_RDWR);
  ::dup2(null, STDIN_FILENO);
  ::dup2(output, STDOUT_FILENO);
  ::dup2(null, STDERR_FILENO);
  ::execvp(words[0], words);
  ::_exit(not_started);
}

}  // namespace

SubprocessEnd run_subprocess(const std::vector<std::string>& arguments, const SubprocessLimits& limits) {
  std::vector<char*> words;
  for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  int ends[2];
  const pid_t child = ::pipe2(ends, O_CLOEXEC) == 0 ? ::fork() : -1;
  if (child < 0) throw Error("cannot be started", arguments[0], std::strerror(errno), 1);
  if (child == 0) execute(words.data(), ends[1], limits.bytes);
  ::close(ends[1]);
  SubprocessEnd end{SubprocessEnd::failed, {}, {}};
  const auto start = std::chrono::steady_clock::now();
  for (char chunk[65536];;) {
    if (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() > limits.seconds)
      end.kind = SubprocessEnd::timed_out;
    if (end.kind == SubprocessEnd::timed_out || interrupted()) ::kill(child, SIGKILL);
    pollfd wanted{ends[0], POLLIN, 0};
    if (::poll(&wanted, 1, 100) <= 0) continue;
    const ssize_t n = ::read(ends[0], chunk, sizeof chunk);
    if (n <= 0) break;
    if (end.output.size() < limits.output) end.output.append(chunk, std::size_t(n));
  }
  ::close(ends[0]);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (interrupted()) throw Error("interrupted", "while a mesh was filled", "start again; nothing was written", 1);
  if (WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    end.reason = fmt::format("it was ended by signal {} ({})", number, ::strsignal(number));
  } else if (WEXITSTATUS(status) != 0) {
    end.reason = fmt::format("it ended with status {}", WEXITSTATUS(status));
    if (WEXITSTATUS(status) == not_started) end.kind = SubprocessEnd::not_started;
  } else if (end.kind != SubprocessEnd::timed_out) {
    end.kind = SubprocessEnd::done;
  }
  return end;
}

}  // namespace tetpbd
