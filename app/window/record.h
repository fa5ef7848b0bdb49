// Actions as lines of JSON, {"step": 12, "pin": 3}, so that they can be done again without a window. The lines are
// listed in docs/guide.md.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/window/action.h"
#include "sim/files.h"

namespace tetpbd {

struct RunOptions;
using nlohmann::ordered_json;

struct Record {
  GrowingFile file;
  long step = 0;        ///< of the lanes, as whoever reads the lines so far knows it
  bool shown = false;   ///< another moment is shown than the lines say
  ordered_json view{};  ///< how bodies look, as the lines say
  explicit Record(const std::filesystem::path& name) : file(name) {}
};

/// By name, as text; with `before` those that differ.
ordered_json settings_text(const Settings& settings, const Settings* before = nullptr);

/// Before it is done, for settings are written as they differ from those of now; none without a record, and of actions
/// that other lines tell: a scene is written as it is taken over, a moment once something goes on from it, a view after
/// a step.
std::optional<ordered_json> line_of(const Session& session, const Action& action);
/// What cannot be written is said and ends the record.
void write(Session& session, const ordered_json& line);
/// Writes what was done by itself.
void note(Session& session, const Action& action);
/// The scene, just loaded.
void note_scene(Session& session);
/// That another moment is shown, once something goes on from it.
void note_moment(Session& session);
/// The lanes have taken a step, or are somewhere else; and how they look, where that is new.
void note_step(Session& session);
/// Where it ends: the last step and the lanes' states. Throws Error.
void end_record(Session& session);
/// Of each lane, as text; null where the state is not finite, for when that is found depends on the machine.
ordered_json state_hashes(Session& session);

struct RecordLine {
  std::string where{};  ///< file:number
  ordered_json json{};
};
/// Throws Error for what is no record; what each line asks for is not checked.
std::vector<RecordLine> read_record(const std::filesystem::path& file);
/// What a line says is to be done to this session. Throws Error, or an exception of JSON.
Action read_action(const Session& session, const RecordLine& line);
/// `tetpbd run --replay`: does what a record says, and draws it. Throws Error (status 1) where states are
/// other than recorded.
int run_replay(const RunOptions& options);

}  // namespace tetpbd
