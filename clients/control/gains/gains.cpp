#include "clients/control/gains/gains.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "protocols/nearest_name.hpp"

namespace drivebench::control {
namespace {

std::string text_of(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

}  // namespace

std::string problem_with_gain(std::string_view name, double value, GainRule rule) {
  const std::string start(name);
  if (!std::isfinite(value)) return start + " must be finite";
  const bool is_time = rule == GainRule::kDuration || rule == GainRule::kPause;
  if (is_time && value > kLongestRun_s) return start + " must be at most " + text_of(kLongestRun_s) + " s";
  if ((rule == GainRule::kPositive || rule == GainRule::kDuration) && value <= 0.0) {
    return start + " must be positive";
  }
  if (rule != GainRule::kAny && value < 0.0) return start + " must not be negative";
  return {};
}

namespace gains_detail {

void refuse_unknown(const Gain& gain, const std::vector<Gain>& known) {
  throw std::invalid_argument("no gain '" + gain.name + "'" + advice(gain.name, known, &Gain::name));
}

void refuse_problems(const std::vector<std::string>& problems, const std::vector<Gain>& values) {
  std::string text;
  for (const std::string& problem : problems) {
    const std::string name = problem.substr(0, problem.find(' '));
    text += text.empty() ? "" : "; ";
    text += name;
    for (const Gain& gain : values) {
      if (gain.name == name) text += " = " + text_of(gain.value);
    }
    text += problem.substr(name.size());
  }
  if (!text.empty()) throw std::invalid_argument(text);
}

}  // namespace gains_detail
}  // namespace drivebench::control
