#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace drivebench::modbus {

/// The answers to function 43/14: the basic and the regular objects of this device.
class Identification {
 public:
  explicit Identification(const std::string& bench);

  /// The PDU that answers a valid request PDU of function 43/14; empty if the request names a single object
  /// that does not exist.
  std::vector<std::uint8_t> answer(std::span<const std::uint8_t> pdu) const;

 private:
  std::array<std::string, 7> objects_;
};

}  // namespace drivebench::modbus
