#include "protocols/modbus/pdu.hpp"

namespace drivebench::modbus {
namespace {

using Pdu = std::span<const std::uint8_t>;

constexpr std::uint16_t word_at(Pdu pdu, std::size_t at) noexcept {
  return static_cast<std::uint16_t>(pdu[at] << 8 | pdu[at + 1]);
}

PduCheck refuse(Exception exception) noexcept {
  return {.action = PduCheck::Action::kRefuse, .exception = exception, .request = {}};
}

PduCheck close() noexcept {
  return {};
}

PduCheck execute(const Request& request) noexcept {
  return {.action = PduCheck::Action::kExecute, .exception = Exception::kNone, .request = request};
}

bool in_range(std::uint16_t count, std::uint16_t most) noexcept {
  return count >= 1 && count <= most;
}

PduCheck read_bits(Pdu pdu, Request request, std::size_t available) noexcept {
  if (pdu.size() != 5) return close();
  request.read_address = word_at(pdu, 1);
  request.read_count = word_at(pdu, 3);
  if (!in_range(request.read_count, kMaxReadBits)) return refuse(Exception::kIllegalValue);
  if (std::size_t{request.read_address} + request.read_count > available) {
    return refuse(Exception::kIllegalAddress);
  }
  return execute(request);
}

PduCheck read_registers(Pdu pdu, Request request, const RegisterMap& map) noexcept {
  if (pdu.size() != 5) return close();
  request.read_address = word_at(pdu, 1);
  request.read_count = word_at(pdu, 3);
  if (!in_range(request.read_count, kMaxReadRegisters)) return refuse(Exception::kIllegalValue);
  const auto range = map.find(request.read_address, request.read_count);
  if (!range) return refuse(Exception::kIllegalAddress);
  request.read = *range;
  return execute(request);
}

PduCheck write_coil(Pdu pdu, Request request, const RegisterMap& map) noexcept {
  if (pdu.size() != 5) return close();
  request.write_address = word_at(pdu, 1);
  request.write_count = 1;
  request.data = pdu.subspan(3, 1);  // 0xFF or 0x00: its lowest bit is the state
  const std::uint16_t value = word_at(pdu, 3);
  if (value != 0 && value != 0xff00) return refuse(Exception::kIllegalValue);
  if (!map.writable() || request.write_address >= kCoils.size()) return refuse(Exception::kIllegalAddress);
  return execute(request);
}

PduCheck write_coils(Pdu pdu, Request request, const RegisterMap& map) noexcept {
  if (pdu.size() < 6) return close();
  request.write_address = word_at(pdu, 1);
  request.write_count = word_at(pdu, 3);
  const std::size_t bytes = (std::size_t{request.write_count} + 7) / 8;
  if (!in_range(request.write_count, kMaxWriteBits) || pdu[5] != bytes)
    return refuse(Exception::kIllegalValue);
  if (pdu.size() != 6 + bytes) return close();
  request.data = pdu.subspan(6);
  if (!map.writable() || std::size_t{request.write_address} + request.write_count > kCoils.size()) {
    return refuse(Exception::kIllegalAddress);
  }
  const unsigned used = (request.write_count - 1u) % 8 + 1;
  return request.data.back() >> used != 0 ? refuse(Exception::kIllegalValue) : execute(request);
}

/// The part that all writes of registers share.
PduCheck write_words(Request request, const RegisterMap& map) noexcept {
  const auto range = map.find(request.write_address, request.write_count);
  if (!range || !map.may_write(*range)) return refuse(Exception::kIllegalAddress);
  request.write = *range;
  const bool is_mask = request.function == Function::kMaskWriteRegister;
  if (is_mask || values_fit(*range, words_from(request.data))) return execute(request);
  return {.action = PduCheck::Action::kRefuse, .exception = Exception::kIllegalValue, .request = request};
}

PduCheck write_register(Pdu pdu, Request request, const RegisterMap& map) noexcept {
  const bool is_mask = request.function == Function::kMaskWriteRegister;
  if (pdu.size() != (is_mask ? 7u : 5u)) return close();
  request.write_address = word_at(pdu, 1);
  request.write_count = 1;
  request.data = pdu.subspan(3);
  return write_words(request, map);
}

PduCheck write_registers(Pdu pdu, Request request, const RegisterMap& map) noexcept {
  if (pdu.size() < 6) return close();
  request.write_address = word_at(pdu, 1);
  request.write_count = word_at(pdu, 3);
  const std::size_t bytes = std::size_t{request.write_count} * 2;
  if (!in_range(request.write_count, kMaxWriteRegisters) || pdu[5] != bytes) {
    return refuse(Exception::kIllegalValue);
  }
  if (pdu.size() != 6 + bytes) return close();
  request.data = pdu.subspan(6);
  return write_words(request, map);
}

PduCheck read_write_registers(Pdu pdu, Request request, const RegisterMap& map) noexcept {
  if (pdu.size() < 10) return close();
  request.read_address = word_at(pdu, 1);
  request.read_count = word_at(pdu, 3);
  request.write_address = word_at(pdu, 5);
  request.write_count = word_at(pdu, 7);
  const std::size_t bytes = std::size_t{request.write_count} * 2;
  if (!in_range(request.read_count, kMaxReadRegisters) ||
      !in_range(request.write_count, kMaxReadWriteRegisters) || pdu[9] != bytes) {
    return refuse(Exception::kIllegalValue);
  }
  if (pdu.size() != 10 + bytes) return close();
  const auto range = map.find(request.read_address, request.read_count);
  if (!range) return refuse(Exception::kIllegalAddress);
  request.read = *range;
  request.data = pdu.subspan(10);
  return write_words(request, map);
}

/// Function 8: sub-function 0, whose data come back.
PduCheck diagnostics(Pdu pdu, const Request& request) noexcept {
  if (pdu.size() < 3) return close();
  if (word_at(pdu, 1) != 0) return refuse(Exception::kIllegalFunction);
  return pdu.size() < 5 || pdu.size() % 2 == 0 ? refuse(Exception::kIllegalValue) : execute(request);
}

/// Function 43: device identification, MEI type 14.
PduCheck encapsulated(Pdu pdu, const Request& request) noexcept {
  if (pdu.size() < 2) return close();
  if (pdu[1] != 14) return refuse(Exception::kIllegalFunction);
  if (pdu.size() != 4) return close();
  return pdu[2] < 1 || pdu[2] > 4 ? refuse(Exception::kIllegalValue) : execute(request);
}

}  // namespace

PduCheck validate(Pdu pdu, const RegisterMap& map) noexcept {
  if (pdu.empty() || pdu.size() > kMaxPdu) return close();
  const Request request{.function = static_cast<Function>(pdu[0])};
  switch (request.function) {
    case Function::kReadCoils:
      return read_bits(pdu, request, kCoils.size());
    case Function::kReadDiscreteInputs:
      return read_bits(pdu, request, kDiscreteInputs);
    case Function::kReadHoldingRegisters:
    case Function::kReadInputRegisters:
      return read_registers(pdu, request, map);
    case Function::kWriteCoil:
      return write_coil(pdu, request, map);
    case Function::kWriteRegister:
    case Function::kMaskWriteRegister:
      return write_register(pdu, request, map);
    case Function::kWriteCoils:
      return write_coils(pdu, request, map);
    case Function::kWriteRegisters:
      return write_registers(pdu, request, map);
    case Function::kReadWriteRegisters:
      return read_write_registers(pdu, request, map);
    case Function::kDiagnostics:
      return diagnostics(pdu, request);
    case Function::kEncapsulated:
      return encapsulated(pdu, request);
  }
  return refuse(Exception::kIllegalFunction);
}

std::array<std::uint16_t, kMaxReadRegisters> words_from(std::span<const std::uint8_t> data) noexcept {
  std::array<std::uint16_t, kMaxReadRegisters> words{};
  for (std::size_t i = 0; i < data.size() / 2 && i < words.size(); ++i)
    words[i] = word_at(data, 2 * i);
  return words;
}

}  // namespace drivebench::modbus
