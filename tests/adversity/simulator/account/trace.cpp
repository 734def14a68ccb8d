#include "tests/adversity/simulator/account/trace.hpp"

#include <cstdio>

namespace drivebench::simulator {

void Trace::add(Time time, const char* what, std::uint64_t source, std::uint64_t a, std::uint64_t b) {
  const auto mix = [this](std::uint64_t word) {
    hash_ = (hash_ ^ word) * 0x9E3779B97F4A7C15u;
    hash_ ^= hash_ >> 29;
  };
  mix(static_cast<std::uint64_t>(time));
  for (const char* c = what; *c != '\0'; ++c)
    mix(static_cast<std::uint8_t>(*c));
  mix(source);
  mix(a);
  mix(b);
  Event& event = last_[count_++ % last_.size()];
  event = {.time = time, .what = what, .source = source, .a = a, .b = b};
  if (prints_) std::printf("%s\n", text_of(event).c_str());
}

std::string Trace::tail() const {
  std::string text;
  const std::uint64_t size = count_ < last_.size() ? count_ : last_.size();
  for (std::uint64_t i = count_ - size; i < count_; ++i)
    text += "  " + text_of(last_[i % last_.size()]) + "\n";
  return text;
}

std::string Trace::text_of(const Event& event) {
  char line[160];
  std::snprintf(line, sizeof(line), "%14.6f ms  %-28s #%llu  %llu %llu",
                static_cast<double>(event.time) * 1e-6, event.what,
                static_cast<unsigned long long>(event.source), static_cast<unsigned long long>(event.a),
                static_cast<unsigned long long>(event.b));
  return line;
}

}  // namespace drivebench::simulator
