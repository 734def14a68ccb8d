#pragma once

#include <modbus/modbus.h>

#include <cstdint>
#include <memory>
#include <optional>

#include "tests/benchmark/harness/child.hpp"

namespace drivebench::speed {

struct FreeModbus {
  void operator()(modbus_t* context) const noexcept {
    ::modbus_close(context);
    ::modbus_free(context);
  }
};
using ModbusContext = std::unique_ptr<modbus_t, FreeModbus>;

/// A client of a server on this computer. Throws if it cannot connect.
ModbusContext connect_modbus(std::uint16_t port);

/// libmodbus as its examples use it: a process that selects, receives and replies. Registers are 0.
class PlainModbusServer {
 public:
  PlainModbusServer();

  std::uint16_t port() const noexcept { return port_; }

 private:
  std::uint16_t port_ = 0;
  std::optional<Child> child_;
};

}  // namespace drivebench::speed
