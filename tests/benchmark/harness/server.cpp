#include "tests/benchmark/harness/server.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "clients/command/common/programs/installation.hpp"

namespace drivebench::speed {
namespace {

std::vector<std::string> command_line(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), command::server_executable().string());
  arguments.insert(arguments.end(), {"--json", "--port", "0"});
  return arguments;
}

}  // namespace

BenchConfig bench_config(const std::string& name) {
  return load_config(command::find_config(name));
}

const std::vector<TwoPhase>& line_voltages() {
  static const std::vector<TwoPhase> table = [] {
    std::vector<TwoPhase> voltages(400);
    for (std::size_t k = 0; k < voltages.size(); ++k) {
      const double angle_rad = 2.0 * std::numbers::pi * 60.0 * static_cast<double>(k) / 8000.0;
      voltages[k] = {80.0 * std::cos(angle_rad), 80.0 * std::sin(angle_rad)};
    }
    return voltages;
  }();
  return table;
}

Server::Server(std::vector<std::string> arguments) : process_(command_line(std::move(arguments))) {
  const auto line = process_.read_line(command::Process::in(std::chrono::seconds(10)));
  if (!line) throw std::runtime_error("drivebench-server did not get ready");
  const nlohmann::json ready = nlohmann::json::parse(*line);
  address_ = "tcp:" + ready.at("tcp").get<std::string>();
  const std::string modbus = ready.at("modbus").get<std::string>();
  if (!modbus.empty()) {
    modbus_port_ = static_cast<std::uint16_t>(std::stoi(modbus.substr(modbus.rfind(':') + 1)));
  }
}

nlohmann::json Server::wait(std::chrono::seconds at_most) {
  const auto deadline = command::Process::in(at_most);
  const auto line = process_.read_line(deadline);
  const auto exit_code = process_.wait(deadline);
  if (!line || exit_code != 0) throw std::runtime_error("drivebench-server failed");
  return nlohmann::json::parse(*line);
}

nlohmann::json Server::stop() {
  process_.terminate();
  return wait(std::chrono::seconds(10));
}

}  // namespace drivebench::speed
