// What the head of a surface file says it holds, held against the bytes that are there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>

namespace tetpbd {

struct SurfaceClaims {
  std::optional<std::size_t> vertices, faces;
};

/// Reads the head of a PLY, OFF or binary STL. Throws Error when it claims more elements than the file's
/// bytes can hold, so that no reader allocates for them. A head it cannot read gives no claims: the reader
/// then says why.
SurfaceClaims read_surface_claims(const std::filesystem::path& file);

}  // namespace tetpbd
