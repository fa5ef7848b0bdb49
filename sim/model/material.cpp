#include "sim/model/material.h"

#include <algorithm>
#include <ranges>

#include "sim/model/attachments.h"

namespace tetpbd {

Lame lame(double young_modulus, double poisson_ratio) {
  return {young_modulus / (2 * (1 + poisson_ratio)),
          young_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))};
}

glm::vec4 energy_material(const Material& material) {
  if (material.material == "none") return glm::vec4(0);
  const Lame own = lame(material.young_modulus, material.poisson_ratio);
  return glm::vec4(own.mu, own.lambda,
                   material.material == "springs" ? 2
                   : smoothed(material)           ? 3
                                                  : 1,
                   smoothing_of(material));
}

namespace {

// Smith's parameters (2018, eq. 16) that have the linear elasticity of `m` at rest are mu = 4/3 mu_Lame and
// lambda = lambda_Lame + 5/6 mu_Lame.
Lame smith_moduli(const Lame& m) { return {4.0 / 3 * m.mu, m.lambda + 5.0 / 6 * m.mu}; }

// `share` is the part of mu that the tets have themselves.
void make_neo_hookean(ConstraintList& tets, const TetMesh& mesh, const auto& moduli, double share) {
  for (std::size_t c = 0; c < tets.count(); ++c) {
    const auto [whole, lambda] = smith_moduli(moduli(c));
    const double mu = share * whole;
    double* rest = tets.rest.data() + 8 * c;
    rest[7] = 1 + 0.75 * mu / lambda;
    const double volume = fill_of(mesh, c) / (6 * rest[6]);
    tets.compliance.insert(tets.compliance.end(), {1 / (mu * volume), 1 / (lambda * volume)});
  }
}

// Springs of stiffness k and length L in all directions alike are isotropic with mu = lambda = (sum k L^2) / (15 V)
// (Cauchy: Poisson's ratio 1/4). Each tet gives its six edges the same k L^2; volume(t) is what the body fills of tet
// t at rest.
std::vector<double> spring_stiffness(const ConstraintList& edges, const ConstraintList& tets, const auto& mu,
                                     const auto& volume) {
  std::vector<double> stiffness(edges.count());
  const auto numbers = std::views::iota(std::size_t(0), edges.count());  // sorted by the edges' vertices
  const auto ends = [&](std::size_t e) { return std::pair(edges.ends(e)[0], edges.ends(e)[1]); };
  for (std::size_t t = 0; t < tets.count(); ++t) {
    const auto v = tets.ends(t);
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < i; ++j) {
        const std::size_t e = *std::ranges::lower_bound(numbers, std::minmax({v[i], v[j]}), {}, ends);
        stiffness[e] += 15.0 / 6 * mu(t) * volume(t) / (edges.rest[e] * edges.rest[e]);
      }
  }
  return stiffness;
}

// Springs contribute lambda = mu; constraints of volume add what is missing of lambda.
void make_springs(ConstraintList& edges, ConstraintList& volumes, const TetMesh& mesh, const auto& moduli) {
  const auto volume = [&](std::size_t t) { return volumes.rest[t] * fill_of(mesh, t); };
  const auto mu = [&](std::size_t t) { return moduli(t).mu; };
  for (const double k : spring_stiffness(edges, volumes, mu, volume)) edges.compliance.push_back(1 / k);
  for (std::size_t t = 0; t < volumes.count(); ++t)
    volumes.compliance.push_back(volumes.rest[t] / fill_of(mesh, t) / (moduli(t).lambda - moduli(t).mu));
}

// Dashpots lie along edges and damp by tau (s) times the stiffness that springs there would have.
void make_dashpots(ConstraintList& edges, const ConstraintList& tets, const TetMesh& mesh, const auto& moduli,
                   double tau) {
  const auto mu = [&](std::size_t t) { return moduli(t).mu; };
  const auto volume = [&](std::size_t t) { return fill_of(mesh, t) / (6 * tets.rest[8 * t + 6]); };
  for (const double k : spring_stiffness(edges, tets, mu, volume)) edges.compliance.push_back(1 / (k * tau));
}

// The parts of a tet's rate of strain, of which shear has five. Together they resist a vertex no more than one alone
// could, so that they count as one when masses are split.
void make_viscous(ConstraintSystem& system, const ConstraintList& tets, const TetMesh& mesh, const Material& material) {
  ConstraintList& list = system.lists[index_of<Viscous>];
  for (std::size_t t = 0; t < tets.count(); ++t) {
    const double volume = 1 / (6 * tets.rest[8 * t + 6]), filled = volume * fill_of(mesh, t);
    for (int part = 0; part < 6; ++part) {
      const double resistance = part < 5 ? 2 * material.viscosity : material.bulk_viscosity;
      if (!(resistance > 0)) continue;
      list.vertices.insert(list.vertices.end(), mesh.tets[t].begin(), mesh.tets[t].end());
      list.rest.insert(list.rest.end(), {double(part), volume});
      list.compliance.push_back(1 / (resistance * filled));
    }
    for (const std::uint32_t v : mesh.tets[t]) ++system.at_vertex[v];
  }
  system.present[index_of<Viscous>] = list.count() > 0;
}

// Adds a body's constraints. Other bodies may be of other materials, so each constraint gets its own coefficients.
void append_body(ConstraintSystem& to, const ConstraintSystem& from, const Body& body, const Material& m) {
  for (std::size_t k = 0; k < kind_count; ++k) {
    ConstraintList& list = to.lists[k];
    const ConstraintList& own = from.lists[k];
    const ConstraintKind& kind = constraint_kinds[k];
    for (const std::uint32_t v : own.vertices) list.vertices.push_back(v + std::uint32_t(body.first_vertex));
    list.rest.insert(list.rest.end(), own.rest.begin(), own.rest.end());
    list.compliance.insert(list.compliance.end(), own.compliance.begin(), own.compliance.end());
    list.compliance.resize(list.count() * std::size_t(kind.components), m.compliance[k]);
    list.stiffness.resize(list.count(), m.stiffness[k]);
    const bool has_dashpots = m.material == "neo-hookean" && !kind.rate;  // in place of damping of C
    list.damping.resize(list.count(), has_dashpots ? 0 : m.constraint_damping);
    to.present[k] = to.present[k] || own.count() > 0;
  }
  for (std::size_t i = 0; i < body.vertices; ++i) to.at_vertex[body.first_vertex + i] = from.at_vertex[i];
  if (has_averages(from) || has_averages(to))
    append(to.averages, from.averages, body.vertices, std::uint32_t(body.first_vertex));
}

// By tet; empty where no body has regions.
std::vector<Lame> region_moduli(const Model& model, const Settings& settings) {
  std::vector<Lame> moduli;
  for (std::size_t t = 0; t < model.regions.size(); ++t) moduli.push_back(tet_moduli(model, settings, t));
  return moduli;
}

}  // namespace

Lame tet_moduli(const Model& model, const Settings& settings, std::size_t tet) {
  const std::size_t body = body_at(model, model.rest.tets[tet][0]).number;
  const Material& own = material_of(settings, body);
  const std::size_t region = model.regions.empty() ? 0 : model.regions[tet];
  const bool has_own = region > 0 && !settings.bodies.empty() && region <= settings.bodies[body].regions.size();
  const RegionModuli moduli = has_own ? settings.bodies[body].regions[region - 1] : RegionModuli{};
  return lame(moduli.young_modulus.value_or(own.young_modulus), moduli.poisson_ratio.value_or(own.poisson_ratio));
}

glm::vec4 tet_energy_material(const Model& model, const Settings& settings, std::size_t tet) {
  glm::vec4 all = energy_material(solved_material(body_at(model, model.rest.tets[tet][0]), settings));
  const Lame own = tet_moduli(model, settings, tet);
  if (all.z > 0) all.x = float(own.mu), all.y = float(own.lambda);
  return all;
}

ConstraintSystem build_constraints(const TetMesh& mesh, const Material& material, std::span<const Lame> moduli) {
  if (mesh.thickness > 0 && material.material != "none")
    throw Error("a sheet has no material", "material " + material.material,
                "give constraints stretch and isobend their compliance, and material none");
  ConstraintSystem system = build_constraints(mesh, kinds_in_use(material));
  const Lame all = lame(material.young_modulus, material.poisson_ratio);
  const auto of_tet = [&](std::size_t t) { return moduli.empty() ? all : moduli[t]; };
  if (material.material == "springs")
    make_springs(system.lists[index_of<Stretch>], system.lists[index_of<Volume>], mesh, of_tet);
  const double own = smoothed(material) ? smoothing_of(material) : 1;
  ConstraintList& tets = system.lists[smoothed(material) ? index_of<Smoothed> : index_of<NeoHookean>];
  if (material.material == "neo-hookean") make_neo_hookean(tets, mesh, of_tet, own);
  if (smoothed(material)) {
    const auto [mu, lambda] = smith_moduli(all);
    system.averages = average_tets(mesh, mu, lambda, own);
  }
  if (system.present[index_of<Dashpot>])
    make_dashpots(system.lists[index_of<Dashpot>], tets, mesh, of_tet, material.constraint_damping);
  if (uses(material, Viscous::row)) make_viscous(system, tets, mesh, material);
  return system;
}

namespace {

ConstraintSystem build_bodies(const Model& model, const Settings& settings) {
  const std::vector<Lame> moduli = region_moduli(model, settings);
  if (!has_own_materials(settings)) return build_constraints(model.rest, in_mode(settings, settings), moduli);
  ConstraintSystem system = build_constraints(TetMesh{model.rest.positions, {}, {}}, "");
  for (const Body& body : model.bodies) {
    const Material own = solved_material(body, settings);
    const auto of_body =
        moduli.empty() ? std::span<const Lame>() : std::span(moduli).subspan(body.first_tet, body.tets);
    append_body(system, build_constraints(body_mesh(model, body), own, of_body), body, own);
  }
  return system;
}

}  // namespace

ConstraintSystem build_constraints(const Model& model, const Settings& settings, const std::vector<char>& broken) {
  ConstraintSystem system = build_bodies(model, settings);
  add_attachments(system, model, settings, broken);
  add_fibres(system, model);
  return system;
}

const std::vector<Preset>& material_presets() {
  static const std::vector<Preset> rows = {
      {"rubber", "soft vulcanised rubber", "material=neo-hookean,young_modulus=1e6,poisson_ratio=0.48"},
      {"gelatine", "10 % in water", "material=neo-hookean,young_modulus=2e4,poisson_ratio=0.45"},
      {"muscle", "at rest, across its fibres", "material=neo-hookean,young_modulus=6e4,poisson_ratio=0.45"},
      {"foam", "soft polyurethane", "material=neo-hookean,young_modulus=1e5,poisson_ratio=0.2"},
      {"clay", "soft, keeps its shape", "material=neo-hookean,young_modulus=2e5,poisson_ratio=0.45,yield_strain=0.03"},
  };
  return rows;
}

}  // namespace tetpbd
