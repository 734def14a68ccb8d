#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "clients/command/common/programs/process.hpp"
#include "clients/command/common/programs/server_ready.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/recording/recorded_samples.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "clients/command/regression/cases/server_report.hpp"

namespace drivebench::command {

/// A server on the bench of the case. Equal runs have equal recordings: it runs in the folder of the case and
/// knows its socket by a name without a folder, which the recording tells; and in lockstep time stands still
/// from the last tick on, however late the runner sees that.
class RecordedServer {
 public:
  /// Throws std::runtime_error with what the server printed if it does not start.
  RecordedServer(const PreparedCase& prepared, const std::filesystem::path& folder, const RunWishes& wishes);

  /// The address for a controller of the axis with this number.
  std::string link(regression::DeviceUnderTest::Link way = regression::DeviceUnderTest::Link::kUnix,
                   std::size_t axis = 0) const;
  /// The FIFO with the lines for the device under test; empty: there are none.
  const std::string& lines() const noexcept { return lines_; }
  ServerReport end();

 private:
  std::vector<std::string> line_of(const PreparedCase& prepared, const RunWishes& wishes);
  void add_messages(const PreparedCase& prepared, std::vector<std::string>& line);

  std::filesystem::path socket_;
  std::filesystem::path recording_;
  std::filesystem::path log_;
  std::string lines_{};
  Process process_;
  ServerReady ready_{};
};

/// Asks a bench for its newest samples while the device under test drives it.
class BenchView {
 public:
  explicit BenchView(const std::string& address, const std::string& token = {})
      : link_(address, {.client = "drivebench test", .token = token}) {}
  Sample newest(std::size_t axis) { return link_.exchange({})[axis].sample; }

 private:
  link::Link link_;
};

/// What the device under test was told, in the time of the case that begins at this tick of the bench. A
/// message that did not arrive makes the case an error.
void add_messages(const std::vector<SentMessage>& messages, std::uint64_t begin_tick, double period_s,
                  regression::CaseResult& result);

/// The end of what a program wrote.
std::string tail_of(const std::filesystem::path& file);

/// Shows the samples of a recording, a tick at a time, while `see` wants more.
template <class See>
void see_recording(const std::filesystem::path& file, const regression::RunFacts& facts, See see) {
  RecordedSamples recorded(file, facts.axes);
  std::vector<Sample> samples(facts.axes.size());
  while (const auto row = recorded.next()) {
    end_if_interrupted();
    samples[row->axis] = row->sample;
    // A tick brings the axes in their order.
    if (row->axis + 1 == samples.size() && !see(samples)) return;
  }
}

}  // namespace drivebench::command
