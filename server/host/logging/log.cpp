#include "server/host/logging/log.hpp"

#include <spdlog/formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <memory>

#include "server/host/logging/json_log.hpp"

namespace drivebench::log {
namespace {

class JsonFormatter : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    const auto level = spdlog::level::to_string_view(message.level);
    const std::string line = json_log_line(message.time, {level.data(), level.size()},
                                           {message.payload.data(), message.payload.size()});
    out.append(line);
    out.push_back('\n');
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

spdlog::level::level_enum level_of(LogLevel level) {
  constexpr std::array kLevels{spdlog::level::debug, spdlog::level::info, spdlog::level::warn,
                               spdlog::level::err, spdlog::level::off};
  return kLevels[static_cast<std::size_t>(level)];
}

spdlog::logger& logger() {
  static const std::shared_ptr<spdlog::logger> only = spdlog::stderr_logger_mt("drivebench");
  return *only;
}

}  // namespace

void set_level(LogLevel level) {
  logger().set_level(level_of(level));
}

void write_json() {
  logger().set_formatter(std::make_unique<JsonFormatter>());
}

void write(LogLevel level, const std::string& message) {
  logger().log(level_of(level), message);
}

void critical(const std::string& message) {
  logger().critical(message);
}

}  // namespace drivebench::log
