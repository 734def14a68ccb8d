#pragma once

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/command/common/programs/process.hpp"
#include "plant/math/frames.hpp"
#include "server/config/config.hpp"

namespace drivebench::speed {

/// A bench file of the product.
BenchConfig bench_config(const std::string& name);

/// Two-phase voltages of the line start: 80 V at 60 Hz, from which the servo turns with 125.4 rad/s. Sampled
/// at 8 kHz; three periods, after which it repeats.
const std::vector<TwoPhase>& line_voltages();

/// drivebench-server as a process of its own.
class Server {
 public:
  /// Starts it with these arguments and --json, and waits until it is ready.
  explicit Server(std::vector<std::string> arguments);

  const std::string& address() const { return address_; }
  /// 0: without Modbus.
  std::uint16_t modbus_port() const { return modbus_port_; }

  /// Waits for the end of a run of given length; its verdict.
  nlohmann::json wait(std::chrono::seconds at_most);
  /// Ends the run; its verdict.
  nlohmann::json stop();

 private:
  command::Process process_;
  std::string address_;
  std::uint16_t modbus_port_ = 0;
};

}  // namespace drivebench::speed
