#include "clients/command/session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <span>

#include "protocols/sample_codec.hpp"

namespace drivebench::command {
namespace {

volatile std::sig_atomic_t interrupt_count = 0;

}  // namespace

link::Link open_link(const LinkChoice& choice, std::string_view subcommand) {
  try {
    return link::Link(choice.address,
                      {.client = fmt::format("drivebench {}", subcommand), .token = choice.token});
  } catch (const link::Refused& refused) {
    throw link::ConnectError(fmt::format("{} does not let us in: {}", choice.address, refused.what()));
  }
}

std::uint32_t axis_number(const v1::BenchDescription& bench, std::string_view choice) {
  std::string known;
  for (int i = 0; i < bench.axes_size(); ++i) {
    if (bench.axes(i).name() == choice || fmt::format("{}", i) == choice) {
      return static_cast<std::uint32_t>(i);
    }
    known += fmt::format("{}{} ({})", i == 0 ? "" : ", ", i, bench.axes(i).name());
  }
  throw UsageError(fmt::format("no axis '{}'; this bench has {}", choice, known));
}

const v1::Sample& sample_of(const v1::ExchangeReply& reply, std::uint32_t axis) {
  for (const v1::AxisSample& each : reply.samples()) {
    if (each.axis() == axis) return each.sample();
  }
  throw link::LinkError(fmt::format("the bench answered without a sample of axis {}", axis));
}

Sample plain(const v1::Sample& message) {
  const std::string bytes = message.SerializeAsString();
  return decode_sample(std::as_bytes(std::span(bytes))).value_or(Sample{});
}

const char* name_of(v1::Mode mode) noexcept {
  switch (mode) {
    case v1::MODE_REALTIME:
      return "realtime";
    case v1::MODE_LOCKSTEP:
      return "lockstep";
    case v1::MODE_FREE:
      return "free";
    default:
      return "unknown";
  }
}

const char* name_of_state(std::uint64_t state) noexcept {
  constexpr std::array kNames = {"idle", "run", "hold", "timeout", "fault"};
  return state < kNames.size() ? kNames[state] : "unknown";
}

std::string fault_names(const v1::BenchDescription& bench, std::uint64_t faults) {
  std::string names;
  for (const v1::FaultDescription& fault : bench.faults()) {
    if ((faults & fault.bit()) == 0) continue;
    faults &= ~fault.bit();
    names += (names.empty() ? "" : " ") + fault.name();
  }
  if (faults != 0) names += fmt::format("{}{:#x}", names.empty() ? "" : " ", faults);
  return names.empty() ? "none" : names;
}

std::uint64_t latched_faults(const v1::BenchDescription& bench, std::uint64_t faults) {
  std::uint64_t latched = 0;
  for (const v1::FaultDescription& fault : bench.faults()) {
    if (fault.latched()) latched |= fault.bit();
  }
  return faults & latched;
}

void catch_interrupts() {
  for (const int signal : {SIGINT, SIGTERM}) {
    struct sigaction action = {};
    action.sa_handler = [](int) { interrupt_count = interrupt_count + 1; };
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    ::sigaction(signal, &action, nullptr);
  }
}

bool interrupted() noexcept {
  return interrupt_count != 0;
}

Progress::~Progress() {
  if (drawn_) std::fputs("\r\x1b[K", stderr);
}

void Progress::update(double fraction, std::string_view doing) {
  using namespace std::chrono_literals;
  const bool is_terminal = ::isatty(STDERR_FILENO) != 0;
  const Clock::time_point now = Clock::now();
  if (now - started_ < 1s || now - shown_ < (is_terminal ? 100ms : 5000ms)) return;
  shown_ = now;
  const std::string line = fmt::format("{}: {:.0f} % {}", what_, 100.0 * fraction, doing);
  fmt::print(stderr, "{}{}{}", is_terminal ? "\r" : "", line, is_terminal ? "\x1b[K" : "\n");
  drawn_ = is_terminal;
}

}  // namespace drivebench::command
