// `tetpbd map`: over two settings at once, the error of a scene, and where it fails.
#include "app/lab/map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/bodies.h"
#include "app/commands.h"
#include "app/lab/auto_solver.h"
#include "app/lab/chart.h"
#include "app/lab/report.h"
#include "sim/error.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

const char* results =
    "finite,failed_at_step,motion_rms,motion_final,max_volume_loss_percent,tet_volume_max,ms_per_step,state_hash";

ordered_json cell_of(const Scene& scene, const std::shared_ptr<const Model>& model, Settings settings,
                     const std::string& x, const std::string& y, std::optional<Motion>& last, Film& film) {
  ordered_json row = {{"x", x}, {"y", y}};
  Scene own = scene;
  own.settings = settings;
  const long steps = duration_in_steps(own);
  if (!last || last->scene != scene_key(*model, settings)) last = answer_for(*model, settings, steps);
  MeasuredRun run;
  try {
    run = run_model(model, settings, steps, last, true, film.of(steps));
  } catch (const Error& error) {  // of this setting: its mode does not go so far
    for (const std::string& key : split(results, ',')) row[key] = nullptr;
    row["finite"] = false, row["refused"] = error.what();
    return row;
  }
  row.update(map_row(run));
  row["film"] = film.write();
  return row;
}

}  // namespace

std::optional<Motion> answer_for(const Model& model, const Settings& settings, long steps,
                                 const std::function<void(long)>& progress) {
  if (auto known = right_motion(model, settings); known && known->kept.back() >= steps) return known;
  if (!any_material(settings, compliant)) return rigid_motion(model, settings, steps);
  if (!has_forces(settings)) return std::nullopt;
  const ConstraintSystem system = build_constraints(model, settings);
  return find_motion({model, system, settings, model.inverse_masses}, steps, {}, {}, progress);
}

ordered_json map_row(const MeasuredRun& run) {
  const auto& found = run.errors.non_finite;
  const double nothing = std::nan("");
  const bool finite = run.errors.finite, motion = run.motion && finite;
  return {{"finite", finite},
          {"failed_at_step", found ? ordered_json(found->step) : ordered_json()},
          {"motion_rms", motion ? run.motion->rms : nothing},
          {"motion_final", motion ? run.motion->final : nothing},
          {"max_volume_loss_percent", finite ? run.errors.max_volume_loss_percent : nothing},
          {"tet_volume_max", finite && run.errors.last ? run.errors.last->tet_volume_max : nothing},
          {"ms_per_step", step_ms(run)},
          {"state_hash", hash_json(run.hash)}};
}

double map_percent(const ordered_json& row, bool motion) {
  return motion ? 100 * number(row, "motion_rms") : number(row, "max_volume_loss_percent");
}

std::vector<Settings> map_cells(const Settings& base, const Variation& x, const Variation& y) {
  if (x.row == y.row) throw Error("both axes are the same setting", x.row->name, "give another to one of them");
  const std::vector<Settings> cells = combine(base, {y, x});
  const std::size_t columns = x.values.size();
  for (std::size_t i = 0; i < cells.size(); ++i)
    check_settings(cells[i],
                   fmt::format("{} {}, {} {}", x.row->name, x.values[i % columns], y.row->name, y.values[i / columns]));
  return cells;
}

int run_map(const MapOptions& options) {
  const Variation x = parse_variation(options.x, "--x"), y = parse_variation(options.y, "--y");
  Sweep sweep{"map",
              "cell",
              split(std::string("x,y,") + results, ','),
              {"x", "y"},
              fmt::format("x:{} {}, y:{} {}, ", x.row->name, std::max<std::size_t>(12, x.row->name.size() + 3),
                          y.row->name, std::max<std::size_t>(12, y.row->name.size() + 3)) +
                  "finite 8, failed_at_step:failed 8, motion_rms:motion 12, "
                  "max_volume_loss_percent:loss-% 10, tet_volume_max:worst-tet 12, ms_per_step:ms 10",
              {}};
  ordered_json document = run_or_merge(sweep, {}, options.out, options.gpu, [&] {
    Scene scene = load_scene(options.scene, options.overrides);
    if (options.steps > 0) scene.duration = double(options.steps) * scene.settings.dt;
    const auto model = build_model(scene);
    for (const Parameter* row : {x.row, y.row})
      if (is_of_material(*row) && all_have_own_materials(scene.settings))
        throw Error("each body has a material of its own", row->name, "vary another setting, or leave theirs out");
    const auto varied = [&](const char* name) { return x.row->name == name || y.row->name == name; };
    if (varied("mode") || varied("substeps") || varied("iterations") || varied("omega")) scene.mode_open = false;
    choose_by_rule(scene, *model);
    note_unused(scene.settings, {}, options.overrides);
    sweep.facts["scene"] = scene.name, sweep.facts["mode"] = scene.settings.mode;
    sweep.facts["tets"] = model->rest.tets.size();
    sweep.facts["x"] = x.row->name, sweep.facts["y"] = y.row->name, sweep.facts["seconds"] = scene.duration;
    const auto last = std::make_shared<std::optional<Motion>>();
    for (const Settings& settings : map_cells(scene.settings, x, y))
      sweep.work.push_back([=, number = sweep.work.size()] {
        const std::size_t columns = x.values.size();
        Film film(scene, *model, options.out, number, columns * y.values.size());
        const std::string across = x.values[number % columns], up = y.values[number / columns];
        return std::vector{cell_of(scene, model, settings, across, up, *last, film)};
      });
  });
  print_table(sweep, document);
  write_sweep(sweep, options.out, document);
  const std::string svg = map_svg(document);
  write_svg(options.out / "map", svg);
  write_report(sweep, options.out, document, svg);
  return 0;
}

}  // namespace tetpbd
