#include "clients/identification/motors/dc_motor.hpp"

#include <array>

namespace drivebench::identification {

Result identify_dc_motor(const MeasuredData& data, const Settings& settings) {
  const Processing& p = settings.processing;
  const SampleRange range = window_of(data, p);
  const ShaftSignals shaft = shaft_signals(data, settings, p.shaft);
  const Series i = zero_phase(data.at("i_a_a"), p.current, data.period_s);
  const Series v = zero_phase(advanced(data.at("u_a_v"), p.voltage_shift), p.voltage, data.period_s);
  const Series slope = slope_of(i, data, p);

  Regression fit({"L", "R", "K_T", "J", "f"});
  for (std::size_t k = range.first; k < range.end; ++k) {
    fit.add(std::array{slope[k], i[k], shaft.speed[k], 0.0, 0.0}, v[k]);
    fit.add(std::array{0.0, 0.0, -i[k], shaft.acceleration[k], shaft.speed[k]}, 0.0);
  }
  const LeastSquares found = fit.solve();
  Result result = {.kind = "pm_dc", .method = "DC motor, least squares in one stage"};
  const std::array<const char*, 5> units = {"H", "ohm", "N*m/A", "kg*m^2", "N*m*s/rad"};
  for (std::size_t n = 0; n < units.size(); ++n)
    result.parameters.push_back(
        {fit.parameters()[n], units[n], found.estimate[n], found.index_double[n], {}});
  result.error_index = found.error_index;
  result.condition = found.condition;
  result.normal_condition = found.normal_condition;
  result.samples = range.count();
  result.excitation = found.excitation;
  const bool current_varies = varies(i, range);
  const bool speed_varies = varies(shaft.speed, range);
  if (!current_varies && !speed_varies) {
    add_unseen(result.excitation, fit.parameters(), "neither current nor speed changes");
  } else if (!current_varies) {
    add_unseen(result.excitation, {"L"}, "the current does not change");
  } else if (!speed_varies) {
    add_unseen(result.excitation, {"J"}, "the speed does not change");
  }
  expect_positive(result, {"L", "R", "K_T", "J"});
  return result;
}

}  // namespace drivebench::identification
