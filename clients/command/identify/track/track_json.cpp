#include <algorithm>
#include <cmath>

#include "clients/command/common/basics/json.hpp"
#include "clients/command/identify/track/track_report.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {

std::string track_row_json(const TrackRow& row) {
  const identification::ResistanceEstimate& e = row.estimate;
  const auto parameter = [&](const char* name, double value, double interval, double TrackTruth::*truth) {
    const bool seen = std::ranges::find(e.excitation.unseen, name) == e.excitation.unseen.end();
    const auto number = [seen](double x) { return seen && std::isfinite(x) ? Json(x) : Json(nullptr); };
    return Json{{"estimate", number(value)},
                {"interval", number(interval)},
                {"truth", row.truth ? Json(*row.truth.*truth) : Json(nullptr)}};
  };
  return json_text(Json{{"time_s", row.time_s},
                        {"R_S", parameter("R_S", e.stator_resistance_ohm, e.stator_interval_ohm,
                                          &TrackTruth::stator_resistance_ohm)},
                        {"T_R", parameter("T_R", e.rotor_time_constant_s, e.rotor_interval_s,
                                          &TrackTruth::rotor_time_constant_s)},
                        {"verdict", e.excitation.verdict}});
}

std::string track_gap_json(std::uint64_t missing, double time_s) {
  return json_text(Json{{"time_s", time_s}, {"missing", missing}});
}

}  // namespace drivebench::command
