#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/experiments/row_file.hpp"

namespace drivebench {

/// Sends the data of an experiment to the client as fast as the socket takes them. A session fetches one
/// experiment at a time.
class Fetch {
 public:
  explicit Fetch(Dialogue& dialogue) : dialogue_(dialogue) {}

  void begin(const v1::FetchExperiment& request);
  /// Sends more. Called when the socket has room again, or an experiment may have more data.
  void go_on();
  /// Called at the end of the session.
  void drop() { under_way_.reset(); }

 private:
  struct UnderWay {
    std::uint64_t id;  ///< the id of the request
    std::shared_ptr<const Experiment> experiment;
    bool recording;
    std::uint64_t next;                ///< row, or byte of the recording
    std::size_t row_bytes;             ///< 1 for a recording
    std::unique_ptr<FileReader> file;  ///< opened for the first data
    ServerClock::time_point last_info;
    int send_buffer_bytes;  ///< of the socket, before and after
  };

  void start(Experiments& experiments, const v1::FetchExperiment& request);
  bool send_some(std::size_t& budget);
  void send_rows(const v1::ExperimentInfo& info, std::uint64_t there);
  void send_state(const v1::ExperimentInfo& info);
  void end();

  Dialogue& dialogue_;
  std::optional<UnderWay> under_way_;
};

}  // namespace drivebench
