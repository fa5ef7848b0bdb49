// FNV-1a tells states, scenes and damaged files apart. It finds accidents, not attacks.
#pragma once

#include <cstdint>
#include <string_view>

namespace tetpbd {

constexpr std::uint64_t fnv_basis = 14695981039346656037ull;

/// `hash`: that of the bytes before these.
inline std::uint64_t hash_bytes(std::string_view bytes, std::uint64_t hash = fnv_basis) {
  for (const char c : bytes) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return hash;
}

/// Hashes the bits of a list of values, whose type must have no padding.
template <class List>
std::uint64_t hash_values(const List& values, std::uint64_t hash = fnv_basis) {
  return hash_bytes({reinterpret_cast<const char*>(std::data(values)), std::size(values) * sizeof *std::data(values)},
                    hash);
}

}  // namespace tetpbd
