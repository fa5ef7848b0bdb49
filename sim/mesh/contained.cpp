#include "sim/mesh/contained.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <thread>

#include "sim/error.h"
#include "sim/interrupt.h"

namespace tetpbd {
namespace {

using Clock = std::chrono::steady_clock;

// The child's answer: one header, then `size` bytes. Anything shorter is a child that died on the way.
struct Header {
  std::uint64_t magic = 0x31444e4941544e43;
  std::uint64_t refused = 0;
  std::uint64_t size = 0;
};

bool write_all(int fd, const void* data, std::size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(fd, at, size);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    size -= static_cast<std::size_t>(n);
  }
  return true;
}

// GL drivers and sanitizers map terabytes of address space they never touch, so the limit counts from there.
void limit_memory(std::size_t bytes) {
  unsigned long long pages = 0;
  if (std::FILE* statm = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(statm, "%llu", &pages) != 1) pages = 0;
    std::fclose(statm);
  }
  if (pages == 0) return;
  const rlim_t mapped = static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(mapped + bytes, limit.rlim_max);
  ::setrlimit(RLIMIT_AS, &limit);
}

[[noreturn]] void run_child(int out, pid_t parent, const std::function<std::string()>& work,
                            const ContainedLimits& limits) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGPIPE, SIGXFSZ, SIGINT, SIGTERM})
    std::signal(number, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  const int null = ::open("/dev/null", O_RDWR);
  if (null >= 0) {
    ::dup2(null, STDIN_FILENO);
    ::dup2(null, STDOUT_FILENO);
    ::dup2(null, STDERR_FILENO);
  }
  limit_memory(limits.bytes);

  Header header;
  std::string bytes;
  try {
    bytes = work();
  } catch (const std::exception& problem) {
    header.refused = 1;
    bytes = problem.what();
  } catch (...) {
    header.refused = 1;
    bytes = "an exception without text";
  }
  header.size = bytes.size();
  const bool sent = write_all(out, &header, sizeof header) && write_all(out, bytes.data(), bytes.size());
  ::_exit(sent ? 0 : 1);  // no destructors, no atexit: the parent's GL and files are not the child's to close
}

std::string describe_end(int status) {
  if (WIFSIGNALED(status)) {
    const char* name = strsignal(WTERMSIG(status));
    return fmt::format("it was ended by signal {} ({})", WTERMSIG(status), name ? name : "unknown");
  }
  if (WIFEXITED(status))
    return fmt::format("it ended with status {} before it had answered", WEXITSTATUS(status));
  return "it ended abnormally";
}

int milliseconds_until(Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return static_cast<int>(std::clamp<long long>(left, 0, 100));  // then looks whether it was interrupted
}

// Reads to the end of the pipe; false when the deadline comes first.
bool read_until(int fd, Clock::time_point deadline, std::string& bytes) {
  std::string chunk(1 << 20, '\0');
  while (Clock::now() < deadline && !interrupted()) {
    pollfd wanted{fd, POLLIN, 0};
    const int ready = ::poll(&wanted, 1, milliseconds_until(deadline));
    if (ready < 0 && errno != EINTR) return true;
    if (ready > 0) {
      const ssize_t n = ::read(fd, chunk.data(), chunk.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return true;
      bytes.append(chunk.data(), static_cast<std::size_t>(n));
    }
  }
  return false;
}

// The pipe is closed, so the child is about to end; still give it no more than the deadline.
int reap(pid_t child, Clock::time_point deadline) {
  int status = 0;
  for (;;) {
    const pid_t got = ::waitpid(child, &status, WNOHANG);
    if (got == child) return status;
    if (got < 0 && errno != EINTR) return 0;  // SIGCHLD is ignored: the answer's own length check must do
    if (Clock::now() >= deadline) {
      ::kill(child, SIGKILL);
      while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      return status;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace

ContainedResult run_contained(const std::function<std::string()>& work, const ContainedLimits& limits) {
  ContainedResult result;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    result.reason = fmt::format("no pipe: {}", std::strerror(errno));
    return result;
  }
  const double seconds = std::clamp(limits.seconds, 0.0, 1e7);
  const auto deadline =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) {
    result.reason = fmt::format("no child process: {}", std::strerror(errno));
    ::close(ends[0]);
    ::close(ends[1]);
    return result;
  }
  if (child == 0) {
    ::close(ends[0]);
    run_child(ends[1], parent, work, limits);
  }
  ::close(ends[1]);

  std::string bytes;
  bool in_time = false;
  try {
    in_time = read_until(ends[0], deadline, bytes);
  } catch (...) {  // the parent ran out of memory for the answer
    ::close(ends[0]);
    reap(child, Clock::time_point::min());
    throw;
  }
  ::close(ends[0]);
  const int status = reap(child, in_time ? deadline : Clock::time_point::min());

  if (!in_time && interrupted())
    throw Error("interrupted", "while a mesh was read or filled", "start again; nothing was written", 1);
  if (!in_time) {
    result.end = ContainedResult::End::timed_out;
    result.reason = fmt::format("it took longer than {:g} s", limits.seconds);
    return result;
  }
  Header header;
  const bool whole = bytes.size() >= sizeof header && [&] {
    std::memcpy(&header, bytes.data(), sizeof header);
    return header.magic == Header{}.magic && header.size == bytes.size() - sizeof header;
  }();
  if (!whole) {
    result.reason = describe_end(status);
    return result;
  }
  bytes.erase(0, sizeof header);
  result.end = header.refused ? ContainedResult::End::refused : ContainedResult::End::done;
  (header.refused ? result.reason : result.bytes) = std::move(bytes);
  return result;
}

}  // namespace tetpbd
