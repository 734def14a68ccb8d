#pragma once

#include <modbus/modbus.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "protocols/modbus/mbap.hpp"

namespace drivebench::modbus {

/// Lets libmodbus carry out requests that have been validated. It writes its answer into one end of a private
/// socket pair, so that it never sees, waits for or selects on the socket of a client.
class ReplyBuilder {
 public:
  /// Throws std::runtime_error if the system gives no socket pair below descriptor 1024.
  ReplyBuilder();
  ~ReplyBuilder();
  ReplyBuilder(const ReplyBuilder&) = delete;
  ReplyBuilder& operator=(const ReplyBuilder&) = delete;

  /// The values that a request reads, by the address in the request; the caller fills them in. libmodbus
  /// stores its writes here too, and nothing reads those.
  std::span<std::uint16_t> registers() noexcept { return registers_; }
  std::span<std::uint8_t> coils() noexcept { return coils_; }
  std::span<std::uint8_t> discrete_inputs() noexcept { return discrete_inputs_; }

  /// The answer to a frame, header included; empty if libmodbus gives none. Holds until the next call.
  std::span<const std::uint8_t> reply(std::span<const std::uint8_t> adu);

 private:
  struct Free {
    void operator()(modbus_t* context) const noexcept { modbus_free(context); }
  };

  std::vector<std::uint16_t> registers_;
  std::vector<std::uint8_t> coils_;
  std::vector<std::uint8_t> discrete_inputs_;
  std::array<int, 2> sockets_{-1, -1};
  std::unique_ptr<modbus_t, Free> context_;
  modbus_mapping_t mapping_{};
  std::array<std::uint8_t, kMaxAdu> request_{};
  std::array<std::uint8_t, kMaxAdu> answer_{};
};

}  // namespace drivebench::modbus
