#include "clients/command/regression/cases/server_report.hpp"

#include <nlohmann/json.hpp>

#include "protocols/json.hpp"

namespace drivebench::command {

std::optional<ServerReport> parse_report(std::string_view line) {
  try {
    const nlohmann::json object = parse_json(line);
    if (object.value("event", std::string()) != "verdict") return std::nullopt;
    ServerReport report;
    for (const nlohmann::json& axis : object.value("answers", nlohmann::json::array()))
      report.answers.push_back(answer_times_of(axis));
    for (const nlohmann::json& each : object.value("messages", nlohmann::json::array())) {
      report.messages.push_back({.tick = each.at("tick").get<std::uint64_t>(),
                                 .text = each.at("text").get<std::string>(),
                                 .problem = each.at("problem").get<std::string>()});
    }
    return report;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace drivebench::command
