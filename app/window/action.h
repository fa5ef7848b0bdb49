// What is done to the simulation. The window emits an action, perform() does it, the record writes it, a replay
// performs it again and undo takes it back; nothing else changes what is simulated.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "app/scene.h"
#include "render/frame.h"

namespace tetpbd {

struct Session;

namespace action {

/// A scene in place of all there is; without settings it solves as it asks for. `keep`: obstacles stay, and what a
/// setting goes back to.
struct OpenScene {
  std::string name;
  SceneOverrides overrides{};
  std::optional<Settings> settings{};
  bool keep = false, keep_camera = false;
};
/// One lane for each of these settings, all from the start.
struct StartLanes {
  std::vector<Settings> lanes;
};
/// The settings of one lane; of those that lanes share, all get what changes.
struct Set {
  std::size_t lane;
  Settings settings;
};
/// In all lanes, which go on from where they are; where one moves by itself in another way than before, from the start.
struct SetObstacles {
  std::vector<Obstacle> obstacles;
};
struct OpenState {
  std::filesystem::path file;
};
struct Reset {};
struct GoBack {};  ///< to the last good state
/// Pins a vertex and what is around it (Hold), as they are in that lane.
struct Catch {
  std::uint32_t vertex;
  std::size_t lane;
  double radius;  ///< part of the size
};
struct Lead {
  std::uint32_t vertex;
  glm::dvec3 to;  ///< m
};
struct Release {};
struct Pin {
  std::uint32_t vertex;
};
struct Unpin {
  std::uint32_t vertex;
};
struct Go {
  long step;  ///< to the moment kept of it, or the nearest
};
struct SetSpeed {
  int halvings;
};
struct SetView {
  ViewOptions view;
  bool overlaid, ghost;
};
struct SetCamera {
  Camera camera;
};

}  // namespace action

using Action = std::variant<action::OpenScene, action::StartLanes, action::Set, action::SetObstacles, action::OpenState,
                            action::Reset, action::GoBack, action::Catch, action::Lead, action::Release, action::Pin,
                            action::Unpin, action::Go, action::SetSpeed, action::SetView, action::SetCamera>;

/// Ends the step under way, does it, writes it to the record and keeps it for undo. Throws what goes wrong; then
/// settings and obstacles are as before.
void perform(Session& session, const Action& action);
/// The same, once the step under way has ended if the action needs that; what goes wrong becomes a message.
void emit(Session& session, const Action& action);

/// What the user made, which undo brings back.
struct Made {
  std::vector<Settings> lanes;
  std::vector<Obstacle> obstacles;
  std::vector<std::uint32_t> pins;
};
struct Change {
  Made before, after;
};
struct Changes {
  std::vector<Change> past, future;
  bool open = false;    ///< what changes now belongs to the last change, as long as a slider is held
  bool paused = false;  ///< nothing is kept: a change is being taken back
};
/// Takes the last change back: of settings, materials, lanes, obstacles or pins.
void undo(Session& session);
void redo(Session& session);

}  // namespace tetpbd
