// Loads on vertices beside gravity: accelerations, pressure on faces, wind (method.md, "Loads").
#pragma once

#include "sim/gl/gpu.h"
#include "sim/gl/layout.h"
#include "sim/gl/pass.h"
#include "sim/model/constraints.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Sim;

/// Which loads act where: LoadMesh of shaders/loads.comp; empty without loads.
std::vector<glm::uvec4> lay_out_loads(const Model& model);

/// What a Sim has of loads, in modes of the GPU.
struct Loads {
  Buffer records, mesh, accelerations;
  Texture texture;  ///< of the accelerations
  Pass pass;
  explicit operator bool() const { return bool(pass); }
};
Loads make_loads(const Model& model);
/// Whether any is pressure or wind, which change within a step.
bool load_faces(const Model& model);
/// For a step: the factors over time; and before each substep, by number.
void write_loads(Sim& sim);
void find_loads(Sim& sim, int substep);

/// Records of attachments or fibres that have compliance, for kernels that ask for their energy.
std::vector<layout::HeldRecord> held_records(const ConstraintList& list, bool are_fibres);

/// What a Sim has of fibres, in modes of the GPU, once an activation has changed.
struct Activation {
  Buffer records, before;
  std::size_t count = 0;
  Pass pass;
  explicit operator bool() const { return bool(pass); }
};
Activation make_activation(const ConstraintSystem& system);

/// The same loads on the CPU.
struct LoadsAt {
  std::vector<layout::LoadRecord> records;  ///< with the factors of a time
  const std::vector<glm::uvec4>& mesh;
  /// m/s^2, of vertex i in a substep of h seconds; x(i) and v(i) are positions and velocities.
  template <class X, class V>
  glm::dvec3 acceleration(std::uint32_t i, const X& x, const V& v, double inverse_mass, double h) const;
};
std::vector<layout::LoadRecord> load_records(const Model& model, double time);

template <class X, class V>
glm::dvec3 LoadsAt::acceleration(std::uint32_t i, const X& x, const V& v, double inverse_mass, double h) const {
  const glm::uvec4& own = mesh[i];
  glm::dvec3 pull(0), force(0), blown(0);
  double rate = 0;
  for (std::size_t k = 0; k < records.size(); ++k)
    if ((own.x >> k & 1) && records[k].kind == LOAD_ACCELERATION) pull += glm::dvec3(records[k].vector);
  for (std::uint32_t f = own.y; f < own.z; ++f) {
    const glm::uvec4& face = mesh[f];
    const glm::dvec3 third = glm::cross(x(face.x) - x(i), x(face.y) - x(i)) / 6.0;
    const double area = glm::length(third);
    for (std::size_t k = 0; k < records.size(); ++k) {
      if (!(face.z >> k & 1)) continue;
      const double amount = double(records[k].amount);
      if (records[k].kind == LOAD_PRESSURE) force += amount * third;
      if (records[k].kind != LOAD_WIND || !(area > 0)) continue;
      const glm::dvec3 normal = third / area,
                       past = glm::dvec3(records[k].vector) - (v(i) + v(face.x) + v(face.y)) / 3.0;
      const double across = glm::dot(past, normal), resists = 0.5 * amount * std::abs(across) * area;
      blown += resists * across * normal;
      rate += resists;
    }
  }
  return pull + force * inverse_mass + blown * (inverse_mass / (1 + h * rate * inverse_mass));
}

}  // namespace tetpbd
