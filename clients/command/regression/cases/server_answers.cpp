#include "clients/command/regression/cases/server_answers.hpp"

#include <nlohmann/json.hpp>

#include "protocols/json.hpp"

namespace drivebench::command {

std::optional<std::vector<AnswerTimes>> parse_answers(std::string_view line) {
  try {
    const nlohmann::json object = parse_json(line);
    if (object.value("event", std::string()) != "verdict" || !object.contains("answers")) return std::nullopt;
    std::vector<AnswerTimes> answers;
    answers.reserve(object.at("answers").size());
    for (const nlohmann::json& axis : object.at("answers"))
      answers.push_back(answer_times_of(axis));
    return answers;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

}  // namespace drivebench::command
