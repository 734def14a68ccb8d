#pragma once

#include <cstdint>

/// Modbus clients that misbehave, each for a process of its own, with an address of its own within
/// 127.0.0.0/8. They connect again when they are cut off, and never return.
namespace drivebench::speed {

/// Sends requests of a function that does not exist, sixteen at a time, as fast as they are answered.
[[noreturn]] void flood_with_illegal_functions(std::uint16_t port) noexcept;

/// A hundred connections, on each of which a frame comes byte by byte, one in 450 ms: within the 500 ms that
/// libmodbus waits for the next.
[[noreturn]] void drip(std::uint16_t port) noexcept;

}  // namespace drivebench::speed
