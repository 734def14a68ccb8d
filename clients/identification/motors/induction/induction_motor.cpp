#include "clients/identification/motors/induction/induction_motor.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "clients/identification/motors/induction/induction_regressor.hpp"

namespace drivebench::identification {
namespace {

/// With an index above half of the estimate the data do not determine the parameter.
constexpr double kLargestIndex = 0.5;
constexpr double kLargestCondition = 1e10;

const InductionMinimum* best(const InductionSearch& search) {
  const InductionMinimum* chosen = nullptr;
  for (const InductionMinimum& m : search.minima) {
    if (m.physical && (chosen == nullptr || m.residual < chosen->residual)) chosen = &m;
  }
  return chosen;
}

struct Mechanical {
  double k16, k17, index16, index17, error_index;
  Excitation excitation;
};

/// phi_x i_y - phi_y i_x with phi = sigma L_S (i' + (gamma + j n_p w) i - u/(sigma L_S))/(1/T_R - j n_p w).
double torque_signal(const InductionInstant& s, const InductionParameters& p, double gamma,
                     double pole_pairs) {
  const std::complex<double> i(s.i_x, s.i_y);
  const std::complex<double> slope(s.slope_x, s.slope_y);
  const std::complex<double> u(s.u_x, s.u_y);
  const double omega_e = pole_pairs * s.speed;
  const double transient_h = p.leakage_factor * p.stator_inductance_h;
  const std::complex<double> phi = (transient_h * (slope + std::complex<double>(gamma, omega_e) * i) - u) /
                                   std::complex<double>(1.0 / p.rotor_time_constant_s, -omega_e);
  return phi.real() * i.imag() - phi.imag() * i.real();
}

Mechanical mechanical_parameters(const std::vector<InductionInstant>& instants, const InductionParameters& p,
                                 double gamma, const MeasuredData& data, const Settings& e,
                                 const SampleRange& range) {
  Series torque;
  for (const InductionInstant& s : instants)
    torque.push_back(torque_signal(s, p, gamma, e.pole_pairs));
  torque = zero_phase(torque, e.processing.shaft, data.period_s);
  const bool viscous = e.load == LoadModel::kViscous;
  Regression fit({"J", viscous ? "f" : "tau_L"});
  for (std::size_t k = range.first; k < range.end; ++k)
    fit.add(std::array{torque[k], viscous ? -instants[k].speed : -1.0}, instants[k].acceleration);
  const LeastSquares found = fit.solve();
  return {found.estimate[0],      found.estimate[1], found.index_quarter[0],
          found.index_quarter[1], found.error_index, found.excitation};
}

void add_mechanical(Result& result, const Mechanical& m, const Settings& e) {
  const double inertia = e.pole_pairs / m.k16;
  const bool viscous = e.load == LoadModel::kViscous;
  result.parameters.push_back({"J", "kg*m^2", inertia, inertia * m.index16 / std::abs(m.k16), {}});
  // J K_17 is a product: the indices of its factors add at most.
  result.parameters.push_back({viscous ? "f" : "tau_L",
                               viscous ? "N*m*s/rad" : "N*m",
                               inertia * m.k17,
                               inertia * (m.index17 + std::abs(m.k17 / m.k16) * m.index16),
                               {}});
  result.parameters.push_back({"K16", "1/(kg*m^2)", m.k16, m.index16, {}});
  result.parameters.push_back({"K17", viscous ? "1/s" : "rad/s^2", m.k17, m.index17, {}});
  result.mechanical_error_index = m.error_index;
}

Excitation judged(const InductionMinimum& minimum, const std::vector<Estimate>& parameters) {
  Excitation found;
  const double condition = condition_of(minimum.hessian, true);
  for (const Estimate& e : parameters) {
    if (!(e.index < kLargestIndex * std::abs(e.value))) found.unseen.push_back(e.name);
  }
  found.sufficient = found.unseen.empty() && condition < kLargestCondition;
  if (found.sufficient) {
    found.verdict = "the data see every parameter";
    return found;
  }
  found.verdict = "not identifiable: the error hardly changes with";
  if (found.unseen.empty()) {
    for (const Estimate& e : parameters)
      found.unseen.push_back(e.name);
  }
  for (const std::string& name : found.unseen)
    found.verdict += " " + name;
  return found;
}

}  // namespace

InductionParameters induction_parameters(double k4, double k6, double k8, double k14) noexcept {
  const double one = 1.0 + k4 * k8 * k8;
  const double inductance = one / (k14 * k8);
  const double sigma = 1.0 / one;
  return {.stator_resistance_ohm = (k6 - k4) / k14,
          .rotor_time_constant_s = k8,
          .stator_inductance_h = inductance,
          .leakage_factor = sigma,
          .mutual_inductance_h = inductance * std::sqrt(1.0 - sigma),
          .rotor_resistance_ohm = inductance / k8};
}

std::vector<double> induction_indices(const InductionMinimum& m) {
  const InductionParameters p = induction_parameters(m.k4, m.k6, m.k8, m.k14);
  const double sigma2 = p.leakage_factor * p.leakage_factor;
  const double r = p.stator_resistance_ohm;
  // Gradients by (K_4, K_6, K_8, K_14).
  const std::vector<double> of_r = {-1.0 / m.k14, 1.0 / m.k14, 0.0, -r / m.k14};
  const std::vector<double> of_t = {0.0, 0.0, 1.0, 0.0};
  const std::vector<double> of_l = {m.k8 / m.k14, 0.0, m.k4 / m.k14 - 1.0 / (m.k14 * m.k8 * m.k8),
                                    -p.stator_inductance_h / m.k14};
  const std::vector<double> of_sigma = {-sigma2 * m.k8 * m.k8, 0.0, -2.0 * sigma2 * m.k4 * m.k8, 0.0};
  const double root = std::sqrt(1.0 - p.leakage_factor);
  std::vector<double> of_m(4);
  std::vector<double> of_rotor(4);
  for (std::size_t k = 0; k < 4; ++k) {
    of_m[k] = root * of_l[k] - 0.5 * p.stator_inductance_h / root * of_sigma[k];
    of_rotor[k] = (of_l[k] - p.rotor_resistance_ohm * of_t[k]) / m.k8;
  }
  return reach(m.hessian, {of_r, of_t, of_l, of_sigma, of_m, of_rotor}, 0.5 * m.residual);
}

Result identify_induction_motor(const MeasuredData& data, const Settings& e) {
  const SampleRange range = window_of(data, e.processing);
  const std::vector<InductionInstant> instants = induction_instants(data, e);
  Regression fit(induction_parameter_names());
  for (std::size_t k = range.first; k < range.end; ++k) {
    const InductionEquations rows = induction_equations(instants[k], e.pole_pairs);
    fit.add(rows.x_row, rows.x);
    fit.add(rows.y_row, rows.y);
  }
  const Triangle factor = fit.factor();
  double energy = 0.0;
  for (std::size_t i = 0; i <= kInductionParameters; ++i) {
    for (std::size_t j = i; j <= kInductionParameters; ++j) {
      if (!std::isfinite(factor(i, j)))
        throw IdentificationError("the data contain values that are not finite, or too large");
    }
    energy += factor(i, kInductionParameters) * factor(i, kInductionParameters);
  }
  const InductionSearch search = search_induction(factor);
  Result result = {.kind = "induction",
                   .method = "induction motor, constrained least squares, global over T_R"};
  result.index_factor = 1.25;
  result.samples = range.count();
  const auto physical =
      std::count_if(search.minima.begin(), search.minima.end(), [](const auto& m) { return m.physical; });
  result.notes.push_back(
      fmt::format("{} of {} minima over T_R > 0 belong to a motor{}", physical, search.minima.size(),
                  search.complete ? "; there are no others" : "; the search is not complete"));
  const InductionMinimum* minimum = best(search);
  if (minimum == nullptr) {
    result.excitation = {
        .sufficient = false,
        .unseen = {"R_S", "T_R", "L_S", "sigma"},
        .verdict = "not identifiable: no minimum of the error has the parameters of a motor"};
    for (const std::string& name : result.excitation.unseen)
      result.parameters.push_back({name, "", std::nan(""), std::nan(""), {}});
    return result;
  }
  const InductionParameters p = induction_parameters(minimum->k4, minimum->k6, minimum->k8, minimum->k14);
  const std::vector<double> indices = induction_indices(*minimum);
  result.parameters = {{"R_S", "ohm", p.stator_resistance_ohm, indices[0], {}},
                       {"T_R", "s", p.rotor_time_constant_s, indices[1], {}},
                       {"L_S", "H", p.stator_inductance_h, indices[2], {}},
                       {"sigma", "1", p.leakage_factor, indices[3], {}}};
  result.excitation = judged(*minimum, result.parameters);
  result.condition = condition_of(minimum->hessian, true);
  result.error_index = energy > 0.0 ? std::sqrt(minimum->residual / energy) : 0.0;
  result.parameters.push_back({"M", "H", p.mutual_inductance_h, indices[4], {}});
  result.parameters.push_back({"L_R", "H", p.stator_inductance_h, indices[2], {}});
  result.parameters.push_back({"R_R", "ohm", p.rotor_resistance_ohm, indices[5], {}});
  const std::vector<double> of_k = reach(
      minimum->hessian, {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}, 0.5 * minimum->residual);
  result.parameters.push_back({"K4", "1/s^2", minimum->k4, of_k[0], {}});
  result.parameters.push_back({"K6", "1/s^2", minimum->k6, of_k[1], {}});
  result.parameters.push_back({"K8", "s", minimum->k8, of_k[2], {}});
  result.parameters.push_back({"K14", "1/(H*s)", minimum->k14, of_k[3], {}});
  const double gamma = minimum->k6 * minimum->k8;
  const Mechanical mechanical = mechanical_parameters(instants, p, gamma, data, e, range);
  add_mechanical(result, mechanical, e);
  result.excitation = joined(result.excitation, mechanical.excitation);
  return result;
}

}  // namespace drivebench::identification
