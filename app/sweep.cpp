#include "app/sweep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "app/files.h"
#include "app/run_loop.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

const ordered_json nothing;

// A line of a table; no row: the titles.
void print_row(const std::string& columns, const ordered_json& row) {
  std::istringstream words(columns);
  std::string line, name;
  for (int width = 0; words >> name >> width; words.ignore(1)) {
    const std::size_t colon = name.find(':');
    const std::string field = row.is_null() ? name.substr(colon == name.npos ? 0 : colon + 1)
                                            : text_of(cell(row, name.substr(0, colon)));
    line += width < 0 ? fmt::format("{:<{}}", field, -width) : fmt::format("{:>{}}", field, width);
  }
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

std::string name_of(const Sweep& sweep, const ordered_json& row) {
  std::string name;
  for (std::size_t c = 0; c < sweep.identity; ++c)
    name += fmt::format("{}{} {}", c ? ", " : "", sweep.columns[c], text_of(row.at(sweep.columns[c])));
  return name;
}

// Whatever stands in the file, what follows finds the keys and types it looks for.
ordered_json read_part(const Sweep& sweep, const std::filesystem::path& file) {
  try {
    std::ifstream stream(file);
    const ordered_json part = ordered_json::parse(stream);
    for (const char* key : {"gl_renderer", "gl_version", "software"}) part.at("device").at(key);
    for (const auto& [key, fact] : sweep.facts.items()) part.at(key).get<double>();
    for (const char* key : {"combinations", "shards"}) part.at(key).get<double>();
    part.at("shard").get<std::vector<int>>();
    csv_text(sweep.columns, part.at("rows"));
    return part;
  } catch (const ordered_json::exception&) {
    throw Error("not a finished " + sweep.title, file.string(), "run that shard again");
  }
}

ordered_json merged(const Sweep& sweep, const std::vector<std::filesystem::path>& folders) {
  ordered_json all;
  std::set<std::string> names;
  for (const auto& folder : folders) {
    const ordered_json part = read_part(sweep, folder / (sweep.name + ".json"));
    for (const auto& row : part["rows"])
      if (!names.insert(name_of(sweep, row)).second)
        throw Error("a setting is in two of these",
                    fmt::format("{}: {}", folder.string(), name_of(sweep, row)), "name each folder once");
    if (all.is_null()) {
      all = part;
      continue;
    }
    // Shards of one command, or whole sweeps: other modes and other numbers of substeps.
    const bool whole = part["shards"] == 1 && all["shards"] == 1;
    for (const auto& [key, value] : all.items())
      if (key != "rows" && key != "shard" && !(whole && key == "combinations") &&
          (!part.contains(key) || part[key] != value))
        throw Error("these shards differ", fmt::format("'{}' in {}", key, folder.string()),
                    "merge runs of one command on one device");
    if (whole)
      all["combinations"] = all["combinations"].get<long>() + part["combinations"].get<long>();
    else
      all["shard"].insert(all["shard"].end(), part["shard"].begin(), part["shard"].end());
    all["rows"].insert(all["rows"].end(), part["rows"].begin(), part["rows"].end());
  }
  const auto rows = all["rows"].size();
  if (const auto wanted = all["combinations"].get<std::size_t>(); rows < wanted)
    print_error(fmt::format("tetpbd: only {} rows of {}: shards {} of {}\n", rows, wanted,
                            all["shard"].dump(), all["shards"].dump()));
  return all;
}

ordered_json measured(const Sweep& sweep, const Shards& part) {
  ordered_json document = sweep.facts;
  document["combinations"] = sweep.combinations;
  document["shard"] = {part.shard};
  document["shards"] = part.shards;
  ordered_json& rows = document["rows"] = ordered_json::array();
  Progress progress(sweep.title, long(sweep.combinations) / part.shards);
  const auto stride = std::size_t(part.shards);
  for (std::size_t i = std::size_t(part.shard - 1); i < sweep.combinations; i += stride) {
    const std::vector<ordered_json> made = sweep.make(i);
    if (interrupted()) break;  // they are nothing: what they are of is not whole
    for (const ordered_json& row : made) {
      rows.push_back(row);
      if (sweep.print_each) print_row(sweep.table, row);
    }
    progress.update(long(i / stride) + 1);
  }
  return document;
}

}  // namespace

std::vector<Settings> combinations(const Settings& base, const Axes& axes) {
  std::vector<Settings> all{base};
  const auto vary = [&](const auto& values, const auto& set) {
    if (values.empty()) return;
    std::vector<Settings> varied;
    for (const Settings& settings : all)
      for (const auto& value : values) {
        varied.push_back(settings);
        set(varied.back(), value);
      }
    all = varied;
  };
  vary(axes.constraint_sets, [](Settings& s, std::string set) {
    std::replace(set.begin(), set.end(), '+', ',');
    set_parameter(s, *find_parameter("constraints"), set, "--constraint-sets");
  });
  vary(axes.modes, [](Settings& s, const std::string& mode) { set_mode(s, mode, "--modes"); });
  vary(axes.omegas, [](Settings& s, double omega) { s.omega = omega; });
  vary(axes.iterations, [](Settings& s, int iterations) { s.iterations = iterations; });
  vary(axes.substeps, [](Settings& s, int substeps) { s.substeps = substeps; });
  return all;
}

ordered_json run_sweep(const Sweep& sweep, const Shards& shards) {
  const ordered_json document = shards.merge.empty() ? measured(sweep, shards) : merged(sweep, shards.merge);
  if (!document["rows"].empty()) return document;
  if (interrupted()) throw Error("interrupted", "before the first row", "nothing was written", 1);
  throw Error("nothing to run", fmt::format("--shard {}/{}", shards.shard, shards.shards),
              "name combinations that there are, and no more shards than those");
}

void print_table(const std::string& columns, const ordered_json& rows) {
  print_row(columns, nothing);
  for (const auto& row : rows) print_row(columns, row);
}

std::string csv_text(const std::vector<std::string>& columns, const ordered_json& rows) {
  std::string csv = fmt::format("{}\n", fmt::join(columns, ","));
  for (const auto& row : rows) {
    std::vector<std::string> fields;
    for (const std::string& column : columns) {
      const ordered_json& value = cell(row, column);
      fields.push_back(value.is_string()         ? csv_field(value.get<std::string>())
                       : value.is_null()         ? ""
                       : value.is_number_float() ? fmt::format("{:.7g}", value.get<double>())
                                                 : value.dump());
    }
    csv += fmt::format("{}\n", fmt::join(fields, ","));
  }
  return csv;
}

int write_sweep(const Sweep& sweep, const std::filesystem::path& folder, const ordered_json& document) {
  const std::filesystem::path csv = folder / (sweep.name + ".csv");
  write_file(folder / (sweep.name + ".json"), json_text(document, 1) + "\n");
  write_file(csv, csv_text(sweep.columns, document["rows"]));
  fmt::print("{}\n", csv.string());
  if (interrupted())
    throw Error("interrupted", fmt::format("after {} rows", document["rows"].size()),
                "what was finished is written", 1);
  const auto finite = [](const ordered_json& row) { return row["finite"] == true; };
  return std::ranges::all_of(document["rows"], finite) ? 0 : 1;
}

const ordered_json& cell(const ordered_json& row, const std::string& key) {
  const ordered_json& value = row.at(key);
  if (value.is_structured()) return value.at("median") == 0 ? nothing : cell(value, "median");
  return value.is_number() && !std::isfinite(value.get<double>()) ? nothing : value;
}

double number(const ordered_json& row, const char* key) {
  const ordered_json& value = cell(row, key);
  return value.is_number() ? value.get<double>() : std::nan("");
}

std::string text_of(const ordered_json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_number_float()) return fmt::format("{:.4g}", value.get<double>());
  return value.is_null() ? "-" : value.dump();
}

ordered_json device_json(const Capabilities& device) {
  return {{"gl_renderer", device.renderer},
          {"gl_vendor", device.vendor},
          {"gl_version", device.version},
          {"software", device.software}};
}

void print_device(const ordered_json& device) {
  fmt::print("{}{}\n", text_of(device["gl_renderer"]),
             device["software"] == true ? ": a SOFTWARE renderer on the CPU. These are not a GPU's numbers."
                                        : ", OpenGL " + text_of(device["gl_version"]));
}

}  // namespace tetpbd
