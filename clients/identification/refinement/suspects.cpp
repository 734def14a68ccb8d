#include "clients/identification/refinement/suspects.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "plant/math/trig.hpp"

namespace drivebench::identification {
namespace {

constexpr double kSuspectPart = 0.01;  ///< of the largest signal, or of a gain: the size of a suspect
constexpr Eigen::Index kScoreParts = 64;
/// Of the first direction of an error: less of the second tells nothing of its own.
constexpr double kSeenApart = 0.01;

/// The suspects of each phase.
void add_phases(const Settings& e, const PredictorRecord& record, const SensorErrors& at,
                std::vector<Suspect>& all) {
  const std::size_t phases = record.currents.size();
  for (const bool current : {true, false}) {
    const double size =
        kSuspectPart * (current ? record.largest_current_a : record.voltages.rms(record.range));
    const bool known = current ? e.sensors.current_offsets : e.sensors.voltage_offsets;
    for (std::size_t phase = !current && phases == 3 ? 1 : 0; phase < phases; ++phase) {
      const std::string name =
          fmt::format("{}_{}_{}", current ? 'i' : 'u', static_cast<char>('a' + phase), current ? 'a' : 'v');
      if (!known) {
        Suspect s{.what = fmt::format("an offset of {{:.3g}} {} of {}", current ? "A" : "V", name),
                  .remedy = fmt::format("--find {}-offsets looks for it", current ? "current" : "voltage"),
                  .errors = {at},
                  .size = size};
        (current ? s.errors[0].current_offset_a : s.errors[0].voltage_offset_v)[phase] += size;
        all.push_back(std::move(s));
      }
      if (phase > 0 && !e.sensors.gains) {
        Suspect s{.what = fmt::format("a gain of {} that is {{:.3g}} of itself beside that of phase a", name),
                  .remedy = "--find gains looks for it",
                  .errors = {at},
                  .size = kSuspectPart};
        (current ? s.errors[0].current_gain : s.errors[0].voltage_gain)[phase] += kSuspectPart;
        all.push_back(std::move(s));
      }
    }
  }
}

/// The variance of the sum of the products of an error and residuals that hold its opposite: that of white
/// residuals, or the scatter over parts of the record once the residuals are freed of the error. What the
/// error itself adds to the scatter would hide it: 64 equal parts never show more than 8 standard deviations,
/// and one part that tells all shows 1.
double score_variance(const Eigen::VectorXd& error, const Eigen::VectorXd& residual) {
  const Eigen::Index rows = residual.size();
  double scatter = 0.0;
  for (Eigen::Index part = 0; part < kScoreParts; ++part) {
    const Eigen::Index first = part * rows / kScoreParts;
    const Eigen::Index count = (part + 1) * rows / kScoreParts - first;
    const auto own = error.segment(first, count);
    const double score = own.dot(residual.segment(first, count)) + own.squaredNorm();
    scatter += score * score;
  }
  return std::max(error.squaredNorm(), scatter);
}

}  // namespace

std::vector<Suspect> suspects_of(const Settings& e, const PredictorRecord& record, const SensorErrors& at) {
  std::vector<Suspect> all;
  add_phases(e, record, at, all);
  const auto add = [&](const char* what, const char* remedy, double size, auto... members) {
    Suspect s{.what = what, .remedy = remedy, .errors = {}, .size = size};
    (((members(s.errors.emplace_back(at))) += size), ...);
    all.push_back(std::move(s));
  };
  constexpr const char* kInstant =
      "check the voltage shift and the filters of the sensors: all columns must "
      "be of one instant";
  const double delay_s = kSuspectPart * record.period_s;
  add("currents that are {:.3g} s late", kInstant, delay_s,
      [](SensorErrors& s) -> double& { return s.current_delay_s; });
  add("voltages that are {:.3g} s late", kInstant, delay_s,
      [](SensorErrors& s) -> double& { return s.voltage_delay_s; });
  add("an encoder that is {:.3g} s late", "check when its counts are taken", delay_s,
      [](SensorErrors& s) -> double& { return s.angle_delay_s; });
  add(
      "an encoder that is off its centre by {:.3g} rad once in a turn", "check how it is mounted",
      kSuspectPart, [](SensorErrors& s) -> double& { return s.eccentricity_rad[0]; },
      [](SensorErrors& s) -> double& { return s.eccentricity_rad[1]; });
  const bool magnet = e.kind == MotorKind::kPmSynchronous || e.kind == MotorKind::kBldc;
  if (magnet && !e.sensors.zero)
    add("an encoder whose zero is off by {:.3g} rad electrical", "do not give the zero: the data show it",
        kSuspectPart, [](SensorErrors& s) -> double& { return s.angle_offset_rad; });
  return all;
}

double telling_deviations(std::size_t suspects) {
  return std::sqrt(2.0 * logarithm(static_cast<double>(suspects) / kFalseAlarms));
}

std::optional<Suspicion> strongest_suspicion(const Fit& fit, const std::vector<Unknown>& unknowns,
                                             const std::vector<Suspect>& suspects,
                                             Eigen::MatrixXd directions) {
  constexpr double k95 = 1.96;
  const Eigen::LDLT<Eigen::MatrixXd> information(fit.jacobian.transpose() * fit.jacobian);
  const Eigen::MatrixXd moves = information.solve(fit.jacobian.transpose() * directions);
  directions.noalias() -= fit.jacobian * moves;  // what no parameter can take over
  const double tells = telling_deviations(suspects.size());
  std::optional<Suspicion> strongest;
  Eigen::Index first = 0;
  for (const Suspect& suspect : suspects) {
    const auto count = static_cast<Eigen::Index>(suspect.errors.size());
    const auto own = directions.middleCols(first, count);
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> by_direction;
    by_direction.setThreshold(kSeenApart);
    const Eigen::VectorXd amounts = by_direction.compute(own).solve(-fit.residual);
    const Eigen::VectorXd move = moves.middleCols(first, count) * amounts;
    first += count;
    const Eigen::VectorXd error = own * amounts;
    const double seen = error.squaredNorm();
    if (!(seen > 0.0)) continue;
    const double amount = count == 1 ? amounts(0) : amounts.norm();
    Suspicion s{.what = fmt::format(fmt::runtime(suspect.what), amount * suspect.size),
                .remedy = suspect.remedy,
                .deviations = seen / std::sqrt(score_variance(error, fit.residual)),
                .tells = tells};
    for (std::size_t k = 0; k < unknowns.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      const double shift = std::abs(move(row)) / (k95 * std::sqrt(fit.covariance(row, row)));
      if (shift <= s.shift) continue;
      s.shift = shift;
      s.moved = unknowns[k].name;
    }
    const double least = strongest ? strongest->deviations : tells;
    if (s.deviations > least && s.shift > 1.0) strongest = std::move(s);
  }
  return strongest;
}

}  // namespace drivebench::identification
