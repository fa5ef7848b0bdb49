// Linked programs as the driver's own binaries, kept for the life of the process and in programs/ of the
// user's cache folder (cache_file.h): a driver may take a second to compile a kernel.
#pragma once

#include <GL/glew.h>

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sim/mesh/cache_file.h"

namespace tetpbd {

struct ProgramBinary {
  GLenum format = 0;
  std::string bytes;
};

constexpr std::size_t most_program_files = 512;
constexpr std::uintmax_t most_program_bytes = 64u << 20;  ///< of all files

/// The current context's vendor, renderer and version, a line each.
std::string driver_lines();
/// Of the stages' kinds and whole texts and the driver.
CacheKey program_key(const std::vector<std::pair<GLenum, std::string>>& stages, const std::string& driver);
/// Empty when there is no home for a cache.
std::filesystem::path program_file(const CacheKey& key);
std::string program_bytes(const CacheKey& key, const ProgramBinary& binary);
/// Of a file's bytes: nothing when damaged, of another key, or of a format that is not one of `formats`.
std::optional<ProgramBinary> parse_program(std::string_view bytes, const CacheKey& key,
                                           const std::vector<GLint>& formats);

/// A linked program of the current context; 0 when none is kept, or the driver refuses it.
GLuint kept_program(const CacheKey& key);
/// Keeps what was linked, where the driver gives its binary.
void keep_program(const CacheKey& key, GLuint program);
/// Forgets what this process keeps, not the files.
void forget_programs();

}  // namespace tetpbd
