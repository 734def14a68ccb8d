#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/endpoints/can/endpoint.hpp"
#include "server/endpoints/modbus/modbus_server.hpp"
#include "server/endpoints/transport_report.hpp"

namespace drivebench {

/// The transports beside the stream sockets, as configured: every CAN bus, and Modbus.
class Transports {
 public:
  /// Opens them; throws std::runtime_error that names the bus or address that cannot be opened.
  Transports(asio::io_context& io, const BenchConfig& config);

  /// `audit` may be null.
  void serve(Engine& engine, Audit* audit = nullptr);
  std::vector<TransportReport> reports() const;
  void close();

  std::vector<std::string> can_names() const;
  /// can::Endpoint::send_frame() of a bus of the configuration.
  std::string send_frame(std::size_t bus, const can::Frame& frame) { return can_.at(bus)->send_frame(frame); }
  std::string modbus_address() const;  ///< empty: none

 private:
  std::vector<std::unique_ptr<can::Endpoint>> can_;
  std::unique_ptr<ModbusServer> modbus_;
};

}  // namespace drivebench
