#include "sim/mesh/subprocess.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>

#include "sim/error.h"
#include "sim/interrupt.h"

namespace tetpbd {
namespace {

constexpr int not_started = 127;

// Between fork and exec only system calls are safe: other threads may have held any lock.
[[noreturn]] void become(char* const* arguments, int output, pid_t parent, const SubprocessLimits& limits) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  for (const int number : {SIGALRM, SIGPIPE, SIGXFSZ, SIGINT, SIGTERM}) std::signal(number, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  rlimit memory{};
  ::getrlimit(RLIMIT_AS, &memory);
  memory.rlim_cur = std::min<rlim_t>(limits.bytes, memory.rlim_max);
  ::setrlimit(RLIMIT_AS, &memory);
  const int null = ::open("/dev/null", O_RDWR);
  ::dup2(null, STDIN_FILENO);
  ::dup2(output, STDOUT_FILENO);
  ::dup2(null, STDERR_FILENO);
  // The timer outlives exec: at its end the system kills the program.
  const double seconds = std::clamp(limits.seconds, 1e-6, 1e7), whole = std::floor(seconds);
  const itimerval timer{{}, {static_cast<time_t>(whole), static_cast<suseconds_t>((seconds - whole) * 1e6)}};
  ::setitimer(ITIMER_REAL, &timer, nullptr);
  ::execvp(arguments[0], arguments);
  ::_exit(not_started);
}

}  // namespace

SubprocessEnd run_subprocess(const std::vector<std::string>& arguments, const SubprocessLimits& limits) {
  std::vector<char*> words;
  for (const std::string& word : arguments) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) return {SubprocessEnd::failed, {}, std::strerror(errno)};
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) become(words.data(), ends[1], parent, limits);
  const int why = errno;
  ::close(ends[1]);
  std::string output;
  for (char chunk[65536]; child > 0;) {
    if (interrupted()) ::kill(child, SIGKILL);
    pollfd wanted{ends[0], POLLIN, 0};
    if (::poll(&wanted, 1, 100) <= 0) continue;
    const ssize_t n = ::read(ends[0], chunk, sizeof chunk);
    if (n <= 0) break;
    if (output.size() < limits.output) output.append(chunk, std::size_t(n));
  }
  ::close(ends[0]);
  if (child < 0) return {SubprocessEnd::failed, {}, std::strerror(why)};
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (interrupted())
    throw Error("interrupted", "while a mesh was filled", "start again; nothing was written", 1);
  if (WIFSIGNALED(status)) {
    const int number = WTERMSIG(status);
    return {number == SIGALRM ? SubprocessEnd::timed_out : SubprocessEnd::failed, output,
            fmt::format("it was ended by signal {} ({})", number, ::strsignal(number))};
  }
  if (WEXITSTATUS(status) == not_started) return {SubprocessEnd::not_started, output, "it did not start"};
  if (WEXITSTATUS(status) != 0)
    return {SubprocessEnd::failed, output, fmt::format("it ended with status {}", WEXITSTATUS(status))};
  return {SubprocessEnd::done, output, {}};
}

}  // namespace tetpbd
