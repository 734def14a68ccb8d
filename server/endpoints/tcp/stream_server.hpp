#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/endpoints/tcp/session/session.hpp"
#include "server/endpoints/tcp/tls_door.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// Accepts clients on TCP, with TLS if it is configured, and on a unix socket, and serves them at every tick.
class StreamServer {
 public:
  /// Listens at once; throws std::runtime_error that names the address if that fails.
  StreamServer(asio::io_context& io, const TcpConfig& config, const TlsConfig& tls = {});
  ~StreamServer();

  /// Address and port that the system gave, "127.0.0.1:7300".
  std::string tcp_address() const;

  /// Starts to accept clients of this run and to send them its ticks. `transports` returns the reports of the
  /// other transports; `experiments` and `audit` may be null.
  void serve(Engine& engine, std::function<std::vector<TransportReport>()> transports,
             Experiments* experiments, Audit* audit = nullptr);

  /// Applies a changed tokens file and ends the sessions whose token is no longer valid. Throws
  /// std::runtime_error if the change would turn tokens on or off.
  void replace_grants(TcpConfig now);

  /// Stops accepting and ends every session; bytes that a peer did not take at once are lost.
  void close();

 private:
  using Socket = Outbox::Socket;

  template <class Acceptor>
  asio::awaitable<void> accept_from(Acceptor& acceptor);
  void receive(asio::ip::tcp::socket socket);
  void receive(asio::local::stream_protocol::socket socket);
  std::shared_ptr<Session> start(Socket socket, Client client, const Places::Entry& entry);
  void refuse_tls(const Client& client, Places::Number place, const std::string& why);
  TransportReport report() const;
  asio::awaitable<void> run(std::shared_ptr<Session> session);

  asio::io_context& io_;
  TcpConfig config_;
  std::optional<Audience> audience_;
  std::optional<Spinner> spinner_;
  std::optional<SessionContext> context_;
  asio::ip::tcp::acceptor tcp_;
  asio::local::stream_protocol::acceptor unix_;
  std::optional<TlsDoor> door_;
  std::vector<std::shared_ptr<Session>> sessions_;
};

}  // namespace drivebench
