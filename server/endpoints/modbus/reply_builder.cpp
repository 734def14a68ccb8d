#include "server/endpoints/modbus/reply_builder.hpp"

#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

#include "protocols/modbus/register_map.hpp"

namespace drivebench::modbus {
namespace {

constexpr std::uint8_t kReadPdu = 5;  // function, address, quantity

}  // namespace

ReplyBuilder::ReplyBuilder() : registers_(65'536), coils_(kCoils.size()), discrete_inputs_(kDiscreteInputs) {
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, sockets_.data()) != 0) {
    throw std::runtime_error(std::string("no socket pair for Modbus: ") + std::strerror(errno));
  }
  // modbus_reply() does not call select(); if it did, a larger descriptor would write out of bounds.
  const bool selectable = std::max(sockets_[0], sockets_[1]) < FD_SETSIZE;
  // The address is needed by the constructor only; nothing is connected.
  context_.reset(selectable ? modbus_new_tcp("127.0.0.1", 1502) : nullptr);
  if (!context_) {
    for (const int socket : sockets_)
      ::close(socket);
    throw std::runtime_error(selectable ? "libmodbus gives no context"
                                        : "too many open files before Modbus could start");
  }
  modbus_set_socket(context_.get(), sockets_[0]);
  modbus_set_response_timeout(context_.get(), 0, 1);  // its sleep before some exceptions
  modbus_set_byte_timeout(context_.get(), 0, 1);
  mapping_ = {.nb_bits = static_cast<int>(coils_.size()),
              .start_bits = 0,
              .nb_input_bits = static_cast<int>(discrete_inputs_.size()),
              .start_input_bits = 0,
              .nb_input_registers = static_cast<int>(registers_.size()),
              .start_input_registers = 0,
              .nb_registers = static_cast<int>(registers_.size()),
              .start_registers = 0,
              .tab_bits = coils_.data(),
              .tab_input_bits = discrete_inputs_.data(),
              .tab_input_registers = registers_.data(),
              .tab_registers = registers_.data()};
}

ReplyBuilder::~ReplyBuilder() {
  context_.reset();
  for (const int socket : sockets_)
    ::close(socket);
}

std::span<const std::uint8_t> ReplyBuilder::reply(std::span<const std::uint8_t> adu) {
  request_.fill(0);  // some versions read a byte or two past a short request
  std::copy(adu.begin(), adu.end(), request_.begin());
  std::size_t length = adu.size();
  const bool exchanges = request_[kMbapSize] == MODBUS_FC_WRITE_AND_READ_REGISTERS;
  if (exchanges) {  // libmodbus would read back the raw words; the request begins like a read
    length = kMbapSize + kReadPdu;
    request_[4] = 0;
    request_[5] = kReadPdu + 1;
    request_[kMbapSize] = MODBUS_FC_READ_HOLDING_REGISTERS;
  }
  if (modbus_reply(context_.get(), request_.data(), static_cast<int>(length), &mapping_) <= 0) return {};
  const ssize_t size = ::recv(sockets_[1], answer_.data(), answer_.size(), 0);
  if (exchanges) answer_[kMbapSize] = MODBUS_FC_WRITE_AND_READ_REGISTERS;
  return size <= 0 ? std::span<const std::uint8_t>{}
                   : std::span<const std::uint8_t>(answer_).first(static_cast<std::size_t>(size));
}

}  // namespace drivebench::modbus
