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

/// Signals of a motor, and all that is known about them.
struct Measurement {
  identification::MeasuredData data{};
  identification::MeasurementFacts facts{};
  identification::BenchParameters bench{};  ///< empty: the truth is not known
  std::string source{};                     ///< one line for people
  std::string machine{};                    ///< its kind; empty: not known
  std::string motor{};                      ///< its name
  std::string drive{};                      ///< its kind; empty: not known
  int substeps = 1;                         ///< integration steps of the bench in a tick
  std::optional<v1::ExperimentInfo> experiment{};
};

/// What a bench says about one of its axes, and a request changes about it: its settings hold, what its
/// events change is not known.
void take_description(const v1::BenchDescription& bench, std::uint32_t axis, const v1::RunExperiment& request,
                      Measurement& measurement);

/// Samples of one axis of a recording, with what its configuration says. Throws UsageError if there are none,
/// or if ticks are missing between the first and the last of them.
Measurement read_recording(const std::string& file, const std::string& axis);

/// A CSV file; the facts stay what they are by default. Throws UsageError "file:line: column: rule".
Measurement read_foreign(const IdentifyOptions& options);

/// What the configuration that recordings carry says about one axis (empty: the first): `bench`, `machine`,
/// `motor`, `drive`, `substeps`. Nothing if the text is none.
void take_configuration(std::string_view toml, const std::string& axis, Measurement& measurement);

/// The data as CSV, as `drivebench export` writes them.
std::string csv_of(const identification::MeasuredData& data);

}  // namespace drivebench::command
