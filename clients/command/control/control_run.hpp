#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/control/loop/run.hpp"
#include "clients/link/common/axis_link.hpp"
#include "clients/reference/run_report.hpp"

namespace drivebench::command {

using reference::ControlReport;
using reference::ControlRow;
using reference::TerminalValues;

/// A load torque at a time after the start of the trajectory.
struct LoadAt {
  double load_nm = 0.0;
  double after_s = 0.0;
};

/// The record of a run over a link.
struct ControlRun : reference::RunFacts {
  std::vector<ControlRow> rows{};
  std::vector<double> telemetry{};  ///< of all rows, concatenated
  std::string failure{};
  std::int64_t missed_at_end = 0;  ///< samples after the last row that did not reach the controller
  std::uint64_t late_ticks = 0;
  double wall_s = 0.0;
};

/// Runs a controller over the link, sample by sample, on an axis that is leased and at rest.
/// `counts_per_revolution` converts angles to counts for the report; 0: no encoder. A second of the bench
/// lasts at least `slowness` seconds.
ControlRun run_over(link::AxisLink& bench, control::Run run, const std::vector<LoadAt>& loads,
                    double counts_per_revolution, double slowness = 0.0);

/// The numbers of the report that follow from the rows.
ControlReport summary_of(const ControlRun& run, double period_s);

/// Everything as CSV in the header dialect of export: `tick,time_s,NAME [UNIT]`; the bench's signals have
/// their names in the catalogue, so that `identify --from` reads them, and the controller's telemetry begins
/// with `controller_`. Columns that the link does not carry are left out.
std::string to_csv(const ControlRun& run);

}  // namespace drivebench::command
