#include "clients/command/can/can_log.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/can/can_bus.hpp"
#include "protocols/can/formats/candump.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;
using Clock = link::CanBus::Clock;

/// Frames on their way into a file.
class Trace {
 public:
  Trace(const std::string& file, std::string interface) : out_(file), interface_(std::move(interface)) {}

  void add(const can::Frame& frame) {
    constexpr std::size_t kPiece = std::size_t{1} << 16;
    const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
    can::append_candump(text_, now.count(), interface_, frame);
    ++frames_;
    if (text_.size() > kPiece) flush();
  }
  void flush() {
    out_.write(text_);
    out_.flush();
    text_.clear();
  }
  void finish() {
    flush();
    fmt::print(stderr, "can-log: {} frames\n", frames_);
  }
  std::uint64_t frames() const noexcept { return frames_; }

 private:
  Output out_;
  std::string interface_;
  std::string text_;
  std::uint64_t frames_ = 0;
};

void follow(link::CanBus& bus, const CanLogOptions& options, Trace& trace) {
  const auto limit =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.duration_s));
  const Clock::time_point end = options.duration_s > 0.0 ? Clock::now() + limit : Clock::time_point::max();
  while (!interrupted() && Clock::now() < end && (options.count == 0 || trace.frames() < options.count)) {
    auto frame = bus.receive(Clock::time_point::min());
    if (!frame) {
      trace.flush();  // before a pause, so that `tail -f` shows it
      frame = bus.receive(std::min(end, Clock::now() + 100ms));
    }
    if (frame) trace.add(*frame);
  }
}

}  // namespace

int run_can_log(const CanLogOptions& options) {
  if (!link::is_can_address(options.address)) {
    throw UsageError(fmt::format("can-log needs a link like can:socketcan:vcan0, not '{}'", options.address));
  }
  const link::CanAddress address = link::parse_can_address(options.address);
  const auto bus = link::open_can_bus(address, 5s);
  // A trace names an interface; any other bus has the name of its back end.
  Trace trace(options.out_file, address.backend == can::Backend::kSocketCan
                                    ? address.channel
                                    : std::string(can::name_of(address.backend)));
  catch_interrupts();
  try {
    follow(*bus, options, trace);
  } catch (const link::LinkError&) {
    trace.finish();  // the last frames often show why the bus broke
    throw;
  }
  trace.finish();
  return kExitOk;
}

}  // namespace drivebench::command
