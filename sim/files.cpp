#include "sim/files.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "sim/error.h"

namespace tetpbd {
namespace fs = std::filesystem;

// The extension stays, because programs choose formats by it.
PartFile::PartFile(const fs::path& name)
    : file(name),
      part(name.parent_path() /
           fmt::format(".{}.{}.part{}", name.stem().string(), ::getpid(), name.extension().string())) {}

PartFile::~PartFile() {
  std::error_code ignored;
  fs::remove(part, ignored);
}

void PartFile::finish() const {
  std::error_code failed;
  fs::rename(part, file, failed);
  if (failed) throw Error("cannot be written", file.string(), failed.message(), 1);
}

GrowingFile::GrowingFile(const fs::path& file) : part_(file), stream_(part_.part, std::ios::binary) { add(""); }

void GrowingFile::add(const std::string& text) {
  if (!(stream_ << text)) throw Error("cannot be written", part_.file.string(), std::strerror(errno), 1);
}

void GrowingFile::overwrite_start(const std::string& text) {
  stream_.seekp(0);
  add(text);
}

void GrowingFile::close() {
  stream_.close();
  add("");
  part_.finish();
}

void write_file(const fs::path& file, const std::string& content) {
  GrowingFile whole(file);
  whole.add(content);
  whole.close();
}

}  // namespace tetpbd
