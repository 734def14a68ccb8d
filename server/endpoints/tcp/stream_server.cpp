#include "server/endpoints/tcp/stream_server.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>

#include <filesystem>
#include <stdexcept>

#include "server/access/address.hpp"
#include "server/endpoints/lost_peer.hpp"
#include "server/host/holder.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench {
namespace {

using asio::ip::tcp;
using UnixProtocol = asio::local::stream_protocol;

// The pause after an accept that failed for lack of descriptors.
constexpr auto kAcceptPause = std::chrono::milliseconds(100);
// The kernel probes an idle peer every second, and ends the connection after this time without an answer.
constexpr int kSendBufferBytes = 64 * 1024;

tcp::endpoint endpoint_of(const TcpConfig& config) {
  const std::string address = config.address == "localhost" ? "127.0.0.1" : config.address;
  return {asio::ip::make_address(address), config.port};
}

Client peer_of(const tcp::socket& socket) {
  boost::system::error_code error;
  const tcp::endpoint remote = socket.remote_endpoint(error);
  return {.transport = "tcp",
          .peer = error ? "gone" : remote.address().to_string() + ":" + std::to_string(remote.port()),
          .subject = {}};
}

Client peer_of(UnixProtocol::socket& socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  const bool known = ::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0;
  return {.transport = "unix",
          .peer = known ? "process " + std::to_string(peer.pid) + " of user " + std::to_string(peer.uid) : "",
          .subject = {}};
}

void tune(tcp::socket& socket) {
  boost::system::error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  socket.set_option(asio::detail::socket_option::integer<IPPROTO_TCP, TCP_USER_TIMEOUT>(kUserTimeoutMs),
                    ignored);
  socket.set_option(asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPIDLE>(1), ignored);
  socket.set_option(asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPINTVL>(1), ignored);
}

void tune(UnixProtocol::socket& socket) {
  boost::system::error_code ignored;
  socket.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
}

/// Removes the socket file of a server that has gone; throws if the path is anything else.
void make_way(asio::io_context& io, const std::string& path) {
  const std::filesystem::file_status status = std::filesystem::symlink_status(path);
  if (!std::filesystem::exists(status)) return;
  if (!std::filesystem::is_socket(status)) {
    throw std::runtime_error("cannot listen on unix:" + path + ": the file exists and is not a socket");
  }
  boost::system::error_code error;
  UnixProtocol::socket probe(io);
  probe.connect(UnixProtocol::endpoint(path), error);
  if (!error) {
    throw std::runtime_error("cannot listen on unix:" + path + ": another server listens there (" +
                             peer_of(probe).peer + ")");
  }
  std::filesystem::remove(path);
}

}  // namespace

StreamServer::StreamServer(asio::io_context& io, const TcpConfig& config, const TlsConfig& tls)
    : io_(io), config_(config), tcp_(io), unix_(io) {
  if (!tls.certificate.empty()) door_.emplace(io, tls);
  try {
    const tcp::endpoint endpoint = endpoint_of(config);
    tcp_.open(endpoint.protocol());
    tcp_.set_option(tcp::acceptor::reuse_address(true));
    tcp_.bind(endpoint);
    tcp_.listen();
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error("cannot listen on " + config.address + ":" + std::to_string(config.port) + ": " +
                             error.code().message() + holder_of_port(config.port));
  }
  if (config.unix_path.empty()) return;
  make_way(io_, config.unix_path);
  try {
    unix_.open();
    unix_.bind(UnixProtocol::endpoint(config.unix_path));
    unix_.listen();
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error("cannot listen on unix:" + config.unix_path + ": " + error.code().message());
  }
}

void StreamServer::serve(Engine& engine, std::function<std::vector<TransportReport>()> transports,
                         Experiments* experiments, Audit* audit) {
  const auto all_reports = [this, others = std::move(transports)] {
    std::vector<TransportReport> reports = others();
    reports.push_back(report());
    return reports;
  };
  audience_.emplace(io_, engine);
  spinner_.emplace(io_);
  context_.emplace(SessionContext{.engine = engine,
                                  .admission = Admission(config_.asks_for_token, config_.grants),
                                  .audience = *audience_,
                                  .spinner = *spinner_,
                                  .session_count = [this] { return sessions_.size(); },
                                  .transports = all_reports,
                                  .experiments = experiments,
                                  .audit = audit,
                                  .places = Places({.sessions = config_.max_sessions,
                                                    .sessions_of_address = sessions_of_address(config_)},
                                                   config_.asks_for_token)});
  // By index: a session may be added while another one answers; none is removed.
  if (experiments != nullptr) {
    experiments->on_change = [this] {
      for (std::size_t i = 0; i < sessions_.size(); ++i)
        sessions_[i]->on_experiments();
    };
  }
  engine.on_set_back.add([this] { audience_->on_set_back(); });
  engine.on_tick.add([this] { audience_->on_tick(); });
  engine.on_newest.add([this] { audience_->on_newest(); });
  engine.on_taken.push_back([this](const Taken& taken) {
    for (std::size_t i = 0; i < sessions_.size(); ++i)
      sessions_[i]->on_taken(taken);
  });
  asio::co_spawn(io_, accept_from(tcp_), asio::detached);
  if (unix_.is_open()) asio::co_spawn(io_, accept_from(unix_), asio::detached);
}

StreamServer::~StreamServer() {
  close();
}

std::string StreamServer::tcp_address() const {
  const tcp::endpoint endpoint = tcp_.local_endpoint();
  const std::string address = endpoint.address().to_string();
  return (endpoint.address().is_v6() ? "[" + address + "]" : address) + ":" + std::to_string(endpoint.port());
}

template <class Acceptor>
asio::awaitable<void> StreamServer::accept_from(Acceptor& acceptor) {
  LogLimit log;
  while (acceptor.is_open()) {
    try {
      boost::system::error_code error;
      typename Acceptor::protocol_type::socket socket =
          co_await acceptor.async_accept(asio::redirect_error(asio::use_awaitable, error));
      if (error == asio::error::operation_aborted) co_return;
      if (error) {
        if (log.allow()) {
          log::warn("cannot accept a client: {} ({} more since the last such line)", error.message(),
                    log.held_back());
        }
        ServerTimer pause(io_, kAcceptPause);
        co_await pause.async_wait(asio::use_awaitable);
        continue;
      }
      tune(socket);
      receive(std::move(socket));
    } catch (const std::exception& problem) {
      log::error("a client could not be taken: {}", problem.what());
    }
  }
}

void StreamServer::receive(tcp::socket socket) {
  Client client = peer_of(socket);
  const Places::Entry entry = context_->places.enter(address_of(client));
  if (!door_) {
    start(Socket(std::move(socket)), std::move(client), entry);
    return;
  }
  if (entry.number == 0) return refuse_tls(client, entry.number, entry.why_not);
  const auto let_in = [this, client, entry](Socket plain, const std::string& subject) {
    const std::weak_ptr<Session> session = start(
        std::move(plain), {.transport = client.transport, .peer = client.peer, .subject = subject}, entry);
    return [session] {
      if (const auto still_here = session.lock()) still_here->on_deaf();
    };
  };
  context_->places.on_displaced(
      entry.number,
      door_->receive(std::move(socket),
                     {.on_first_bytes = [this, entry] { context_->places.heard(entry.number); },
                      .on_refused = [this, client, entry](
                                        const std::string& why) { refuse_tls(client, entry.number, why); },
                      .let_in = let_in}));
}

/// A peer has not got through the TLS handshake.
void StreamServer::refuse_tls(const Client& client, Places::Number place, const std::string& why) {
  context_->places.leave(place);
  ++context_->counts.tls_refused;
  if (context_->audit != nullptr) {
    context_->audit->note({.name = "tls_refused", .client = &client, .result = why});
  }
  context_->log.note(client, "no TLS", why);
}

void StreamServer::receive(UnixProtocol::socket socket) {
  Client client = peer_of(socket);
  const Places::Entry entry = context_->places.enter(address_of(client));
  start(Socket(std::move(socket)), std::move(client), entry);
}

TransportReport StreamServer::report() const {
  const SessionContext::Counts& counts = context_->counts;
  return {.name = "tcp " + tcp_address(),
          .state = "up",
          .counts = {{"sessions", sessions_.size()},
                     {"turned_away", counts.turned_away},
                     {"tls_refused", counts.tls_refused},
                     {"malformed", counts.malformed},
                     {"wrong_tokens", counts.wrong_tokens},
                     {"not_owner", counts.not_owner},
                     {"excess_commands", counts.excess_commands},
                     {"throttled", counts.throttled},
                     {"cut", counts.cut}}};
}

void StreamServer::replace_grants(TcpConfig now) {
  if (now.asks_for_token != config_.asks_for_token) {
    throw std::runtime_error("whether tokens are asked for changes with a new start only");
  }
  context_->admission.replace(std::move(now.grants));
  for (std::size_t i = 0; i < sessions_.size(); ++i)
    sessions_[i]->on_new_grants();
}

std::shared_ptr<Session> StreamServer::start(Socket socket, Client client, const Places::Entry& entry) {
  auto session = std::make_shared<Session>(std::move(socket), std::move(client), *context_, entry.number);
  if (entry.number == 0) {
    session->turn_away(entry.why_not);
    return session;
  }
  context_->places.on_displaced(entry.number, [weak = std::weak_ptr(session)](const std::string& why) {
    if (const auto still_here = weak.lock()) still_here->turn_away(why);
  });
  sessions_.push_back(session);
  asio::co_spawn(io_, run(session), asio::detached);
  return session;
}

asio::awaitable<void> StreamServer::run(std::shared_ptr<Session> session) {
  try {
    co_await session->run();
  } catch (const std::exception& error) {
    log::error("a session ended: {}", error.what());
    session->close();
  }
  std::erase(sessions_, session);
}

void StreamServer::close() {
  boost::system::error_code ignored;
  tcp_.close(ignored);
  if (unix_.is_open()) {
    unix_.close(ignored);
    std::error_code gone_already;
    std::filesystem::remove(config_.unix_path, gone_already);
  }
  if (audience_) audience_->send_all();
  for (const auto& session : sessions_)
    session->close();
}

}  // namespace drivebench
