// Pages: one HTML file with all that it shows inside it, so that no request leaves the machine.
#pragma once

#include <functional>
#include <vector>

#include "app/lab/sweep.h"
#include "app/scene.h"
#include "render/renderer.h"
#include "render/target.h"

namespace tetpbd {

std::string page(const std::string& title, const std::string& body);
std::string base64(const std::string& bytes);
/// A warning for a page of measurements; empty for a GPU.
std::string software_note(bool software);
/// A picture as text; nothing where the file is not there.
std::string data_uri(const std::filesystem::path& png);

struct PageRow {
  std::vector<std::string> cells;
  std::string film{};   ///< data_uri()
  bool marked = false;  ///< bold
};
/// Sorted by a click on a column's title. Where rows are `shown`, those under the cursor are shown beside the
/// figures, as are those that a picture's data-row or the address's #row=N names.
std::string html_table(const std::vector<std::string>& titles, const std::vector<PageRow>& rows, bool shown = false);

/// Small pictures of a run, side by side in one file, the end last: so many that a page of `rows` stays
/// small.
struct Film {
  static constexpr int width = 240, height = 180;
  std::filesystem::path folder, name;
  std::size_t frames, drawn = 0;
  Renderer renderer;
  Target target;
  Camera camera;
  Image strip;
  Film(const Scene& scene, const Model& model, const std::filesystem::path& out, std::size_t number, std::size_t rows);
  /// For run_model().
  std::function<void(const Sim&, long)> of(long steps);
  /// "films/0003.png", below `out`; null where nothing was drawn.
  ordered_json write();
};

/// NAME.html: `figures` (SVG), a row's settings, numbers and film beside them, and the table of rows.
void write_report(const Sweep& sweep, const std::filesystem::path& out, const ordered_json& document,
                  const std::string& figures);

}  // namespace tetpbd
