#include "clients/web/gateway/doors/tls_door.hpp"

#include <array>
#include <boost/asio/ssl.hpp>
#include <chrono>

#include "clients/web/gateway/doors/listen_address.hpp"

namespace drivebench::web {
namespace {

using boost::system::error_code;

constexpr auto kHandshakeTime = std::chrono::seconds(5);

void check(const error_code& error, const char* option, const std::filesystem::path& file) {
  if (error) throw StartError(std::string(option) + " " + file.string() + ": " + error.message());
}

/// A TLS stream and the inner end of the plain one.
struct Passage {
  Passage(asio::ip::tcp::socket socket, asio::ssl::context& context)
      : outside(std::move(socket), context), inside(outside.get_executor()) {}

  asio::ssl::stream<asio::ip::tcp::socket> outside;
  asio::local::stream_protocol::socket inside;

  void close() {
    error_code ignored;
    outside.lowest_layer().close(ignored);
    inside.close(ignored);
  }
};

template <class From, class To>
asio::awaitable<void> carry(std::shared_ptr<Passage> passage, From& from, To& to) {
  std::array<char, 16384> block{};
  for (error_code error; !error;) {
    const std::size_t count =
        co_await from.async_read_some(asio::buffer(block), asio::redirect_error(asio::use_awaitable, error));
    if (error) break;
    co_await asio::async_write(to, asio::buffer(block, count),
                               asio::redirect_error(asio::use_awaitable, error));
  }
  passage->close();
}

}  // namespace

struct TlsDoor::Context {
  asio::ssl::context tls{asio::ssl::context::tls_server};
};

TlsDoor::TlsDoor(const std::filesystem::path& certificate, const std::filesystem::path& key)
    : context_(std::make_unique<Context>()) {
  SSL_CTX_set_min_proto_version(context_->tls.native_handle(), TLS1_3_VERSION);
  error_code error;
  context_->tls.use_certificate_chain_file(certificate.string(), error);
  check(error, "--certificate", certificate);
  context_->tls.use_private_key_file(key.string(), asio::ssl::context::pem, error);
  check(error, "--key", key);
}

TlsDoor::~TlsDoor() = default;

asio::awaitable<TlsDoor::PlainSocket> TlsDoor::shake_hands(asio::ip::tcp::socket socket,
                                                           std::function<void()>& close) {
  const auto passage = std::make_shared<Passage>(std::move(socket), context_->tls);
  asio::steady_timer deadline(passage->outside.get_executor(), kHandshakeTime);
  deadline.async_wait([passage](const error_code& error) {
    if (!error) passage->close();
  });
  close = [passage] { passage->close(); };
  co_await passage->outside.async_handshake(asio::ssl::stream_base::server, asio::use_awaitable);
  deadline.cancel();
  asio::local::stream_protocol::socket plain(passage->outside.get_executor());
  asio::local::connect_pair(plain, passage->inside);
  asio::co_spawn(passage->outside.get_executor(), carry(passage, passage->outside, passage->inside),
                 asio::detached);
  asio::co_spawn(passage->outside.get_executor(), carry(passage, passage->inside, passage->outside),
                 asio::detached);
  close = nullptr;
  co_return PlainSocket(std::move(plain));
}

}  // namespace drivebench::web
