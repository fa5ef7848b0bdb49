// Vertices that are attached to the surface of another body, as constraints of kind attach (method.md, "Attachments").
#pragma once

#include "sim/model/constraints.h"
#include "sim/model/model.h"

namespace tetpbd {

/// Attaches those of the attachment's vertices that start within `within` m of the surface of body `to`, and forgets
/// the others; returns the distance of the nearest. They keep their way from it, or with `closes` are pulled to it: as
/// near as `offsets`, m, by vertex, allow, or onto it where there are none.
double attach(const Model& model, Attachment& attachment, double within, bool closes,
              const std::vector<double>& offsets = {});
/// Adds the constraints of the model's attachments, without those that have `broken` where that is not empty.
void add_attachments(ConstraintSystem& system, const Model& model, const Settings& settings,
                     const std::vector<char>& broken = {});
/// N/m, of an attachment as the settings' mode solves it; 0: hard.
double attachment_stiffness(const Attachment& attachment, const Model& model, const Settings& settings);
/// N, by which an attachment of some stiffness pulls on its body where vertices are at these places.
glm::dvec3 attachment_force(const Attachment& attachment, double stiffness, const std::vector<glm::dvec3>& positions);

/// By body, whether it is in one piece and nothing is attached to it or loads it, so that it may move as a rigid one.
std::vector<char> loose_pieces(const Model& model, const ConstraintSystem& system);

/// Adds the constraints of fibres at rest.
void add_fibres(ConstraintSystem& system, const Model& model);
/// By number, the activations of the model's fibres in the step that begins at `time`, and in the one before it, which
/// at time 0 is none.
struct Activations {
  std::vector<float> now, before;
};
Activations activations_of_step(const Model& model, const Settings& settings, double time);
/// J, that fibres gain where activations change.
double activation_work(const ConstraintList& fibres, const Activations& activations,
                       const std::vector<glm::dvec3>& positions);

}  // namespace tetpbd
