#include "app/scene_parts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/obstacles.h"
#include "sim/contact/surfaces.h"
#include "sim/error.h"
#include "sim/gl/layout.h"
#include "sim/model/attachments.h"
#include "sim/model/did_you_mean.h"

namespace tetpbd {

using nlohmann::json;

namespace {

constexpr const char* force_keys[] = {"acceleration", "force", "pressure", "wind"};

[[noreturn]] void refuse(const std::string& what, const std::string& file) {
  throw Error(what, file, "see docs/guide.md");
}

// A body by its number, or by a name that no other has.
std::size_t body_named(const json& value, const std::vector<std::string>& names, const std::string& where,
                       const std::string& file) {
  if (value.is_number_integer()) {
    const auto number = value.get<long>();
    if (number >= 0 && number < std::ssize(names)) return std::size_t(number);
  } else if (value.is_string()) {
    const auto found = std::ranges::find(names, value.get<std::string>());
    const auto count = std::ranges::count(names, value.get<std::string>());
    if (count == 1) return std::size_t(found - names.begin());
    if (count > 1) refuse(fmt::format("'{}' names {} bodies: give a number", where, count), file);
    throw Error(fmt::format("'{}' names no body; there are {}", where, fmt::join(names, ", ")), file,
                did_you_mean(value.get<std::string>(), names) + "see docs/guide.md");
  }
  refuse(fmt::format("'{}' must be the name of a body, or its number from 0 to {}", where, names.size() - 1), file);
}

std::optional<PartBox> read_box(const json& value, const std::string& where, const std::string& file) {
  if (!value.contains("low") && !value.contains("high")) return std::nullopt;
  PartBox box;
  box.low = value.value("low", box.low), box.high = value.value("high", box.high);
  check_box(box, where, file);
  return box;
}

// Points over time, each a number under `key`.
FactorOverTime read_factors(const json& value, const char* key, const std::string& where, const std::string& file) {
  FactorOverTime factors;
  for (const json& point : value) {
    const double time = point.value("time", 0.0);
    if (!factors.empty() && !(time > factors.back().first))
      refuse(fmt::format("'{}.{}.time' must be later than the one before", where, factors.size()), file);
    factors.emplace_back(time, point.value(key, 0.0));
  }
  return factors;
}

json factors_json(const FactorOverTime& factors, const char* key) {
  json list = json::array();
  for (const auto& [time, factor] : factors) list.push_back({{"time", time}, {key, factor}});
  return list;
}

void put_box(json& value, const std::optional<PartBox>& box) {
  if (box) value["low"] = box->low, value["high"] = box->high;
}

json points_schema(const char* key, double most) {
  return {{"least", 1},
          {"most", 1000},
          {"of", fmt::format("points {{\"time\": s, \"{}\": number}}", key)},
          {"each", {{"time", {0, 1e9}}, {key, {-most, most}}}}};
}

json box_schema() { return {{"low", {{"three", {-1, 2}}}}, {"high", {{"three", {-1, 2}}}}}; }

}  // namespace

void check_box(const PartBox& box, const std::string& where, const std::string& file) {
  if (glm::any(glm::greaterThan(box.low, box.high)))
    refuse(fmt::format("'{}' has a \"low\" above its \"high\", so that nothing is inside", where), file);
}

json parts_schema() {
  json attachment = box_schema(), force = box_schema();
  attachment.update({{"body", nullptr},
                     {"to", nullptr},
                     {"within", {1e-9, 1e6}},
                     {"stiffness", {1e-9, 1e15}},
                     {"break_force", {1e-12, 1e15}},
                     {"closes", "true or false"}});
  force.update({{"body", nullptr},
                {"pressure", {-1e12, 1e12}},
                {"drag", {0, 100}},
                {"air_density", {0, 1e5}},
                {"factors", points_schema("factor", 1e6)}});
  for (const char* key : {"acceleration", "force", "wind"}) force[key] = {{"three", {-1e9, 1e9}}};
  return {{"attachments", {{"least", 0}, {"most", 1000}, {"of", "at most 1000 attachments"}, {"each", attachment}}},
          {"forces",
           {{"least", 0}, {"most", MAX_LOADS}, {"of", fmt::format("at most {} forces", MAX_LOADS)}, {"each", force}}}};
}

json fibres_schema() {
  json fibres = box_schema();
  json points = points_schema("activation", 1);
  points["each"]["activation"] = {0, 0.9};
  fibres.update({{"along", {{"three", {-1e6, 1e6}}}}, {"stiffness", {1e-6, 1e12}}, {"activation", points}});
  return {{"least", 0},
          {"most", MAX_ACTIVATIONS},
          {"of", fmt::format("at most {} bundles of fibres", MAX_ACTIVATIONS)},
          {"each", fibres}};
}

AttachmentDescription read_attachment(const json& value, const std::vector<std::string>& names,
                                      const std::string& where, const std::string& file) {
  AttachmentDescription a;
  for (const auto& [key, body] : {std::pair("body", &a.body), std::pair("to", &a.to)}) {
    if (!value.contains(key)) refuse(fmt::format("'{}' needs a \"body\" and what it is attached \"to\"", where), file);
    *body = body_named(value[key], names, fmt::format("{}.{}", where, key), file);
  }
  if (a.body == a.to) refuse(fmt::format("'{}' attaches body '{}' to itself", where, names[a.body]), file);
  a.box = read_box(value, where, file);
  if (value.contains("within")) a.within = value["within"].get<double>();
  a.stiffness = value.value("stiffness", 0.0), a.closes = value.value("closes", false);
  if (value.contains("break_force")) a.break_force = value["break_force"].get<double>();
  return a;
}

ForceDescription read_force(const json& value, const std::vector<std::string>& names, const std::string& where,
                            const std::string& file) {
  ForceDescription f;
  for (const char* key : force_keys)
    if (value.contains(key)) {
      if (!f.key.empty()) refuse(fmt::format("'{}' has both \"{}\" and \"{}\"", where, f.key, key), file);
      f.key = key;
    }
  if (f.key.empty()) refuse(fmt::format("'{}' needs one of \"{}\"", where, fmt::join(force_keys, "\", \"")), file);
  if (value.contains("body")) f.body = body_named(value["body"], names, where + ".body", file);
  f.box = read_box(value, where, file);
  if (f.key == "pressure")
    f.amount = value["pressure"].get<double>();
  else
    f.vector = value[f.key].get<glm::dvec3>();
  constexpr double of_air = 1.2;  // kg/m^3
  if (f.key == "wind") f.amount = value.value("drag", 1.0) * value.value("air_density", of_air);
  if (value.contains("factors")) f.factors = read_factors(value["factors"], "factor", where + ".factors", file);
  return f;
}

FibresDescription read_fibres(const json& value, const std::string& where, const std::string& file) {
  FibresDescription f;
  f.box = read_box(value, where, file);
  f.along = value.value("along", f.along);
  if (!(glm::length(f.along) > 0)) refuse(fmt::format("'{}.along' has no direction", where), file);
  if (!value.contains("stiffness")) refuse(fmt::format("'{}' needs a \"stiffness\", in Pa", where), file);
  f.stiffness = value["stiffness"].get<double>();
  if (value.contains("activation"))
    f.activation = read_factors(value["activation"], "activation", where + ".activation", file);
  return f;
}

json part_json(const AttachmentDescription& a) {
  json result = {{"body", a.body}, {"to", a.to}};
  put_box(result, a.box);
  if (a.within) result["within"] = *a.within;
  if (a.stiffness > 0) result["stiffness"] = a.stiffness;
  if (a.break_force) result["break_force"] = *a.break_force;
  if (a.closes) result["closes"] = true;
  return result;
}

json part_json(const ForceDescription& f) {
  json result = json::object();
  if (f.body) result["body"] = *f.body;
  put_box(result, f.box);
  if (f.key == "pressure")
    result["pressure"] = f.amount;
  else
    result[f.key] = f.vector;
  if (f.key == "wind") result["drag"] = f.amount, result["air_density"] = 1;
  if (!f.factors.empty()) result["factors"] = factors_json(f.factors, "factor");
  return result;
}

json part_json(const FibresDescription& f) {
  json result = {{"along", f.along}, {"stiffness", f.stiffness}};
  put_box(result, f.box);
  if (!f.activation.empty()) result["activation"] = factors_json(f.activation, "activation");
  return result;
}

void choose_parts(const NewBody& body, const std::vector<AttachmentDescription>& attachments,
                  const std::vector<ForceDescription>& forces, const std::vector<FibresDescription>& fibres) {
  Model& model = body.model;
  const std::size_t number = model.bodies.size(), base = model.positions.size();
  std::vector<char> on_surface(body.mesh.positions.size());
  for (const Triangle& t : body.mesh.surface)
    for (const std::uint32_t v : t) on_surface[v] = 1;
  const auto choose = [&](std::vector<std::uint32_t>& to, const std::optional<PartBox>& box, bool surface_alone) {
    for (std::size_t v = 0; v < on_surface.size(); ++v)
      if ((on_surface[v] || !surface_alone) && (!box || body.is_in(v, *box))) to.push_back(std::uint32_t(base + v));
  };
  model.attachments.resize(attachments.size()), model.loads.resize(forces.size());
  for (std::size_t n = 0; n < attachments.size(); ++n)
    if (attachments[n].body == number) choose(model.attachments[n].vertices, attachments[n].box, true);
  for (std::size_t n = 0; n < forces.size(); ++n)
    if (forces[n].body.value_or(number) == number) choose(model.loads[n].vertices, forces[n].box, false);
  for (const FibresDescription& f : fibres) {
    Fibres& made = model.fibres.emplace_back();
    made.direction = glm::normalize(body.turn * f.along), made.stiffness = f.stiffness, made.activation = f.activation;
    for (std::size_t t = 0; t < body.mesh.tets.size(); ++t) {
      const auto inside = [&](std::uint32_t v) { return !f.box || body.is_in(v, *f.box); };
      if (std::ranges::count_if(body.mesh.tets[t], inside) >= 3)  // most of it
        made.tets.push_back(std::uint32_t(model.rest.tets.size() + t));
    }
  }
}

void finish_parts(Model& model, const std::vector<AttachmentDescription>& attachments,
                  const std::vector<ForceDescription>& forces, const Settings& settings, const std::string& scene) {
  std::vector<double> offsets;  // that surfaces keep by contact
  if (settings.contact != "none" && std::ranges::any_of(attachments, &AttachmentDescription::closes))
    offsets = lay_out_surfaces(model, settings.contact_distance).offsets;
  for (std::size_t n = 0; n < attachments.size(); ++n) {
    Attachment& made = model.attachments[n];
    const AttachmentDescription& a = attachments[n];
    made.body = a.body, made.to = a.to, made.stiffness = a.stiffness, made.break_force = a.break_force;
    const Body& other = model.bodies[a.to];
    const double within = a.within.value_or(0.5 * mean_edge(model, other));
    const std::size_t chosen = made.vertices.size();
    const double nearest = attach(model, made, within, a.closes, offsets);
    if (made.vertices.empty())
      throw Error(chosen == 0 ? "an attachment holds no vertex" : "an attachment is too far away",
                  fmt::format("'attachments.{}' of {}", n, scene),
                  chosen == 0 ? "low and high are fractions of the body's bounding box: make it larger"
                              : fmt::format("'{}' is {:.3g} m from '{}': set \"within\" to more than that, or move it",
                                            model.bodies[a.body].name, nearest, other.name));
  }
  for (std::size_t n = 0; n < forces.size(); ++n) {
    Load& made = model.loads[n];
    const ForceDescription& f = forces[n];
    made.kind = f.key == "pressure" ? Load::Kind::pressure
                : f.key == "wind"   ? Load::Kind::wind
                                    : Load::Kind::acceleration;
    made.vector = f.vector, made.amount = f.amount, made.factors = f.factors;
    double mass = 0;
    for (const std::uint32_t v : made.vertices) mass += model.masses[v];
    if (made.vertices.empty())
      throw Error("a force acts on no vertex", fmt::format("'forces.{}' of {}", n, scene),
                  "low and high are fractions of the body's bounding box: make it larger");
    if (f.key == "force") made.vector /= mass;
  }
}

}  // namespace tetpbd
