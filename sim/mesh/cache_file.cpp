#include "sim/mesh/cache_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/mesh/bytes.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

struct Head {
  CacheMagic magic{};
  CacheKey key{};
  std::uint64_t checksum = 0;  // of the content
  std::uint64_t size = 0;
};

}  // namespace

fs::path cache_folder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value ? value : "");
  };
  if (const fs::path own = variable("TETPBD_CACHE"); !own.empty()) return own;
  if (const fs::path shared = variable("XDG_CACHE_HOME"); shared.is_absolute()) return shared / "tetpbd";
  if (const fs::path home = variable("HOME"); !home.empty()) return home / ".cache" / "tetpbd";
  return {};
}

CacheKey cache_key(std::string_view bytes) { return {hash_bytes(bytes, 1), hash_bytes(bytes, 2)}; }

std::string cache_name(const CacheKey& key) { return fmt::format("{:016x}{:016x}", key[0], key[1]); }

std::string wrap_cached(const CacheMagic& magic, const CacheKey& key, std::string_view content) {
  const Head head{magic, key, hash_bytes(content, 3), content.size()};
  std::string bytes;
  bytes.reserve(sizeof head + content.size());
  bytes.append(reinterpret_cast<const char*>(&head), sizeof head).append(content);
  return bytes;
}

std::optional<std::string_view> unwrap_cached(std::string_view bytes, const CacheMagic& magic,
                                              const CacheKey& key) {
  Head head;
  if (bytes.size() < sizeof head) return {};
  std::memcpy(&head, bytes.data(), sizeof head);
  bytes.remove_prefix(sizeof head);
  if (head.magic != magic || head.key != key || head.size != bytes.size() ||
      hash_bytes(bytes, 3) != head.checksum)
    return {};
  return bytes;
}

std::optional<std::string> read_cached(const fs::path& file, std::size_t most) {
  const int source = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (source < 0) return {};
  std::optional<std::string> bytes;
  struct stat status {};
  if (::fstat(source, &status) == 0 && S_ISREG(status.st_mode) && std::size_t(status.st_size) <= most) {
    bytes.emplace(std::size_t(status.st_size), '\0');
    for (std::size_t done = 0; bytes && done < bytes->size();) {
      const ssize_t n = ::read(source, bytes->data() + done, bytes->size() - done);
      if (n > 0)
        done += std::size_t(n);
      else if (n == 0 || errno != EINTR)
        bytes.reset();
    }
  }
  ::close(source);
  return bytes;
}

bool write_cached(const fs::path& file, std::string bytes) {
  std::error_code ignored;
  fs::create_directories(file.parent_path(), ignored);
  try {
    write_whole(file, bytes);
  } catch (const Error&) {  // read-only or full
    return false;
  }
  return true;
}

void bound_cache(const fs::path& folder, std::size_t most_files, std::uintmax_t most_bytes) {
  struct Kept {
    fs::file_time_type time;
    std::uintmax_t bytes;
    fs::path file;
  };
  std::vector<Kept> files;
  std::uintmax_t bytes = 0;
  std::error_code failed;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed)) {
    std::error_code gone;  // another process bounds the same folder
    if (!at->is_regular_file(gone)) continue;
    Kept kept{at->last_write_time(gone), 0, at->path()};
    kept.bytes = gone ? 0 : at->file_size(gone);
    if (gone) continue;
    bytes += kept.bytes;
    files.push_back(std::move(kept));
  }
  std::sort(files.begin(), files.end(),
            [](const Kept& a, const Kept& b) { return std::tie(a.time, a.file) < std::tie(b.time, b.file); });
  std::size_t count = files.size();
  for (const Kept& kept : files) {
    if (count <= most_files && bytes <= most_bytes) break;
    fs::remove(kept.file, failed);
    --count;
    bytes -= kept.bytes;
  }
}

}  // namespace tetpbd
