#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "clients/identification/data/measured_data.hpp"
#include "clients/identification/motors/motors.hpp"

namespace drivebench::command {

struct IdentifyOptions;

/// A motor as its measurement shows it: its signals, and the known facts about them.
struct MeasuredMotor {
  identification::MeasuredData data{};
  identification::MeasurementFacts facts{};
  identification::BenchParameters bench{};  ///< empty: the truth is unknown
  std::string source{};                     ///< one line for people
  std::string machine{};                    ///< its kind; empty: unknown
  std::string motor{};                      ///< its name
  std::string drive{};                      ///< its kind; empty: unknown
  int substeps = 1;                         ///< integration steps of the bench in a tick
  std::optional<v1::ExperimentInfo> experiment{};
};

/// Takes the facts about an axis from the description of its bench and from the request: settings of the
/// request override the description, and a value that its events change is unknown.
void take_description(const v1::BenchDescription& bench, std::uint32_t axis, const v1::RunExperiment& request,
                      MeasuredMotor& motor);

/// Samples of one axis of a recording, with the facts in its configuration. Throws UsageError if the axis has
/// no samples, or if ticks are missing between the first and the last one.
MeasuredMotor read_recording(const std::string& file, const std::string& axis);

/// A CSV file; all facts keep their defaults. Throws UsageError "file:line: column: rule".
MeasuredMotor read_foreign(const IdentifyOptions& options);

/// The file of --from, a recording or CSV. Throws UsageError, also for a recording of another kind of
/// machine.
MeasuredMotor read_measurement(const IdentifyOptions& options, const identification::MotorName& motor);

/// Takes `bench`, `machine`, `motor`, `drive` and `substeps` of one axis (empty: the first) from the
/// configuration in a recording. Takes nothing if the text is not a configuration.
void take_configuration(std::string_view toml, const std::string& axis, MeasuredMotor& motor);

/// The data as CSV, as `drivebench export` writes them.
std::string csv_of(const identification::MeasuredData& data);

}  // namespace drivebench::command
