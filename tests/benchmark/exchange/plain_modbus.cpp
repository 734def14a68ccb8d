#include "tests/benchmark/exchange/plain_modbus.hpp"

#include <netinet/in.h>
#include <sys/select.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>

#include "clients/link/common/file_descriptor.hpp"
#include "tests/benchmark/harness/machine.hpp"

namespace drivebench::speed {
namespace {

constexpr int kRegisters = 1000;
constexpr int kBacklog = 128;

void serve(modbus_t* context, int listener) {
  modbus_mapping_t* const mapping = ::modbus_mapping_new(0, 0, kRegisters, kRegisters);
  fd_set all;
  FD_ZERO(&all);
  FD_SET(listener, &all);
  for (int last = listener;;) {
    fd_set ready = all;
    if (::select(last + 1, &ready, nullptr, nullptr, nullptr) < 0) return;
    for (int fd = 0; fd <= last; ++fd) {
      if (!FD_ISSET(fd, &ready)) continue;
      if (fd == listener) {
        const int client = ::accept(listener, nullptr, nullptr);
        if (client < 0 || client >= FD_SETSIZE) continue;
        FD_SET(client, &all);
        last = std::max(last, client);
        continue;
      }
      std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> request{};
      ::modbus_set_socket(context, fd);
      const int size = ::modbus_receive(context, request.data());
      if (size > 0) ::modbus_reply(context, request.data(), size, mapping);
      if (size != -1) continue;
      ::close(fd);
      FD_CLR(fd, &all);
    }
  }
}

}  // namespace

ModbusContext connect_modbus(std::uint16_t port) {
  ModbusContext client(::modbus_new_tcp("127.0.0.1", port));
  check(client != nullptr, "modbus_new_tcp");
  ::modbus_set_response_timeout(client.get(), 6, 0);
  check(::modbus_connect(client.get()) == 0, "modbus_connect");
  return client;
}

PlainModbusServer::PlainModbusServer() {
  const ModbusContext context(::modbus_new_tcp("127.0.0.1", 0));
  check(context != nullptr, "modbus_new_tcp");
  const link::FileDescriptor listener(::modbus_tcp_listen(context.get(), kBacklog));
  sockaddr_in address{};
  socklen_t size = sizeof address;
  check(
      listener.is_open() && ::getsockname(listener.get(), reinterpret_cast<sockaddr*>(&address), &size) == 0,
      "modbus_tcp_listen");
  port_ = ntohs(address.sin_port);
  child_.emplace([&] { serve(context.get(), listener.get()); });
}

}  // namespace drivebench::speed
