#include "server/endpoints/can/buses/virtual_bus.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <system_error>

#include "server/host/logging/log.hpp"

namespace drivebench::can {
namespace {

constexpr auto kReopenPeriod = std::chrono::milliseconds(500);

}  // namespace

void VirtualBus::start() {
  const std::string problem = open();
  if (problem.empty()) return set_state(BusState::kUp);
  if (config_.required) throw std::runtime_error("cannot open " + name() + ": " + problem);
  lost(problem);
}

void VirtualBus::lost(const std::string& why) {
  log::warn("{} is not there, waiting for it: {}", name(), why);
  set_state(BusState::kAbsent);
  try_later();
}

void VirtualBus::try_later() {
  retry_.expires_after(kReopenPeriod);
  retry_.async_wait([this, alive = alive()](const boost::system::error_code& error) {
    if (alive.expired() || error) return;
    if (!open().empty()) return try_later();
    log::info("{} is there", name());
    set_state(BusState::kUp);
  });
}

void VirtualBus::set_state(BusState state) {
  if (status_.state == state) return;
  status_.state = state;
  if (on_state) on_state();
}

void VirtualBus::set_filter(const std::vector<std::uint32_t>& ids) {
  filter_ = ids;
  std::ranges::sort(filter_);
  filtered_ = true;
}

void VirtualBus::deliver(const Frame& frame, std::int64_t stamp_ns) {
  if (frame.error) {
    ++status_.error_frames;
    return;
  }
  ++status_.received;
  if (filtered_ && !std::ranges::binary_search(filter_, frame.id)) return;
  if (on_frame) on_frame(frame, stamp_ns);
}

std::string reason() {
  return std::system_category().message(errno);
}

double realtime_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

bool adopt(asio::posix::stream_descriptor& stream, int fd) {
  boost::system::error_code error;
  stream.assign(fd, error);
  if (!error) return true;
  ::close(fd);
  errno = error.value();
  return false;
}

}  // namespace drivebench::can
