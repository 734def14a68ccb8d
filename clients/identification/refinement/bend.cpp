#include "clients/identification/refinement/bend.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace drivebench::identification {

std::vector<BendingInductionModel> bending_motors(Series flux_wb, const BendingInductionModel& straight,
                                                  double bend) {
  constexpr double kUsual = 0.95;
  const auto usual =
      flux_wb.begin() + static_cast<std::ptrdiff_t>(kUsual * static_cast<double>(flux_wb.size()));
  std::nth_element(flux_wb.begin(), usual, flux_wb.end());
  std::vector<BendingInductionModel> motors(std::size(kBendPowers), straight);
  for (std::size_t k = 0; k < motors.size(); ++k) {
    motors[k].bend = bend;
    motors[k].power = kBendPowers[k];
    motors[k].reference_wb = *usual;
  }
  return motors;
}

BendTest test_bend(const Fit& fit, const std::vector<Unknown>& unknowns, const Eigen::MatrixXd& directions) {
  constexpr double k95 = 1.96;
  constexpr Eigen::Index kUnsettled = 16;  // a part of the record: until the filter knows the flux
  const Eigen::Index rows = fit.residual.size() - fit.residual.size() / kUnsettled;
  const auto jacobian = fit.jacobian.bottomRows(rows);
  const auto bends = directions.bottomRows(rows);
  const Eigen::MatrixXd information = jacobian.transpose() * jacobian;
  const Eigen::MatrixXd moves = information.ldlt().solve(jacobian.transpose() * bends);
  const Eigen::MatrixXd unexplained = bends - jacobian * moves;  // what no parameter can take over
  const Eigen::VectorXd score = unexplained.transpose() * fit.residual.tail(rows);
  const Eigen::MatrixXd seen = unexplained.transpose() * unexplained;
  BendTest test;
  test.evidence = score.dot(seen.ldlt().solve(score));
  test.part = -score(0) / seen(0, 0);
  test.interval = k95 / std::sqrt(seen(0, 0));
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const double shift = std::abs(moves(static_cast<Eigen::Index>(k), 0)) * test.interval;
    if (unknowns[k].scale > 0.0 || shift <= test.shift) continue;
    test.moved = unknowns[k].name;
    test.shift = shift;
  }
  return test;
}

std::string straight_note(const BendTest& test) {
  return fmt::format(
      "the magnetising curve is taken as straight: at the largest flux a gentle bend takes {:.2g} % +- "
      "{:.2g} % of "
      "the magnetising current, and one of {:.2g} % would move {} by {:.2g} %",
      100.0 * test.part, 100.0 * test.interval, 100.0 * test.interval, test.moved, 100.0 * test.shift);
}

}  // namespace drivebench::identification
