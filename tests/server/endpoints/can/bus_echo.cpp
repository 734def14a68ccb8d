// A node on a virtual bus for test_virtual_buses.py: bus_echo BACKEND CHANNEL PORT
// Answers every frame with the same one under the next identifier; the frame kBurstRequest with as many
// frames as its first two bytes say (low byte first), sent at once, identifiers counting up from 0. Prints
// the name of the bus when it is open and the counters of the bus for each line that comes in on standard
// input; ends with that.

#include <charconv>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <string_view>

#include "server/endpoints/can/buses/backends.hpp"
#include "server/host/asio.hpp"
#include "server/host/logging/log.hpp"

namespace {

using namespace drivebench;

constexpr std::uint32_t kBurstRequest = 0x1FFFFFF0;

std::unique_ptr<can::Bus> open(asio::io_context& io, std::string_view backend, const CanConfig& config) {
  if (backend == "slcan") return can::make_slcan_bus(io, config);
  if (backend == "socketcand") return can::make_socketcand_bus(io, config);
  return can::make_udp_multicast_bus(io, config);
}

void answer(can::Bus& bus, can::Frame frame) {
  if (frame.id != kBurstRequest) {
    ++frame.id;
    return bus.send(frame);
  }
  const std::uint32_t count = frame.data[0] + 256u * frame.data[1];
  for (std::uint32_t id = 0; id < count; ++id)
    bus.send({.id = id, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}});
}

/// Prints the counters for each line of standard input and ends with it.
void serve_console(asio::io_context& io, asio::posix::stream_descriptor& console, can::Bus& bus) {
  console.async_wait(asio::posix::stream_descriptor::wait_read, [&](const boost::system::error_code& error) {
    char byte = 0;
    if (error || ::read(console.native_handle(), &byte, 1) != 1) return io.stop();
    const can::BusStatus& status = bus.status();
    if (byte == '\n') {
      std::printf(
          "sent=%llu received=%llu send_dropped=%llu receive_dropped=%llu malformed=%llu up=%d\n",
          static_cast<unsigned long long>(status.sent), static_cast<unsigned long long>(status.received),
          static_cast<unsigned long long>(status.send_dropped),
          static_cast<unsigned long long>(status.receive_dropped),
          static_cast<unsigned long long>(status.malformed), status.state == can::BusState::kUp ? 1 : 0);
    }
    serve_console(io, console, bus);
  });
}

}  // namespace

int main(int count, char** arguments) try {
  if (count != 4) return 2;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  drivebench::log::set_level(drivebench::LogLevel::kOff);
  CanConfig config;
  config.channel = arguments[2];
  std::from_chars(arguments[3], arguments[3] + std::strlen(arguments[3]), config.port);
  asio::io_context io;
  const auto bus = open(io, arguments[1], config);
  bus->on_frame = [&bus](const can::Frame& frame, std::int64_t) { answer(*bus, frame); };
  asio::posix::stream_descriptor console(io, ::dup(STDIN_FILENO));
  serve_console(io, console, *bus);
  std::printf("%s\n", bus->name().c_str());
  io.run();
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
