#include "clients/command/common/session/session.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/session/inproc_axis.hpp"
#include "clients/link/can/can_link.hpp"
#include "clients/link/modbus/modbus_link.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

volatile std::sig_atomic_t interrupt_count = 0;

}  // namespace

link::Link open_link(const LinkChoice& choice, std::string_view subcommand) {
  if (link::is_can_address(choice.address) || link::is_modbus_address(choice.address)) {
    throw UsageError(fmt::format(
        "{} needs a tcp:, tls:, unix: or shm: link; over CAN and Modbus there is only control", subcommand));
  }
  try {
    return link::Link(choice.address, {.client = fmt::format("drivebench {}", subcommand),
                                       .token = choice.token,
                                       .conducts = choice.conducts});
  } catch (const link::RefusalError& refused) {
    throw NotLetIn(fmt::format("{} turns this client away: {}", choice.address, refused.what()));
  }
}

std::unique_ptr<link::AxisLink> open_axis(const LinkChoice& choice, std::string_view axis,
                                          std::string_view subcommand) {
  constexpr std::string_view kInproc = "inproc:";
  if (choice.address.starts_with(kInproc)) {
    return std::make_unique<InprocAxis>(choice.address.substr(kInproc.size()), axis);
  }
  const bool is_can = link::is_can_address(choice.address);
  if (!is_can && !link::is_modbus_address(choice.address)) {
    std::unique_ptr<link::Link> bench(new link::Link(open_link(choice, subcommand)));  // it does not move
    const std::uint32_t number = axis_number(bench->welcome().bench(), axis);
    return std::make_unique<link::TcpAxis>(std::move(bench), number);
  }
  if (axis != "0") {
    throw UsageError(fmt::format("the address names the axis: {}", is_can ? "?node=N" : "?unit=N"));
  }
  try {
    if (is_can) return std::make_unique<link::CanLink>(link::parse_can_address(choice.address));
    return std::make_unique<link::ModbusLink>(link::parse_modbus_address(choice.address));
  } catch (const link::RefusalError& refused) {
    throw NotLetIn(fmt::format("{} turns this client away: {}", choice.address, refused.what()));
  }
}

std::optional<std::uint32_t> find_axis(const v1::BenchDescription& bench, std::string_view choice) {
  for (int i = 0; i < bench.axes_size(); ++i) {
    if (bench.axes(i).name() == choice || fmt::format("{}", i) == choice) {
      return static_cast<std::uint32_t>(i);
    }
  }
  return std::nullopt;
}

std::uint32_t axis_number(const v1::BenchDescription& bench, std::string_view choice) {
  if (const auto number = find_axis(bench, choice)) return *number;
  const std::string known = listed(
      bench.axes(), [n = 0](const auto& axis) mutable { return fmt::format("{} ({})", n++, axis.name()); });
  const std::string nearest =
      did_you_mean(choice, bench.axes(), [](const auto& axis) -> std::string_view { return axis.name(); });
  throw UsageError(fmt::format("no axis '{}'{}; this bench has {}", printable(choice), nearest, known));
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
