#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>

#include "clients/command/commands.hpp"
#include "clients/command/json.hpp"
#include "clients/command/output.hpp"
#include "clients/command/session.hpp"
#include "clients/link/can_bus.hpp"
#include "protocols/can/candump.hpp"

namespace drivebench::command {

int run_can_log(const CanLogOptions& options) {
  using namespace std::chrono_literals;
  using Clock = link::CanBus::Clock;
  if (!link::is_can_address(options.address)) {
    throw UsageError(fmt::format("can-log needs a link like can:socketcan:vcan0, not '{}'", options.address));
  }
  const link::CanAddress address = link::parse_can_address(options.address);
  const auto bus = link::open_can_bus(address, 5s);
  // A trace names an interface; what is none has the name of its kind.
  const std::string interface =
      address.backend == link::CanBackend::kSocketCan ? address.channel : link::name_of(address.backend);
  Output out(options.out_file);

  catch_interrupts();
  const auto limit =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.duration_s));
  const Clock::time_point end = options.duration_s > 0.0 ? Clock::now() + limit : Clock::time_point::max();
  std::uint64_t frames = 0;
  std::string text;
  while (!interrupted() && Clock::now() < end && (options.count == 0 || frames < options.count)) {
    auto frame = bus->receive(Clock::time_point::min());
    if (!frame) {
      out.write(text);  // before a pause, so that who follows the file sees it
      out.flush();
      text.clear();
      frame = bus->receive(std::min(end, Clock::now() + 100ms));
    }
    if (!frame) continue;
    const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
    can::append_candump(text, now.count(), interface, *frame);
    ++frames;
  }
  out.write(text);
  out.flush();
  fmt::print(stderr, "can-log: {} frames\n", frames);
  return kExitOk;
}

}  // namespace drivebench::command
