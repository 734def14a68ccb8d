#include "clients/identification/identify.hpp"

#include <fmt/format.h>

#include <cmath>

#include "clients/identification/motors/bldc_motor.hpp"
#include "clients/identification/motors/dc_motor.hpp"
#include "clients/identification/motors/induction_motor.hpp"
#include "clients/identification/motors/pm_motor.hpp"
#include "clients/identification/refinement/refine.hpp"

namespace drivebench::identification {

Result identify_by_equations(const MeasuredData& data, const Settings& settings) {
  if (!(data.period_s > 0.0 && std::isfinite(data.period_s)))
    throw IdentificationError("the period of the data must be positive");
  if (settings.pole_pairs < 1) throw IdentificationError("pole_pairs must be 1 or more");
  for (const Column& column : data.columns) {
    if (column.values.size() != data.samples())
      throw IdentificationError(fmt::format("column {} has {} samples, the first one {}", column.name,
                                            column.values.size(), data.samples()));
  }
  switch (settings.kind) {
    case MotorKind::kDc:
      return identify_dc_motor(data, settings);
    case MotorKind::kInduction:
      return identify_induction_motor(data, settings);
    case MotorKind::kPmSynchronous:
      return identify_pm_motor(data, settings);
    case MotorKind::kBldc:
      break;
  }
  return identify_bldc_motor(data, settings);
}

Result identify(const MeasuredData& data, const Settings& settings) {
  Result result = identify_by_equations(data, settings);
  refine(data, settings, result);
  return result;
}

}  // namespace drivebench::identification
