#include "server/endpoints/modbus/modbus_server.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>

#include <algorithm>
#include <map>
#include <stdexcept>

#include "server/endpoints/lost_peer.hpp"
#include "server/endpoints/modbus/map_info.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench {
namespace {

using asio::ip::tcp;

// The pause after an accept that failed for lack of descriptors.
constexpr auto kAcceptPause = std::chrono::milliseconds(100);
// The kernel probes an idle peer every second, and ends the connection after this time without an answer.

void tune(tcp::socket& socket) {
  using asio::detail::socket_option::integer;
  boost::system::error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  socket.set_option(integer<IPPROTO_TCP, TCP_USER_TIMEOUT>(kUserTimeoutMs), ignored);
  socket.set_option(integer<IPPROTO_TCP, TCP_KEEPIDLE>(1), ignored);
  socket.set_option(integer<IPPROTO_TCP, TCP_KEEPINTVL>(1), ignored);
}

}  // namespace

ModbusServer::ModbusServer(asio::io_context& io, const ModbusConfig& config)
    : io_(io), config_(config), acceptor_(io), rate_(config.requests_per_s) {
  const std::string address = config.address == "localhost" ? "127.0.0.1" : config.address;
  try {
    const tcp::endpoint endpoint(asio::ip::make_address(address), config.port);
    acceptor_.open(endpoint.protocol());
    acceptor_.set_option(tcp::acceptor::reuse_address(true));
    acceptor_.bind(endpoint);
    acceptor_.listen();
  } catch (const boost::system::system_error& error) {
    throw std::runtime_error("cannot listen for Modbus on " + config.address + ":" +
                             std::to_string(config.port) + ": " + error.code().message());
  }
}

ModbusServer::~ModbusServer() {
  close();
}

std::string ModbusServer::address() const {
  const tcp::endpoint endpoint = acceptor_.local_endpoint();
  const std::string address = endpoint.address().to_string();
  return (endpoint.address().is_v6() ? "[" + address + "]" : address) + ":" + std::to_string(endpoint.port());
}

void ModbusServer::serve(Engine& engine, Audit* audit) {
  if (!is_loopback(config_.address)) {
    log::warn("Modbus knows no passwords: every client that reaches {} can read this bench{}", address(),
              config_.allow_writes ? " and drive its motors" : "");
  }
  identification_.emplace(engine.config().name);
  maps_ = modbus::maps_of(engine.config());
  shared_.emplace(modbus::Shared{engine, replies_, rate_, *identification_, audit, {}, {}, {}, {}, {}, {}});
  // By index: a connection may be added while another one answers.
  const auto wake_all = [this] {
    for (std::size_t i = 0; i < connections_.size(); ++i)
      connections_[i]->wake();
  };
  for (std::uint32_t axis = 0; axis < engine.config().axes.size(); ++axis) {
    shared_->desks.push_back(std::make_unique<modbus::AxisDesk>(io_, engine, maps_[axis], axis));
    shared_->desks.back()->on_lease_change = wake_all;
    shared_->desks.back()->name_of_visitor = [this](modbus::Visitor visitor) { return name_of(visitor); };
    shared_->desks.back()->on_takeover = [this, axis](const Client& by, const std::string& from) {
      note_takeover(axis, by, from);
    };
  }
  engine.on_newest.add(wake_all);
  asio::co_spawn(io_, accept(), asio::detached);
}

std::string ModbusServer::name_of(modbus::Visitor visitor) const {
  const auto found =
      std::find_if(connections_.begin(), connections_.end(),
                   [visitor](const auto& connection) { return connection->number() == visitor; });
  return found == connections_.end() ? std::string() : (*found)->peer_name();
}

void ModbusServer::note_takeover(std::uint32_t axis, const Client& by, const std::string& from) {
  if (shared_->takeover_log.allow()) {
    log::warn("modbus: {} took axis {} from {} with its key ({} more since the last such line)", by.peer,
              axis, from, shared_->takeover_log.held_back());
  }
  if (shared_->audit == nullptr) return;
  shared_->audit->note({.name = "take",
                        .axis = axis,
                        .client = &by,
                        .details = {{"reason", "it wrote the key of the lease"},
                                    {"from", from},
                                    {"owner", shared_->desks[axis]->owner()}},
                        .is_repeatable = true});
}

asio::awaitable<void> ModbusServer::accept() {
  LogLimit log;
  while (acceptor_.is_open()) {
    boost::system::error_code error;
    tcp::socket socket = co_await acceptor_.async_accept(asio::redirect_error(asio::use_awaitable, error));
    if (error == asio::error::operation_aborted) co_return;
    if (error) {
      if (log.allow()) {
        log::warn("cannot accept a Modbus client: {} ({} more since the last such line)", error.message(),
                  log.held_back());
      }
      ServerTimer pause(io_, kAcceptPause);
      co_await pause.async_wait(asio::use_awaitable);
      continue;
    }
    try {
      start(std::move(socket));
    } catch (const std::exception& problem) {
      log::error("a Modbus client could not be taken: {}", problem.what());
    }
  }
}

void ModbusServer::start(tcp::socket socket) {
  tune(socket);
  auto connection = std::make_shared<modbus::ClientConnection>(std::move(socket), ++last_number_, *shared_);
  if (connections_.size() >= config_.max_connections && !make_room(connection->peer())) {
    ++shared_->counts.turned_away;
    if (shared_->turned_away_log.allow()) {
      log::warn(
          "modbus: {} was turned away: {} connections are all there may be ({} more since the last "
          "such line)",
          connection->peer().to_string(), config_.max_connections, shared_->turned_away_log.held_back());
    }
    connection->audit("limit", "there are as many connections as there may be");
    return connection->close();
  }
  connections_.push_back(connection);
  asio::co_spawn(io_, run(std::move(connection)), asio::detached);
}

/// At the limit of connections, cuts the one that has been silent for longest if its silence exceeds
/// idle_timeout_ms: it has lost its leases. Otherwise, if a peer has more connections than the newcomer would
/// have, cuts the longest silent connection without a lease of the peer with the most.
bool ModbusServer::make_room(const asio::ip::address& newcomer) {
  const auto longest =
      std::min_element(connections_.begin(), connections_.end(),
                       [](const auto& a, const auto& b) { return a->idle_since() < b->idle_since(); });
  const auto limit =
      modbus::ClientConnection::Clock::now() - std::chrono::milliseconds(config_.idle_timeout_ms);
  if (longest != connections_.end() && (*longest)->idle_since() <= limit) {
    (*longest)->cut("all connections are taken, and this one has been idle for long");
    connections_.erase(longest);
    return true;
  }
  std::map<asio::ip::address, std::size_t> counts;
  for (const auto& connection : connections_)
    ++counts[connection->peer()];
  const std::size_t fair = counts[newcomer] + 1;
  auto found = connections_.end();
  for (auto each = connections_.begin(); each != connections_.end(); ++each) {
    const std::size_t count = counts[(*each)->peer()];
    if (count <= fair || (*each)->has_lease()) continue;
    const std::size_t most = found == connections_.end() ? 0 : counts[(*found)->peer()];
    if (count > most || (count == most && (*each)->idle_since() < (*found)->idle_since())) found = each;
  }
  if (found == connections_.end()) return false;
  (*found)->cut("all connections are taken, and this peer has the most");
  connections_.erase(found);
  return true;
}

asio::awaitable<void> ModbusServer::run(std::shared_ptr<modbus::ClientConnection> connection) {
  try {
    co_await connection->run();
  } catch (const std::exception& error) {
    log::error("a Modbus connection ended: {}", error.what());
  }
  connection->end();
  std::erase(connections_, connection);
}

void ModbusServer::close() {
  boost::system::error_code ignored;
  acceptor_.close(ignored);
  for (const auto& connection : connections_)
    connection->close();
}

TransportReport ModbusServer::report() const {
  TransportReport report{.name = "modbus " + (acceptor_.is_open() ? address() : config_.address),
                         .state = acceptor_.is_open() ? "up" : "closed",
                         .counts = {}};
  if (!shared_) return report;
  const modbus::Shared::Counts& counts = shared_->counts;
  std::uint64_t unread_keys = 0;
  for (const auto& desk : shared_->desks)
    unread_keys += desk->unread_keys();
  report.counts = {{"connections", connections_.size()},
                   {"requests", counts.requests},
                   {"exceptions", counts.exceptions},
                   {"refused_writes", counts.refused_writes},
                   {"not_owner", counts.not_owner},
                   {"throttled", counts.throttled},
                   {"cut", counts.cut},
                   {"turned_away", counts.turned_away},
                   {"unread_keys", unread_keys}};
  return report;
}

}  // namespace drivebench
