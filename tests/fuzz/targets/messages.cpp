// A file of messages is refused with places and rules, or every message has a text and fits the bench.
#include <string_view>

#include "server/messages/device_message.hpp"
#include "tests/fuzz/fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  BenchConfig config;
  config.axes.push_back({.name = "one", .motor = {}, .events = {}});
  config.axes.push_back({.name = "two", .motor = {}, .can_node = 2, .events = {}});
  config.can.resize(2);
  config.can[1].profile.fd = true;
  try {
    for (const DeviceMessage& message : parse_messages(text, "messages.toml", config)) {
      fuzz::require(!text_of(message).empty(), "a message can be told");
      fuzz::require(!message.trigger || message.trigger->axis < 2,
                    "a condition is about an axis of the bench");
      const auto* const frame = std::get_if<FrameMessage>(&message.content);
      if (frame == nullptr) continue;
      fuzz::require(frame->bus < 2, "a frame has a bus of the bench");
      fuzz::require(frame->frame.size <= (frame->frame.fd ? 64 : 8), "a frame is not too long");
    }
  } catch (const ConfigError& error) {
    fuzz::require(!error.problems().empty(), "a refusal has reasons");
    for (const ConfigProblem& problem : error.problems())
      fuzz::require(!problem.rule.empty() && problem.line >= 0, "a reason is a sentence with a place");
  }
  return 0;
}
