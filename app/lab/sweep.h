// A sweep: rows of numbers, as one for each combination of settings (vary.h), made by one process or dealt out to
// several and merged; as a table on the terminal, as CSV and as JSON.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim/gl/gpu.h"
#include "sim/model/settings.h"

namespace tetpbd {

using nlohmann::ordered_json;

/// A row is an object with the columns' keys: text, true or false, numbers (written as null where not
/// finite), or {"median": number, ...}.
struct Sweep {
  std::string name, title;            ///< of its files; on the progress bar
  std::vector<std::string> columns;   ///< of NAME.csv
  std::vector<std::string> identity;  ///< keys that tell rows apart
  std::string table;                  ///< columns on the terminal, each with its width: "mode -18, substeps:sub 6"
  ordered_json facts;                 ///< what all shards have in common: "device", numbers
  std::vector<std::function<std::vector<ordered_json>()>> work{};  ///< makes a combination's rows
  bool print_each = false;                                         ///< when they are there
};
struct Shards {
  int shard = 1, shards = 1;                   ///< this process makes shard, shard + shards, ...
  std::vector<std::filesystem::path> merge{};  ///< folders of finished shards, instead
};

/// The facts, "combinations", "shard", "shards" and "rows", those that were finished if interrupted; where
/// `out` names a folder, NAME.json and NAME.csv are there as rows finish. Throws Error if there are none.
ordered_json run_sweep(const Sweep& sweep, const Shards& shards = {}, const std::filesystem::path& out = {});
/// Of what `add` gives the sweep in a context of its own, which is among the facts; or the shards to merge.
ordered_json run_or_merge(Sweep& sweep, const Shards& shards, const std::filesystem::path& out, int gpu,
                          const std::function<void()>& add);
struct TableColumn {
  std::string key, title;
  int width;
};
std::vector<TableColumn> table_columns(const Sweep& sweep);
/// The device, the table's head, the rows so far.
void print_table(const Sweep& sweep, const ordered_json& document);
/// Writes NAME.json and NAME.csv and says where. The exit status: 1 if a row is not finite, else 0. Throws
/// Error if interrupted.
int write_sweep(const Sweep& sweep, const std::filesystem::path& folder, const ordered_json& document);

/// What a row has under a key: of several measurements the median, where a time of 0 is none.
const ordered_json& cell(const ordered_json& row, const std::string& key);
/// Nothing for null and what is not finite.
std::string text_of(const ordered_json& value, int digits = 4);
/// NaN where it is no number.
double number(const ordered_json& row, const char* key);
/// Column names, then a line a row.
std::string csv_text(const std::vector<std::string>& columns, const ordered_json& rows);
/// The device as all files name it.
ordered_json device_json(const Capabilities& device);

}  // namespace tetpbd
