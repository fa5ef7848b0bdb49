// Files in the user's cache folder: a head with magic, key and checksum, then content. A cache that cannot be
// read or written costs time, never an error.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace tetpbd {

using CacheKey = std::array<std::uint64_t, 2>;
using CacheMagic = std::array<char, 8>;  ///< what kind of content, and of which layout

/// $TETPBD_CACHE, else $XDG_CACHE_HOME/tetpbd, else ~/.cache/tetpbd; empty where there is none of these.
std::filesystem::path cache_folder();
CacheKey cache_key(std::string_view bytes);
/// 32 hexadecimal digits.
std::string cache_name(const CacheKey& key);

/// The head, then `content`.
std::string wrap_cached(const CacheMagic& magic, const CacheKey& key, std::string_view content);
/// The content, a part of `bytes`; nothing when it is damaged, cut short, or of another kind or key.
std::optional<std::string_view> unwrap_cached(std::string_view bytes, const CacheMagic& magic,
                                              const CacheKey& key);
/// All bytes of a file; nothing when it is not there or larger than `most`.
std::optional<std::string> read_cached(const std::filesystem::path& file, std::size_t most);
/// Makes the folder, then the file under a temporary name, then renames it. False where that fails.
bool write_cached(const std::filesystem::path& file, std::string bytes);
/// Removes the oldest files of a folder until it keeps both limits.
void bound_cache(const std::filesystem::path& folder, std::size_t most_files, std::uintmax_t most_bytes);

}  // namespace tetpbd
