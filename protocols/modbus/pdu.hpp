#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "protocols/modbus/register_map.hpp"
#include "protocols/refusals.hpp"

namespace drivebench::modbus {

enum class Function : std::uint8_t {
  kReadCoils = 1,
  kReadDiscreteInputs = 2,
  kReadHoldingRegisters = 3,
  kReadInputRegisters = 4,
  kWriteCoil = 5,
  kWriteRegister = 6,
  kDiagnostics = 8,
  kWriteCoils = 15,
  kWriteRegisters = 16,
  kMaskWriteRegister = 22,
  kReadWriteRegisters = 23,
  kEncapsulated = 43,
};

inline constexpr std::uint16_t kMaxReadBits = 2000;
inline constexpr std::uint16_t kMaxReadRegisters = 125;
inline constexpr std::uint16_t kMaxWriteBits = 1968;
inline constexpr std::uint16_t kMaxWriteRegisters = 123;
inline constexpr std::uint16_t kMaxReadWriteRegisters = 121;  ///< the limit of the write in function 23
inline constexpr std::size_t kMaxPdu = 253;

/// A valid request. The function codes behind a member are those that use it.
struct Request {
  Function function{};
  RegisterMap::Range read{};       ///< 3, 4, 23
  RegisterMap::Range write{};      ///< 6, 16, 22, 23
  std::uint16_t read_address = 0;  ///< as received: 1 to 4, 23
  std::uint16_t read_count = 0;
  std::uint16_t write_address = 0;  ///< as received: 5, 6, 15, 16, 22, 23
  std::uint16_t write_count = 0;
  std::span<const std::uint8_t> data{};  ///< the written words or packed bits; 22: the two masks
};

constexpr bool writes(Function function) noexcept {
  switch (function) {
    case Function::kWriteCoil:
    case Function::kWriteRegister:
    case Function::kWriteCoils:
    case Function::kWriteRegisters:
    case Function::kMaskWriteRegister:
    case Function::kReadWriteRegisters:
      return true;
    default:
      return false;
  }
}

/// The result of validate(): the reaction to a PDU.
struct PduCheck {
  enum class Action : std::uint8_t {
    kExecute,
    kRefuse,  ///< answer with the exception
    kClose,   ///< the PDU has the wrong length for its function: later bytes of the stream cannot be trusted
  };
  Action action = Action::kClose;
  Exception exception = Exception::kNone;
  Request request;  ///< empty when refused, except for a wrong value of a writable register
};

/// Checks a whole PDU in the order of the protocol specification V1.1b3: quantity, address, value. The axis
/// checks the rest: lease, faults, rules between parameters, the result of a mask.
PduCheck validate(std::span<const std::uint8_t> pdu, const RegisterMap& map) noexcept;

/// The words of `data`, most significant byte first.
std::array<std::uint16_t, kMaxReadRegisters> words_from(std::span<const std::uint8_t> data) noexcept;

}  // namespace drivebench::modbus
