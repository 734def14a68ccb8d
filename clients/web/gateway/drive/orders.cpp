#include "clients/web/gateway/drive/orders.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "protocols/json.hpp"

namespace drivebench::web {
namespace {

constexpr double kLargest = 1e6;    // of a set-point, as in the bench's own rule
constexpr double kSteepest = 1e12;  // of an amplitude over the frequency
constexpr double kLongestRamp_s = 3600.0;
constexpr double kMostSteps = 1e6;
constexpr double kMostNumber = 1e15;

struct GatesWord {
  v1::Gates gates;
  std::string_view word;
};
constexpr std::array<GatesWord, 4> kGatesWords = {{{v1::GATES_OFF, "off"},
                                                   {v1::GATES_VOLTAGE, "voltage"},
                                                   {v1::GATES_CURRENT, "current"},
                                                   {v1::GATES_DUTY, "duty"}}};

const nlohmann::json& member_of(const nlohmann::json& object, const char* name) {
  const auto member = object.is_object() ? object.find(name) : object.end();
  if (member == object.end()) throw OrderError(fmt::format("{}: is missing", name));
  return *member;
}

double number_in(const nlohmann::json& value, const char* name, double least, double most) {
  if (!value.is_number() || !(value.get<double>() >= least && value.get<double>() <= most))
    throw OrderError(
        fmt::format("{}: {} is no number from {} to {}", name, ascii_json_text(value), least, most));
  return value.get<double>();
}

double number_of(const nlohmann::json& object, const char* name, double least, double most) {
  return number_in(member_of(object, name), name, least, most);
}

std::uint64_t count_of(const nlohmann::json& object, const char* name, double least, double most) {
  const double value = number_of(object, name, least, most);
  if (value != static_cast<double>(static_cast<std::uint64_t>(value)))
    throw OrderError(fmt::format("{}: {} is no whole number", name, value));
  return static_cast<std::uint64_t>(value);
}

v1::Gates gates_of(const nlohmann::json& object) {
  const nlohmann::json& word = member_of(object, "gates");
  const auto row =
      std::ranges::find_if(kGatesWords, [&word](const GatesWord& each) { return word == each.word; });
  if (row == kGatesWords.end())
    throw OrderError(
        fmt::format("gates: {} is not one of off, voltage, current, duty", ascii_json_text(word)));
  return row->gates;
}

link::Setpoints constant_of(const nlohmann::json& object) {
  const nlohmann::json& list = member_of(object, "constant");
  if (!list.is_array() || list.size() != 4) throw OrderError("constant: is no list of four numbers");
  const auto at = [&list](std::size_t i) { return number_in(list[i], "constant", -kLargest, kLargest); };
  return {.a = at(0), .b = at(1), .c = at(2), .f = at(3)};
}

std::string text_of(const nlohmann::json& object, const char* name) {
  const nlohmann::json& text = member_of(object, name);
  if (!text.is_string()) throw OrderError(fmt::format("{}: {} is no text", name, ascii_json_text(text)));
  return text.get<std::string>();
}

std::uint32_t axis_number_of(const nlohmann::json& object, std::size_t axis_count) {
  return static_cast<std::uint32_t>(count_of(object, "axis", 0.0, static_cast<double>(axis_count) - 1.0));
}

Order::Axis axis_of(const nlohmann::json& object, std::size_t axis_count) {
  const std::uint32_t axis = axis_number_of(object, axis_count);
  if (object.contains("preset"))
    return {
        .axis = axis, .preset = text_of(object, "preset"), .run = count_of(object, "run", 1.0, kMostNumber)};
  return {.axis = axis,
          .target = {.gates = gates_of(object),
                     .constant = constant_of(object),
                     .boost = number_of(object, "boost", -kLargest, kLargest),
                     .per_hz = number_of(object, "per_hz", -kSteepest, kSteepest),
                     .frequency_hz = number_of(object, "frequency_hz", -kLargest, kLargest),
                     .ramp_s = number_of(object, "ramp_s", 0.0, kLongestRamp_s)}};
}

std::vector<Order::Axis> axes_of(const nlohmann::json& message, std::size_t axis_count) {
  const nlohmann::json& list = member_of(message, "axes");
  if (!list.is_array()) throw OrderError("axes: is no list");
  std::vector<Order::Axis> axes;
  axes.reserve(std::min(list.size(), axis_count));
  for (const nlohmann::json& each : list) {
    Order::Axis axis = axis_of(each, axis_count);
    const auto is_same = [&axis](const Order::Axis& other) { return other.axis == axis.axis; };
    if (std::ranges::any_of(axes, is_same)) throw OrderError(fmt::format("axis: {} comes twice", axis.axis));
    axes.push_back(axis);
  }
  return axes;
}

Order order_of(const nlohmann::json& message, std::size_t axis_count) {
  const nlohmann::json& op = member_of(message, "op");
  Order order;
  if (op == "drive") {
    order.kind = Order::Kind::kDrive;
    order.axes = axes_of(message, axis_count);
  } else if (op == "pace") {
    order.kind = Order::Kind::kPace;
    order.pace = number_of(message, "pace", 0.0, 1.0);
  } else if (op == "step") {
    order.kind = Order::Kind::kStep;
    order.ticks = count_of(message, "ticks", 1.0, kMostSteps);
  } else if (op == "presets") {
    order.kind = Order::Kind::kPresets;
  } else if (op == "run_suite") {
    order.kind = Order::Kind::kRunSuite;
    order.suite = text_of(message, "suite");
  } else if (op == "identify") {
    order.kind = Order::Kind::kIdentify;
    order.identification = {.experiment = count_of(message, "experiment", 0.0, kMostNumber),
                            .owner = text_of(message, "owner"),
                            .axis = axis_number_of(message, axis_count),
                            .motor = text_of(message, "motor")};
  } else if (op == "cancel_run") {
    order.kind = Order::Kind::kCancelRun;
    order.run = count_of(message, "run", 0.0, kMostNumber);
  } else if (op != "alive") {
    throw OrderError(
        fmt::format("op: {} is not one of drive, pace, step, presets, alive, run_suite, "
                    "identify, cancel_run",
                    ascii_json_text(op)));
  }
  return order;
}

}  // namespace

Order parse_order(std::string_view text, std::size_t axis_count) {
  try {
    return order_of(parse_json(text), axis_count);
  } catch (const nlohmann::json::exception&) {  // also a number beyond a double
    throw OrderError("the text is not JSON");
  }
}

std::string_view word_of(v1::Gates gates) noexcept {
  const auto row = std::ranges::find(kGatesWords, gates, &GatesWord::gates);
  return row == kGatesWords.end() ? std::string_view() : row->word;
}

}  // namespace drivebench::web
