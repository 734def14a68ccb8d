#include "clients/identification/motors/terminal_voltages.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "clients/identification/data/noise.hpp"

namespace drivebench::identification {
namespace {

/// Sample 0 of a bench shows no voltage, because no tick has run: extrapolates it from the next two samples.
void continue_to_begin(std::vector<Series>& u) {
  if (std::ranges::any_of(u, [](const Series& x) { return x[0] != 0.0; })) return;
  for (Series& x : u)
    x[0] = 2.0 * x[1] - x[2];
}

/// The value of every period from values that hold for one, by the place of the sample that has it.
Series held_values(const Series& measured, double place) {
  Series held(measured.size());
  const double whole = std::floor(place);
  const double part = place - whole;
  const auto last = static_cast<std::ptrdiff_t>(measured.size()) - 1;
  const auto value = [&](std::ptrdiff_t k) {
    return measured[static_cast<std::size_t>(std::clamp(k, std::ptrdiff_t{0}, last))];
  };
  for (std::size_t k = 0; k < held.size(); ++k) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(k) + static_cast<std::ptrdiff_t>(whole);
    held[k] = part == 0.0 ? value(at) : (1.0 - part) * value(at) + part * value(at + 1);
  }
  return held;
}

/// Whether voltages with this shift are means of a period.
bool is_held(double voltage_shift) noexcept {
  return std::abs(voltage_shift) >= 0.5 && voltage_shift != std::round(voltage_shift);
}

}  // namespace

std::size_t phases_of(const Settings& e) noexcept {
  if (e.kind == MotorKind::kDc) return 1;
  return e.kind == MotorKind::kBldc || e.three_phase ? 3 : 2;
}

TerminalVoltages::TerminalVoltages(const MeasuredData& data, const Settings& e)
    : shift_(e.processing.voltage_shift), held_(is_held(shift_)) {
  for (std::size_t k = 0; k < phases_of(e); ++k) {
    const SeriesView measured = data.at("u_" + std::string(1, static_cast<char>('a' + k)) + "_v");
    u_.emplace_back(measured.begin(), measured.end());
  }
  if (held_) {
    for (Series& u : u_)
      u = held_values(u, shift_ + 0.5);
  } else {
    continue_to_begin(u_);
  }
}

std::array<double, 3> TerminalVoltages::at(std::size_t sample, double part) const noexcept {
  std::array<double, 3> u{};
  for (std::size_t k = 0; k < u_.size(); ++k)
    u[k] = held_ ? u_[k][sample] : value_at(u_[k], static_cast<double>(sample) + part + shift_);
  return u;
}

TerminalVoltages TerminalVoltages::thinned(std::size_t first, std::size_t by) const {
  TerminalVoltages thin = *this;
  if (!held_) thin.shift_ /= static_cast<double>(by);
  for (std::size_t phase = 0; phase < u_.size(); ++phase) {
    const SeriesView u = u_[phase];
    thin.u_[phase].clear();
    for (std::size_t k = first; k < u.size(); k += by) {
      const SeriesView period = u.subspan(k, held_ ? std::min(by, u.size() - k) : 1);
      thin.u_[phase].push_back(std::accumulate(period.begin(), period.end(), 0.0) /
                               static_cast<double>(period.size()));
    }
  }
  return thin;
}

double TerminalVoltages::rms(const SampleRange& range) const noexcept {
  double sum = 0.0;
  for (const Series& u : u_) {
    for (std::size_t k = range.first; k < range.end; ++k)
      sum += u[k] * u[k];
  }
  return std::sqrt(sum / static_cast<double>(u_.size() * range.count()));
}

double TerminalVoltages::white_v(const SampleRange& range) const {
  double most = 0.0;
  for (const Series& u : u_)
    most = std::max(most, white_noise(SeriesView(u).subspan(range.first, range.count())));
  return most;
}

}  // namespace drivebench::identification
