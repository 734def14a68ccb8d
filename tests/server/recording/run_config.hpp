#pragma once

#include <unistd.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "server/config/config.hpp"
#include "tests/plant/servo_axis.hpp"
#include "tests/server/parameter_row.hpp"

namespace drivebench {

/// A bench with this many servo axes, noise on the currents, and nothing that needs a file.
inline BenchConfig servo_bench(std::size_t axes = 1) {
  BenchConfig config;
  config.name = "test";
  config.setup.command_delay_ticks = 0;
  config.realtime.priority = 0;
  for (std::size_t i = 0; i < axes; ++i) {
    AxisSetup axis{.parameters = servo_axis()};
    axis.parameters.sensors.current.noise_rms_a = 0.01;
    config.setup.axes.push_back(axis);
    config.axes.push_back({.name = "axis" + std::to_string(i),
                           .motor = "servo",
                           .can_node = static_cast<std::uint32_t>(i + 1),
                           .events = {}});
  }
  return config;
}

inline Command voltage(Tick answers, double a_v, double b_v) {
  return {.answers = answers, .phases = {.gates = Gates::kVoltage, .setpoint = {.a = a_v, .b = b_v}}};
}

/// A folder that is removed with the test.
class TestFolder {
 public:
  TestFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "drivebench-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::filesystem::filesystem_error("mkdtemp", {});
    path_ = name;
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;
  std::filesystem::path operator/(const char* name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline std::vector<std::byte> content_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(in), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

}  // namespace drivebench
