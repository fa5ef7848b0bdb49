#include "app/lab/baselines.h"

#include <cmath>
#include <utility>

#include "sim/contact/rigid_contact.h"
#include "sim/hash.h"
#include "sim/model/material.h"
#include "sim/reference/implicit.h"
#include "sim/reference/rigid.h"

namespace tetpbd {

namespace {

/// Steps that `advance` takes and `state` shows. A baseline has no GL buffers: what is measured is what its state
/// tells.
MeasuredRun run_baseline(const Model& model, const Settings& settings, long steps, const Standard& standard,
                         const std::function<void()>& advance, const std::function<State()>& state) {
  long step = 0;
  std::vector<Measurement> measured;
  const auto measure = [&] {
    const Motion::Row now = measure_motion(model, settings, state(), double(step) * settings.dt);
    Measurement& m = measured.emplace_back();
    m.step = step, m.time = now.time;
    m.centre = now.centre, m.kinetic = now.kinetic, m.potential = now.potential;
  };
  Stepper stepper{.model = &model, .dt = settings.dt, .state = state, .measure = measure};
  stepper.step = [&] { advance(), ++step; };
  stepper.collect = [&](Run& run, bool) {
    auto& all = run.so_far.measurements;
    all.insert(all.end(), measured.begin(), measured.end());
    measured.clear();
  };
  stepper.find_non_finite = [&](bool) -> std::optional<NonFinite> {
    const State now = state();
    for (std::size_t v = 0; v < now.positions.size(); ++v)
      if (!std::isfinite(glm::dot(now.positions[v], now.positions[v]))) return NonFinite{step, std::uint32_t(v)};
    return std::nullopt;
  };
  stepper.hash = [&] { return hash_values(state().velocities, hash_values(state().positions)); };
  stepper.substeps = [&] { return plan_for(settings).substeps; };
  Run run = begin(std::move(stepper), steps, {.standard = standard});
  tetpbd::advance(run);
  return finish(run);
}

/// A rigid body of six degrees of freedom, where k = 1: flight as in rigid.h, contact as the modes have it
/// (rigid_contact.h), in double.
MeasuredRun rigid_run(const Model& model, const Settings& settings, long steps, const Standard& standard) {
  std::vector<RigidBody> bodies = rigid_bodies(model);
  Settings touching = settings;
  touching.rigid_contact = true;
  RigidContact contact(model, {});
  contact.begin(model, touching);
  double time = 0;
  const Model nothing;  // to touch: contact is found here
  Settings flight = settings, carried = settings;
  flight.ground = carried.ground = false, carried.gravity = 0;
  State now = make_state(model, bodies);
  struct Place {
    const Points& points;
    const glm::dvec3& at(std::uint32_t i) const { return points[i]; }
  };
  return run_baseline(
      model, settings, steps, standard,
      [&] {
        const Plan plan = plan_for(settings);
        GuardCounts left_out{};
        Substep substep(model, settings, plan, std::exchange(time, time + settings.dt));
        for (int s = 0; s < plan.substeps; ++s) {
          substep.begin(s);
          contact.prepare(substep, model.inverse_masses, Place{now.positions}, now.velocities, now.work, left_out);
          for (RigidBody& body : bodies) {
            const bool touches = contact.touches(body.first);
            if (touches) {
              body.velocity = body.angular = glm::dvec3(0);
              for (std::size_t i = body.first; i < body.first + body.rest.size(); ++i) {
                const glm::dvec3 momentum = model.masses[i] * now.velocities[i];
                body.velocity += momentum / body.mass;
                body.angular += glm::cross(now.positions[i] - body.centre, momentum);
              }
            }
            advance(body, nothing, touches ? carried : flight, substep.h);
          }
          now = make_state(model, bodies);
        }
      },
      [&] { return now; });
}

/// Newton steps with sparse Cholesky factors, `iterations` of them in each implicit step.
MeasuredRun direct_run(const Model& model, const Settings& settings, long steps, const Standard& standard) {
  const Plan plan = plan_for(settings);
  const ConstraintSystem system = build_constraints(model, settings);
  const ReferenceInput input{model, system, settings, model.inverse_masses};
  Implicit run = implicit(input, reference_compliances(input), {model.positions, model.velocities}, plan.h);
  run.most = plan.iterations;
  return run_baseline(
      model, settings, steps, standard, [&] { advance(run, plan.substeps); }, [&] { return run.now; });
}

}  // namespace

const std::vector<Baseline>& baselines() {
  static const std::vector<Baseline> rows = {
      {"rigid-body", "with k = 1 and stretch",
       [](const Settings& s) {
         return all_materials(s, [](const Material& m) { return hard(m) && uses(m, Stretch::row); });
       },
       rigid_run},
      {"direct", "with compliance or a material", [](const Settings& s) { return any_material(s, compliant); },
       direct_run},
  };
  return rows;
}

}  // namespace tetpbd
