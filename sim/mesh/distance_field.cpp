#include "sim/mesh/distance_field.h"

#include "sim/error.h"

namespace tetpbd {

DistanceField distance_field(const SurfaceMesh&, int, const std::string& source) {
  throw Error("no distances of meshes in this build", source, "build with OpenVDB");
}

}  // namespace tetpbd
