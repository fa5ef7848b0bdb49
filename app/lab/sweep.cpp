#include "app/lab/sweep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>

#include "app/files.h"
#include "app/lab/run.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// A field of a CSV line: quoted where a comma, quote or line break stands in it.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? "\"\"" : std::string(1, c);
  return field + "\"";
}

// A line of a table; no row: the titles.
void print_row(const Sweep& sweep, const ordered_json& row) {
  std::string line;
  for (const auto& [key, title, width] : table_columns(sweep)) {
    const std::string field = row.is_null() ? title : text_of(cell(row, key));
    line += width < 0 ? fmt::format("{:<{}}", field, -width) : fmt::format("{:>{}}", field, width);
  }
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

// Shards of one command, or whole sweeps: of other settings, but otherwise the same. Whatever stands in the
// files, what follows finds the keys and types it looks for.
ordered_json merged(const Sweep& sweep, const std::vector<std::filesystem::path>& folders,
                    const std::filesystem::path& out) {
  ordered_json all;
  std::set<ordered_json> names;
  for (const auto& folder : folders) {
    const std::filesystem::path file = folder / (sweep.name + ".json");
    ordered_json part;
    try {
      part = ordered_json::parse(std::ifstream(file));
      for (const char* key : {"gl_renderer", "gl_version", "software"}) part.at("device").at(key);
      for (const auto& [key, fact] : sweep.facts.items()) part.at(key).get<double>();
      for (const char* key : {"combinations", "shards"}) part.at(key).get<double>();
      part.at("shard").get<std::vector<int>>();
      csv_text(sweep.columns, part.at("rows"));
    } catch (const ordered_json::exception&) {
      throw Error("not a finished " + sweep.title, file.string(), "run that shard again");
    }
    for (auto& row : part["rows"]) {
      if (row.contains("film") && row["film"].is_string())
        row["film"] = std::filesystem::proximate(folder / row["film"].get<std::string>(), out).string();
      ordered_json name;
      for (const std::string& key : sweep.identity) name.push_back(row[key]);
      if (!names.insert(name).second)
        throw Error("a setting is in two of these", folder.string() + ": " + name.dump(), "name each folder once");
    }
    if (all.is_null()) {
      all = part;
      continue;
    }
    const bool whole = part["shards"] == 1;
    for (const auto& [key, value] : part.items())
      if (key != "rows" && key != "shard" && !(whole && key == "combinations") && value != all[key])
        throw Error("these shards differ", folder.string(), "merge runs of one command on one device");
    for (const char* key : {"rows", "shard"}) all[key].insert(all[key].end(), part[key].begin(), part[key].end());
    if (whole) all["combinations"] = all["combinations"].get<long>() + part["combinations"].get<long>();
  }
  if (all["rows"].size() < all["combinations"])
    print_error(fmt::format("tetpbd: only {} rows of {}: shards {} of {}\n", all["rows"].size(),
                            all["combinations"].dump(), all["shard"].dump(), all["shards"].dump()));
  return all;
}

void write_rows(const Sweep& sweep, const std::filesystem::path& folder, const ordered_json& document) {
  write_file(folder / (sweep.name + ".json"), json_text(document, 1) + "\n");
  write_file(folder / (sweep.name + ".csv"), csv_text(sweep.columns, document["rows"]));
}

ordered_json measured(const Sweep& sweep, const Shards& part, const std::filesystem::path& out) {
  ordered_json document = sweep.facts;
  document["combinations"] = sweep.work.size();
  document["shard"] = {part.shard};
  document["shards"] = part.shards;
  ordered_json& rows = document["rows"] = ordered_json::array();
  constexpr double some = 5;  // s, between lines, and between files
  Progress progress(sweep.title, long(sweep.work.size()), false, sweep.print_each ? 1e9 : some);
  progress.update(0);
  auto written = progress.start;
  for (auto i = std::size_t(part.shard - 1); i < sweep.work.size(); i += std::size_t(part.shards)) {
    const std::vector<ordered_json> made = sweep.work[i]();
    if (interrupted()) break;  // they are nothing: what they are of is not whole
    for (const ordered_json& row : made) {
      rows.push_back(row);
      if (sweep.print_each) print_row(sweep, row);
    }
    progress.update(long(i) + 1);
    if (out.empty() || seconds_since(written) < some) continue;
    write_rows(sweep, out, document);
    written = std::chrono::steady_clock::now();
  }
  return document;
}

}  // namespace

ordered_json run_sweep(const Sweep& sweep, const Shards& shards, const std::filesystem::path& out) {
  const ordered_json document = shards.merge.empty() ? measured(sweep, shards, out) : merged(sweep, shards.merge, out);
  if (!document["rows"].empty()) return document;
  if (interrupted()) throw Error("interrupted", "before the first row", "nothing was written", 1);
  throw Error("nothing to run", fmt::format("--shard {}/{}", shards.shard, shards.shards),
              "name combinations that there are, and no more shards than those");
}

ordered_json run_or_merge(Sweep& sweep, const Shards& shards, const std::filesystem::path& out, int gpu,
                          const std::function<void()>& add) {
  make_output_folder(out);
  std::optional<HeadlessContext> context;
  if (shards.merge.empty()) {
    context.emplace(gpu);
    add();
    sweep.facts["device"] = device_json(context->capabilities());
  }
  return run_sweep(sweep, shards, out);
}

std::vector<TableColumn> table_columns(const Sweep& sweep) {
  std::vector<TableColumn> columns;
  std::istringstream words(sweep.table);
  std::string name;
  for (int width = 0; words >> name >> width; words.ignore(1)) {
    const std::size_t colon = name.find(':');
    columns.push_back({name.substr(0, colon), name.substr(colon == name.npos ? 0 : colon + 1), width});
  }
  return columns;
}

void print_table(const Sweep& sweep, const ordered_json& document) {
  const ordered_json& device = document["device"];
  fmt::print("{}{}\n", text_of(device["gl_renderer"]),
             device["software"] == true ? ": a SOFTWARE renderer on the CPU. These are not a GPU's numbers."
                                        : ", OpenGL " + text_of(device["gl_version"]));
  print_row(sweep, nullptr);
  if (document.contains("rows"))
    for (const auto& row : document["rows"]) print_row(sweep, row);
}

std::string csv_text(const std::vector<std::string>& columns, const ordered_json& rows) {
  std::string csv = fmt::format("{}\n", fmt::join(columns, ","));
  for (const auto& row : rows) {
    std::vector<std::string> fields;
    for (const std::string& column : columns) fields.push_back(csv_field(text_of(cell(row, column), 7)));
    csv += fmt::format("{}\n", fmt::join(fields, ","));
  }
  return csv;
}

int write_sweep(const Sweep& sweep, const std::filesystem::path& folder, const ordered_json& document) {
  write_rows(sweep, folder, document);
  fmt::print("{}\n", (folder / (sweep.name + ".csv")).string());
  if (interrupted())
    throw Error("interrupted", fmt::format("after {} rows", document["rows"].size()), "what was finished is written",
                1);
  const auto finite = [](const ordered_json& row) { return row["finite"] == true; };
  return std::ranges::all_of(document["rows"], finite) ? 0 : 1;
}

const ordered_json& cell(const ordered_json& row, const std::string& key) {
  static const ordered_json nothing;
  const ordered_json& value = row.at(key);
  if (!value.is_structured()) return value;
  return value.at("median") == 0 ? nothing : value.at("median");
}

double number(const ordered_json& row, const char* key) {
  const ordered_json& value = cell(row, key);
  return value.is_number() ? value.get<double>() : std::nan("");
}

std::string text_of(const ordered_json& value, int digits) {
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_number_float()) return value.is_null() ? "" : value.dump();
  return std::isfinite(value.get<double>()) ? fmt::format("{:.{}g}", value.get<double>(), digits) : "";
}

ordered_json device_json(const Capabilities& device) {
  return {{"gl_renderer", device.renderer},
          {"gl_vendor", device.vendor},
          {"gl_version", device.version},
          {"software", device.software}};
}

}  // namespace tetpbd
