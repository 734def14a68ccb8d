#include "server/host/logging/json_log.hpp"

#include <nlohmann/json.hpp>

#include "protocols/json.hpp"
#include "server/host/wall_time.hpp"

namespace drivebench {

std::string json_log_line(std::chrono::system_clock::time_point time, std::string_view level,
                          std::string_view message) {
  nlohmann::ordered_json line;
  line["time"] = rfc3339(time);
  line["level"] = level;
  line["message"] = message;
  return json_text(line);
}

}  // namespace drivebench
