// A record done again without a window, and drawn.
#include "app/commands.h"
#include "app/files.h"
#include "app/window/record.h"
#include "app/window/session.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

/// A video in the record's own time.
struct Projector {
  static constexpr int rate = 30;  // frames a second
  Target target;
  std::optional<Video> video{};
  double owed = 1.0 / rate;  ///< s of the video, not yet drawn

  void draw(Session& s) {
    for (; video && owed >= 1.0 / rate; owed -= 1.0 / rate) {
      draw_lanes(s, target);
      video->add(read_rgba(target));
      follow_bodies(s, 1.0 / rate);
    }
  }
};

void step_to(Session& s, long until, const std::string& where, Projector& projector, long& steps) {
  while (!s.loaded.lanes.empty() && steps_of(s.loaded.lanes) < until && !interrupted()) {
    const long before = steps_of(s.loaded.lanes);
    projector.draw(s);
    step_lanes(s);
    projector.owed += s.loaded.sim().settings.dt / s.clock.speed();
    if (steps_of(s.loaded.lanes) == before)
      throw Error(fmt::format("no lane comes to step {}", until), where, "no state is finite any more", 1);
    ++steps;
  }
  if (interrupted()) throw Error("interrupted", where, "there is no video", 1);
}

void do_again(Session& s, const RecordLine& line) {
  const Action action = read_action(s, line);
  if (std::holds_alternative<action::Release>(action) && !s.hold) return;  // let go by what was done before
  perform(s, action);
  const auto* go = std::get_if<action::Go>(&action);
  if (go && steps_of(s.loaded.lanes) != go->step)
    throw Error(fmt::format("step {} is not known", go->step), line.where, "go back only");
  for (const Message& message : s.messages)
    if (message.error) throw Error(message.text, line.where, "so it cannot be done again", 1);
}

}  // namespace

int run_replay(const RunOptions& options) {
  const std::vector<RecordLine> lines = read_record(options.replay);
  make_output_folder(options.out);
  HeadlessContext context(options.gpu);
  Session s;
  s.gl = context.capabilities();
  s.playing = s.measuring = false;
  s.view = options.view;
  s.aspect = float(options.size[0]) / float(options.size[1]);
  s.timeline.budget = std::size_t(4) << 30;
  s.timeline.wanted.emplace();
  for (const RecordLine& line : lines)
    if (const auto go = line.json.value("go", ordered_json()); go.is_number_integer())
      s.timeline.wanted->insert(go.get<long>());

  Projector projector{make_target(options.size[0], options.size[1], options.samples)};
  if (!options.video.empty()) projector.video.emplace(options.video, options.size[0], options.size[1], Projector::rate);
  long steps = 0;  // in all
  ordered_json recorded;
  for (const RecordLine& line : lines) {
    try {
      step_to(s, line.json["step"], line.where, projector, steps);
      if (line.json.contains("end"))
        recorded = line.json["end"];
      else
        do_again(s, line);
    } catch (const ordered_json::exception& problem) {
      throw Error("no line of a record", line.where, problem.what());
    }
  }
  projector.draw(s);
  if (projector.video) projector.video->close();

  const ordered_json found = state_hashes(s);
  ordered_json result = {{"record", options.replay.string()}, {"steps", steps}};
  for (std::size_t i = 0; i < s.loaded.lanes.size(); ++i) {
    const Lane& lane = s.loaded.lanes[i];
    result["lanes"].push_back({{"mode", lane.sim.settings.mode}, {"step", lane.sim.steps}, {"state_hash", found[i]}});
    fmt::print("{}: step {}, state {}\n", describe(lane), lane.sim.steps, json_text(found[i], -1));
  }
  result["as_recorded"] = recorded.is_null() ? ordered_json() : ordered_json(recorded == found);
  write_file(options.out / "replay.json", json_text(result, 2) + "\n");
  if (!recorded.is_null() && recorded != found)
    throw Error("other states than recorded", options.replay.string(),
                "was it recorded on this machine and with this version?", 1);
  return 0;
}

}  // namespace tetpbd
