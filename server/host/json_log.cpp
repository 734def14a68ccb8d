#include "server/host/json_log.hpp"

#include <spdlog/formatter.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "server/host/wall_time.hpp"

namespace drivebench {
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

}  // namespace

std::string json_log_line(std::chrono::system_clock::time_point time, std::string_view level,
                          std::string_view message) {
  nlohmann::ordered_json line;
  line["time"] = rfc3339(time);
  line["level"] = level;
  line["message"] = message;
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

void log_as_json() {
  spdlog::set_formatter(std::make_unique<JsonFormatter>());
}

}  // namespace drivebench
