#include "clients/control/estimators/shaft_estimator.hpp"

#include <numbers>

namespace drivebench::control {
namespace {

template <std::size_t N>
void add_observer_problems(const LinearSystem<N, 1>& system, double period_s, Discretisation how,
                           const char* unstable, std::vector<std::string>& found) {
  if (!system.stable()) {
    found.emplace_back(unstable);
  } else if (!LinearObserver<N, 1>(system, period_s, how).stable()) {
    found.emplace_back(
        "observer.angle_per_s is too fast for the sample rate: the sampled observer is unstable");
  }
}

}  // namespace

std::vector<std::string> ShaftEstimatorParameters::problems(double friction_rate_per_s,
                                                            double period_s) const {
  std::vector<std::string> found;
  if (source == ShaftSpeed::kObserver) {
    add_observer_problems(shaft_observer(observer, friction_rate_per_s), period_s, discretisation,
                          "observer.speed_per_s2 with this angle_per_s makes the observer unstable", found);
  }
  if (source == ShaftSpeed::kLoadObserver) {
    add_observer_problems(load_observer(observer, friction_rate_per_s), period_s, discretisation,
                          "observer.load_per_s3 makes the observer unstable: it must be negative, and above "
                          "-(l1 + f/J)(l2 + l1 f/J)",
                          found);
  }
  if (source == ShaftSpeed::kTachometer && tachometer_vs_per_rad == 0.0)
    found.emplace_back("tachometer.vs_per_rad must not be zero");
  return found;
}

ShaftEstimator::ShaftEstimator(const ShaftEstimatorParameters& p, double friction_rate_per_s,
                               double period_s) noexcept
    : rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      source_(source_of(p, friction_rate_per_s, period_s)) {}

ShaftEstimator::Source ShaftEstimator::source_of(const ShaftEstimatorParameters& p,
                                                 double friction_rate_per_s, double period_s) noexcept {
  switch (p.source) {
    case ShaftSpeed::kObserver:
      return LinearObserver<2, 1>(shaft_observer(p.observer, friction_rate_per_s), period_s,
                                  p.discretisation);
    case ShaftSpeed::kLoadObserver:
      return LinearObserver<3, 1>(load_observer(p.observer, friction_rate_per_s), period_s, p.discretisation);
    case ShaftSpeed::kEdges:
      return EdgeSpeed(p.counts_per_revolution, period_s);
    case ShaftSpeed::kTachometer:
      return Tachometer{1.0 / p.tachometer_vs_per_rad};
    case ShaftSpeed::kBackwardDifference:
      break;
  }
  return BackwardDifference(static_cast<std::int32_t>(p.counts_per_revolution), period_s);
}

const ShaftEstimate& ShaftEstimator::update(const Measurement& m, double motor_rad_s2,
                                            std::int64_t periods) noexcept {
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
  }
  now_.angle_rad = rad_per_count_ * static_cast<double>(m.encoder_count - start_count_);
  if (auto* observer = std::get_if<LinearObserver<2, 1>>(&source_)) {
    observer->update({motor_rad_s2}, now_.angle_rad, periods);
    now_.speed_rad_s = observer->state()[1];
  } else if (auto* with_load = std::get_if<LinearObserver<3, 1>>(&source_)) {
    with_load->update({motor_rad_s2}, now_.angle_rad, periods);
    now_.speed_rad_s = with_load->state()[1];
    now_.load_rad_s2 = with_load->state()[2];
  } else if (auto* difference = std::get_if<BackwardDifference>(&source_)) {
    now_.speed_rad_s = difference->step(m.encoder_count, periods);
  } else if (auto* edges = std::get_if<EdgeSpeed>(&source_)) {
    now_.speed_rad_s = edges->step(m.encoder_count, m.edge_age_s, periods);
  } else if (const auto* tachometer = std::get_if<Tachometer>(&source_)) {
    now_.speed_rad_s = tachometer->rad_per_vs * m.tachometer_v;
  }
  return now_;
}

}  // namespace drivebench::control
