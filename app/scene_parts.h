// What a scene says of bodies together and of what acts on them: attachments, forces, fibres.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sim/model/model.h"

namespace tetpbd {

/// Fractions of a body's bounding box, in the mesh's own frame.
struct PartBox {
  glm::dvec3 low{0}, high{1};
};

/// Throws Error where nothing can be inside.
void check_box(const PartBox& box, const std::string& where, const std::string& file);

struct AttachmentDescription {
  std::size_t body = 0, to = 0;
  std::optional<PartBox> box{};
  std::optional<double> within{};  ///< m; none: half an edge of the other's surface
  double stiffness = 0;            ///< N/m of all vertices together; 0: hard
  std::optional<double> break_force{};
  bool closes = false;
};

struct ForceDescription {
  std::optional<std::size_t> body{};  ///< none: all
  std::optional<PartBox> box{};
  std::string key;       ///< acceleration, force, pressure or wind
  glm::dvec3 vector{0};  ///< m/s^2, N or m/s
  double amount = 0;     ///< Pa; of wind, drag times kg/m^3
  FactorOverTime factors{};
};

struct FibresDescription {
  std::optional<PartBox> box{};
  glm::dvec3 along{1, 0, 0};  ///< in the mesh's own frame
  double stiffness = 0;       ///< Pa
  FactorOverTime activation{};
};

/// What check() of scene_file.cpp allows: {"attachments", "forces"} of a scene, and the "fibres" of a body.
nlohmann::json parts_schema();
nlohmann::json fibres_schema();

/// Throw Error naming `file`; `names` are those of the bodies.
AttachmentDescription read_attachment(const nlohmann::json& value, const std::vector<std::string>& names,
                                      const std::string& where, const std::string& file);
ForceDescription read_force(const nlohmann::json& value, const std::vector<std::string>& names,
                            const std::string& where, const std::string& file);
FibresDescription read_fibres(const nlohmann::json& value, const std::string& where, const std::string& file);
nlohmann::json part_json(const AttachmentDescription& attachment);
nlohmann::json part_json(const ForceDescription& force);
nlohmann::json part_json(const FibresDescription& fibres);

/// A body that is about to be added to the model.
struct NewBody {
  Model& model;
  const TetMesh& mesh;
  glm::dmat3 turn;                                         ///< from the mesh's own frame
  std::function<bool(std::size_t, const PartBox&)> is_in;  ///< whether a box holds a vertex of the mesh
};
/// Chooses the vertices and tets of the next body on which these act.
void choose_parts(const NewBody& body, const std::vector<AttachmentDescription>& attachments,
                  const std::vector<ForceDescription>& forces, const std::vector<FibresDescription>& fibres);
/// Once all bodies are where they start: attaches them, and finds how fast forces accelerate. Throws Error naming the
/// scene where something holds nothing.
void finish_parts(Model& model, const std::vector<AttachmentDescription>& attachments,
                  const std::vector<ForceDescription>& forces, const Settings& settings, const std::string& scene);

}  // namespace tetpbd
