// Clamped beams of a material: sag, frequency and damping against linear finite elements and beam theory.
#include <Eigen/Dense>
#include <Eigen/Sparse>

#include "sim/reference/leapfrog.h"
#include "tests/long_run.h"
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

namespace {

Points hanging(const Scene& scene) {
  return static_equilibrium(scene.input(), scene.model.positions, none).state.positions;
}

// Rayleigh's quotient of the shape it hangs in, rad^2/s^2: for a cantilever 0.8 % above that of its first
// vibration.
double rayleigh(const Scene& scene, const Points& x) {
  double work = 0, squares = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const glm::dvec3 moved = x[i] - scene.model.positions[i];
    work -= scene.model.masses[i] * scene.settings.gravity * moved.y;
    squares += scene.model.masses[i] * glm::dot(moved, moved);
  }
  return work / squares;
}

// Timoshenko's cantilever of length 1, width and height b, under its weight.
struct Cantilever {
  double E, nu, b = 0.25, density = 1000, gravity = 9.81;
  double at(double x) const {
    const double q = density * gravity * b * b, kappa = 10 * (1 + nu) / (12 + 11 * nu);
    const double bending = E * b * b * b * b / 12, shear = kappa * E / (2 * (1 + nu)) * b * b;
    return q / (24 * bending) * x * x * (x * x - 4 * x + 6) + q / shear * (x - x * x / 2);
  }
  double sag() const { return at(1); }
  double rayleigh() const {
    double sum = 0, squares = 0;
    const int n = 2000;
    for (int i = 0; i < n; ++i) sum += at((i + 0.5) / n), squares += at((i + 0.5) / n) * at((i + 0.5) / n);
    return gravity * sum / squares;
  }
};

// Linear finite elements under gravity, assembled anew: K = sum V B^T D B.
double linear_sag(const Scene& scene) {
  const Lame m = lame(scene.settings.young_modulus, scene.settings.poisson_ratio);
  Eigen::Matrix<double, 6, 6> D = Eigen::Matrix<double, 6, 6>::Zero();
  D.topLeftCorner<3, 3>().setConstant(m.lambda);
  for (int i = 0; i < 6; ++i) D(i, i) += i < 3 ? 2 * m.mu : m.mu;
  const TetMesh& mesh = scene.model.rest;
  const int rows = 3 * int(mesh.positions.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (const Tet& t : mesh.tets) {
    Eigen::Matrix4d P;
    for (int j = 0; j < 4; ++j) {
      const glm::dvec3& p = mesh.positions[t[std::size_t(j)]];
      P.row(j) << 1, p.x, p.y, p.z;
    }
    const Eigen::Matrix4d shape = P.inverse();  // rows 1 to 3: gradients of the shape functions
    Eigen::Matrix<double, 6, 12> B = Eigen::Matrix<double, 6, 12>::Zero();
    for (int j = 0; j < 4; ++j) {
      const double x = shape(1, j), y = shape(2, j), z = shape(3, j);
      B.block<6, 3>(0, 3 * j) << x, 0, 0, 0, y, 0, 0, 0, z, y, x, 0, 0, z, y, z, 0, x;
    }
    const Eigen::Matrix<double, 12, 12> K = std::abs(P.determinant()) / 6 * B.transpose() * D * B;
    for (int r = 0; r < 12; ++r)
      for (int c = 0; c < 12; ++c)
        entries.emplace_back(3 * int(t[std::size_t(r / 3)]) + r % 3, 3 * int(t[std::size_t(c / 3)]) + c % 3, K(r, c));
  }
  Eigen::SparseMatrix<double> K(rows, rows);
  K.setFromTriplets(entries.begin(), entries.end());
  Eigen::VectorXd load = Eigen::VectorXd::Zero(rows);
  for (int i = 0; i < rows / 3; ++i)
    if (scene.model.inverse_masses[std::size_t(i)] > 0)
      load(3 * i + 1) = -scene.model.masses[std::size_t(i)] * scene.settings.gravity;
    else
      for (int a = 0; a < 3; ++a) K.coeffRef(3 * i + a, 3 * i + a) *= 1e12;
  const Eigen::VectorXd u = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(K).solve(load);
  Points x = scene.model.positions;
  for (std::size_t i = 0; i < x.size(); ++i)
    for (int a = 0; a < 3; ++a) x[i][a] += u(3 * Eigen::Index(i) + a);
  return sag_of(scene, x);
}

// What the sag's inverse and Rayleigh's quotient are of the beam's, on 8, 16 and 32 cells along it.
struct Refined {
  std::array<double, 3> stiffness, squares;
};
Refined refined(const Cantilever& exact) {
  Refined r;
  for (std::size_t level = 0; level < 3; ++level) {
    const int n = 2 << level;
    const Scene scene = beam_of("neo-hookean", {4 * n, n, n}, exact.E, exact.nu);
    const Points x = hanging(scene);
    const double sag = sag_of(scene, x);
    CHECK(sag < 0.02);
    CHECK(off(sag, linear_sag(scene)) < 0.005);
    r.stiffness[level] = exact.sag() / sag, r.squares[level] = rayleigh(scene, x) / exact.rayleigh();
  }
  return r;
}

}  // namespace

TEST_CASE("material: a neo-hookean cantilever sags as linear finite elements and, refined, as Timoshenko says") {
  const auto [stiffness, squares] = refined({5e7, 0.3});
  CHECK(stiffness[2] > 1);  // linear tets are too stiff
  CHECK(stiffness[1] > stiffness[2]);
  CHECK(stiffness[0] > stiffness[1]);
  CHECK(off(extrapolated(stiffness), 1) < 0.02);
  CHECK(off(std::sqrt(extrapolated(squares)), 1) < 0.02);
}

// In a motion that dies down, as the elements have no minimiser of their own.
TEST_CASE("material: a cantilever of ten-node tets sags as Timoshenko says on cells where linear tets are far off") {
  const Cantilever exact{.E = 1e5, .nu = 0.3, .gravity = 0.01};
  Scene scene = beam_of("neo-hookean", {8, 2, 2}, exact.E, exact.nu);
  scene.settings.gravity = exact.gravity;
  const Halved halved = halve_edges(scene.model);
  const ConstraintSystem system = build_constraints(halved.model, scene.settings);
  scene.settings.damping = 5;  // 1/s, about critical
  const ReferenceInput input{halved.model, system, scene.settings, halved.model.inverse_masses, true};
  const double h = 0.9 * stable_step(input, none, halved.model.positions);
  Leapfrog run = leapfrog(input, none, {halved.model.positions, halved.model.velocities}, h);
  advance(run, long(5 / h));
  Points corners;
  for (const std::uint32_t v : halved.corner) corners.push_back(run.x[v]);
  CHECK(off(sag_of(scene, corners), exact.sag()) < 0.05);  // its clamped end cannot narrow
  CHECK(sag_of(scene, hanging(scene)) < 0.6 * exact.sag());
}

// The tables of docs/results.md, of which the short suite has the row that is hardest for linear tets.
TEST_CASE("material: sag tables") {
  for (const double nu : {0.25, 0.3, 0.4, 0.45}) {
    if (!is_long_run() && nu != 0.45) continue;
    const Cantilever exact{5e7, nu};
    const auto [stiffness, squares] = refined(exact);
    const auto springs_over_tets = [&](const glm::ivec3& cells, const glm::dvec3& size) {
      const auto sag = [&](const char* material) {
        const Scene scene = beam_of(material, cells, exact.E, nu, size);
        return sag_of(scene, hanging(scene));
      };
      return sag("springs") / sag("neo-hookean");
    };
    MESSAGE(nu, ": sags ", 1 / stiffness[0], " ", 1 / stiffness[1], " ", 1 / stiffness[2], " extrapolated ",
            1 / extrapolated(stiffness), "; frequencies ", std::sqrt(squares[0]), " ", std::sqrt(squares[1]), " ",
            std::sqrt(squares[2]), " extrapolated ", std::sqrt(extrapolated(squares)), "; springs over tets, beam ",
            springs_over_tets({16, 4, 4}, {1, exact.b, exact.b}), ", cube ", springs_over_tets({6, 6, 6}, {1, 1, 1}));
  }
}

TEST_CASE("material: a cantilever swings with the damping ratio pi f tau") {
  for (const std::string material : {"neo-hookean", "springs"})
    for (const int cells : {2, 3}) {
      CAPTURE(material);
      CAPTURE(cells);
      Scene scene = beam_of(material, {4 * cells, cells, 2 * cells}, 1e7, 0.25, {1, 0.25, 0.5});
      const double tau = scene.settings.constraint_damping = 0.002;
      scene.system = build_constraints(scene.model.rest, scene.settings);
      const Points start = hanging(scene);
      scene.settings.gravity = 0;
      const double h = 0.4 * stable_step(scene.input(), none, scene.model.positions);
      Leapfrog run = leapfrog(scene.input(), none, {start, scene.start().velocities}, h);
      // Its highest place in each period, from one rising through rest to the next.
      std::vector<double> peaks{0}, times{0};
      double before = sag_of(scene, run.x);
      for (long s = 1; peaks.size() < 4; ++s) {
        advance(run, 1);
        const double sag = sag_of(scene, run.x);
        if (before < 0 && sag >= 0) peaks.push_back(0), times.push_back(double(s) * h);
        peaks.back() = std::max(peaks.back(), sag), before = sag;
      }
      const double ratio = std::log(peaks[1] / peaks[2]) / (2 * pi), frequency = 1 / (times[2] - times[1]);
      CHECK(ratio / (pi * frequency * tau) == doctest::Approx(1).epsilon(0.2));
    }
}
