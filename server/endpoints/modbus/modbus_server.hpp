#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/config/config.hpp"
#include "server/endpoints/modbus/connection.hpp"
#include "server/endpoints/transport_report.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// Serves the axes over Modbus TCP. The register map is protocols/modbus/register_map.hpp.
class ModbusServer {
 public:
  /// Listens at once; throws std::runtime_error that names the address if that fails.
  ModbusServer(asio::io_context& io, const ModbusConfig& config);
  ~ModbusServer();

  /// Address and port that the system gave, "127.0.0.1:1502".
  std::string address() const;

  /// Starts accepting clients of this run. `audit` may be null.
  void serve(Engine& engine, Audit* audit = nullptr);

  /// Serves a client on a connected socket.
  void start(asio::ip::tcp::socket socket);

  /// Stops accepting and ends every connection.
  void close();

  TransportReport report() const;

 private:
  asio::awaitable<void> accept();
  std::string name_of(modbus::Visitor visitor) const;
  void note_takeover(std::uint32_t axis, const Client& by, const std::string& from);
  bool make_room(const asio::ip::address& newcomer);
  asio::awaitable<void> run(std::shared_ptr<modbus::ClientConnection> connection);

  asio::io_context& io_;
  ModbusConfig config_;
  asio::ip::tcp::acceptor acceptor_;
  std::vector<modbus::RegisterMap> maps_;  ///< by axis
  modbus::ReplyBuilder replies_;
  modbus::RateLimit rate_;
  std::optional<modbus::Identification> identification_;
  std::optional<modbus::Shared> shared_;
  modbus::Visitor last_number_ = 0;
  std::vector<std::shared_ptr<modbus::ClientConnection>> connections_;
};

}  // namespace drivebench
