// What is done in the window, a line of JSON each, so that it can be done again without one:
// {"step": 12, "pin": 3}. The lines are listed in docs/guide.md.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "sim/files.h"
#include "sim/model/settings.h"

namespace tetpbd {

struct Session;
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

/// Before it is done. What cannot be written is said and ends the record.
void note(Session& session, const ordered_json& action);
/// The scene, just loaded.
void note_scene(Session& session);
/// That another moment is shown, once something goes on from it.
void note_moment(Session& session);
void note_camera(Session& session);
/// The lanes have taken a step, or are somewhere else; and how they look, where that is new.
void note_step(Session& session);
/// Where it ends: the last step and the lanes' states. Throws Error.
void end_record(Session& session);

struct RecordLine {
  std::string where{};  ///< file:number
  ordered_json action{};
};
/// Throws Error for what is no record; what each line asks for is not checked.
std::vector<RecordLine> read_record(const std::filesystem::path& file);
/// `tetpbd run --replay`: does what a record says, and draws it. Throws Error (status 1) where states are
/// other than recorded.
int run_replay(const RunOptions& options);

}  // namespace tetpbd
