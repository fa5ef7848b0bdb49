#include "sim/gl/program_cache.h"

#include <algorithm>
#include <cstring>
#include <map>

#include "sim/mesh/bytes.h"

namespace tetpbd {

namespace fs = std::filesystem;

namespace {

// Change it whenever the file's layout or what is done with a program before it is kept changes.
constexpr CacheMagic magic{'t', 'e', 't', 'p', 'b', 'd', 'P', '1'};

std::map<CacheKey, ProgramBinary>& of_process() {
  static std::map<CacheKey, ProgramBinary> binaries;
  return binaries;
}

// None: the driver gives no binaries.
std::vector<GLint> offered_formats() {
  GLint count = 0;
  glGetIntegerv(GL_NUM_PROGRAM_BINARY_FORMATS, &count);
  std::vector<GLint> formats(std::size_t(std::max(count, 0)));
  if (!formats.empty()) glGetIntegerv(GL_PROGRAM_BINARY_FORMATS, formats.data());
  return formats;
}

GLuint load(const ProgramBinary& binary) {
  const GLuint program = glCreateProgram();
  glProgramBinary(program, binary.format, binary.bytes.data(), GLsizei(binary.bytes.size()));
  GLint linked = 0;
  glGetProgramiv(program, GL_LINK_STATUS, &linked);
  if (linked) return program;
  glDeleteProgram(program);  // made by another driver of the same name, or for another kind of context
  return 0;
}

}  // namespace

std::string driver_lines() {
  std::string lines;
  for (const GLenum name : {GL_VENDOR, GL_RENDERER, GL_VERSION}) {
    const auto* text = reinterpret_cast<const char*>(glGetString(name));
    lines += std::string(text ? text : "") + "\n";
  }
  return lines;
}

CacheKey program_key(const std::vector<std::pair<GLenum, std::string>>& stages, const std::string& driver) {
  std::string bytes = driver;
  for (const auto& [kind, text] : stages) bytes += std::to_string(kind) + "\n" + text + '\0';
  return cache_key(bytes);
}

fs::path program_file(const CacheKey& key) {
  const fs::path folder = cache_folder();
  return folder.empty() ? folder : folder / "programs" / (cache_name(key) + ".program");
}

std::string program_bytes(const CacheKey& key, const ProgramBinary& binary) {
  std::string content(sizeof binary.format, '\0');
  std::memcpy(content.data(), &binary.format, sizeof binary.format);
  return wrap_cached(magic, key, content + binary.bytes);
}

std::optional<ProgramBinary> parse_program(std::string_view bytes, const CacheKey& key,
                                           const std::vector<GLint>& formats) {
  const std::optional<std::string_view> content = unwrap_cached(bytes, magic, key);
  ProgramBinary binary;
  if (!content || content->size() <= sizeof binary.format) return {};
  std::memcpy(&binary.format, content->data(), sizeof binary.format);
  if (std::find(formats.begin(), formats.end(), GLint(binary.format)) == formats.end()) return {};
  binary.bytes = content->substr(sizeof binary.format);
  return binary;
}

GLuint kept_program(const CacheKey& key) {
  if (const auto found = of_process().find(key); found != of_process().end()) {
    if (const GLuint program = load(found->second)) return program;
    of_process().erase(found);
  }
  const std::vector<GLint> formats = offered_formats();
  if (formats.empty()) return 0;
  const fs::path file = program_file(key);
  const std::optional<std::string> bytes = read_cached(file, most_program_bytes);
  if (!bytes) return 0;
  std::optional<ProgramBinary> binary = parse_program(*bytes, key, formats);
  const GLuint program = binary ? load(*binary) : 0;
  if (!program) return 0;
  std::error_code ignored;
  fs::last_write_time(file, fs::file_time_type::clock::now(), ignored);  // the oldest are removed
  of_process()[key] = std::move(*binary);
  return program;
}

void keep_program(const CacheKey& key, GLuint program) {
  GLint size = 0;
  if (offered_formats().empty()) return;
  glGetProgramiv(program, GL_PROGRAM_BINARY_LENGTH, &size);
  if (size <= 0) return;
  ProgramBinary binary;
  binary.bytes.resize(std::size_t(size));
  glGetProgramBinary(program, size, &size, &binary.format, binary.bytes.data());
  binary.bytes.resize(std::size_t(std::max(size, 0)));
  if (const fs::path file = program_file(key);
      !file.empty() && write_cached(file, program_bytes(key, binary)))
    bound_cache(file.parent_path(), most_program_files, most_program_bytes);
  of_process()[key] = std::move(binary);
}

void forget_programs() { of_process().clear(); }

}  // namespace tetpbd
