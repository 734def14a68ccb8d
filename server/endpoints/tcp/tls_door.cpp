#include "server/endpoints/tcp/tls_door.hpp"

#include <openssl/x509.h>
#include <sys/socket.h>

#include <array>
#include <boost/asio/local/connect_pair.hpp>
#include <boost/asio/ssl.hpp>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "protocols/text.hpp"
#include "server/endpoints/deadline.hpp"
#include "server/endpoints/tcp/sending/outbox.hpp"

namespace drivebench {
namespace {

using Stream = asio::ssl::stream<asio::ip::tcp::socket>;

constexpr std::size_t kBlock = 16 * 1024;
constexpr int kPairBufferBytes = 64 * 1024;
constexpr auto kFarewellLimit = std::chrono::milliseconds(500);

/// Throws with the reason that OpenSSL or the system gives.
[[noreturn]] void refuse_file(const std::filesystem::path& file, const std::string& why) {
  throw std::runtime_error("TLS: " + file.string() + ": " + why);
}

void check(const boost::system::error_code& error, const std::filesystem::path& file) {
  if (error) refuse_file(file, error.message());
}

void add_revocations(asio::ssl::context& context, const std::filesystem::path& file) {
  X509_STORE* const store = SSL_CTX_get_cert_store(context.native_handle());
  X509_LOOKUP* const lookup = X509_STORE_add_lookup(store, X509_LOOKUP_file());
  if (lookup == nullptr || X509_load_crl_file(lookup, file.c_str(), X509_FILETYPE_PEM) <= 0) {
    refuse_file(file, "is no list of revoked certificates");
  }
  X509_STORE_set_flags(store, X509_V_FLAG_CRL_CHECK);
}

std::string name_in(const X509* certificate) {
  if (certificate == nullptr) return {};
  const X509_NAME* const subject = X509_get_subject_name(certificate);
  const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  if (at < 0) return {};
  unsigned char* utf8 = nullptr;
  const int size = ASN1_STRING_to_UTF8(&utf8, X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
  if (size < 0) return {};
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owner(
      utf8, [](unsigned char* text) { OPENSSL_free(text); });
  return printable({reinterpret_cast<const char*>(utf8), static_cast<std::size_t>(size)});
}

/// The name in the certificate of a peer; empty: the peer has no certificate.
std::string subject_of(SSL* tls) {
  const std::unique_ptr<X509, decltype(&X509_free)> certificate(SSL_get1_peer_certificate(tls), &X509_free);
  return name_in(certificate.get());
}

std::array<asio::local::stream_protocol::socket, 2> socket_pair(asio::io_context& io) {
  std::array<asio::local::stream_protocol::socket, 2> pair{asio::local::stream_protocol::socket(io),
                                                           asio::local::stream_protocol::socket(io)};
  asio::local::connect_pair(pair[0], pair[1]);
  for (auto& each : pair)
    each.set_option(asio::socket_base::send_buffer_size(kPairBufferBytes));
  return pair;
}

}  // namespace

struct TlsDoor::Context {
  asio::ssl::context tls{asio::ssl::context::tls_server};
};

/// One peer, from the handshake on.
class TlsDoor::Passage : public std::enable_shared_from_this<Passage> {
 public:
  Passage(asio::ip::tcp::socket socket, Context& context)
      : stream(std::move(socket), context.tls),
        inside(stream.get_executor()),
        deadline(stream.get_executor()) {
    boost::system::error_code ignored;
    stream.set_verify_callback(
        [this](bool good, asio::ssl::verify_context& checked) {
          if (!good) refused_subject = name_in(X509_STORE_CTX_get_current_cert(checked.native_handle()));
          return good;
        },
        ignored);
  }

  /// Closes both ends after this time, unless called off.
  void limit(std::chrono::milliseconds limit) {
    deadline.set(limit, [self = shared_from_this()] {
      self->was_late = true;
      if (self->on_deaf) self->on_deaf();
      self->close();
    });
  }

  void close() {
    boost::system::error_code ignored;
    stream.lowest_layer().close(ignored);
    inside.close(ignored);
  }

  /// The reason why the handshake failed.
  std::string why_refused(const boost::system::error_code& error) {
    if (!why_ended.empty()) return why_ended;
    if (was_late) return "no handshake within " + std::to_string(kHandshakeLimit.count()) + " s";
    const long verdict = SSL_get_verify_result(stream.native_handle());
    return (verdict == X509_V_OK ? error.message() : X509_verify_cert_error_string(verdict)) +
           (refused_subject.empty() ? "" : ", certificate of " + refused_subject);
  }

  asio::awaitable<void> carry_in() {
    std::vector<char> block(kBlock);
    boost::system::error_code error;
    while (!error) {
      const std::size_t count = co_await stream.async_read_some(
          asio::buffer(block), asio::redirect_error(asio::use_awaitable, error));
      if (!error) co_await write_all(inside, block, count, error);
    }
    inside.shutdown(asio::socket_base::shutdown_send, error);
  }

  asio::awaitable<void> carry_out() {
    std::vector<char> block(kBlock);
    boost::system::error_code error;
    while (!error) {
      const std::size_t count = co_await inside.async_read_some(
          asio::buffer(block), asio::redirect_error(asio::use_awaitable, error));
      limit(Outbox::kNoProgressLimit);
      if (!error) co_await write_all(stream, block, count, error);
      deadline.call_off();
    }
    if (was_late) co_return;
    limit(kFarewellLimit);
    co_await stream.async_shutdown(asio::redirect_error(asio::use_awaitable, error));
    deadline.call_off();
    close();
  }

  Stream stream;
  asio::local::stream_protocol::socket inside;
  Deadline deadline;
  std::string refused_subject;  ///< the name in a refused certificate
  std::string why_ended;        ///< another peer got its place
  bool was_late = false;        ///< a limit has ended it
  OnDeaf on_deaf;               ///< set once the peer has its session

 private:
  template <class To>
  static asio::awaitable<void> write_all(To& to, const std::vector<char>& block, std::size_t count,
                                         boost::system::error_code& error) {
    for (std::size_t sent = 0; sent < count && !error;) {
      sent += co_await to.async_write_some(asio::buffer(block.data() + sent, count - sent),
                                           asio::redirect_error(asio::use_awaitable, error));
    }
  }
};

TlsDoor::TlsDoor(asio::io_context& io, const TlsConfig& config)
    : io_(io), context_(std::make_unique<Context>()) {
  asio::ssl::context& tls = context_->tls;
  SSL_CTX_set_min_proto_version(tls.native_handle(), TLS1_3_VERSION);
  // No resumption: each connection shows its certificate, because it may have been revoked meanwhile.
  SSL_CTX_set_num_tickets(tls.native_handle(), 0);
  SSL_CTX_set_session_cache_mode(tls.native_handle(), SSL_SESS_CACHE_OFF);
  boost::system::error_code error;
  tls.use_certificate_chain_file(config.certificate.string(), error);
  check(error, config.certificate);
  tls.use_private_key_file(config.key.string(), asio::ssl::context::pem, error);
  check(error, config.key);
  if (SSL_CTX_check_private_key(tls.native_handle()) != 1) {
    refuse_file(config.key, "is not the key of " + config.certificate.string());
  }
  if (config.client_ca.empty()) return;
  tls.load_verify_file(config.client_ca.string(), error);
  check(error, config.client_ca);
  tls.set_verify_mode(asio::ssl::verify_peer | asio::ssl::verify_fail_if_no_peer_cert, error);
  if (!config.client_crl.empty()) add_revocations(tls, config.client_crl);
}

TlsDoor::~TlsDoor() = default;

TlsDoor::End TlsDoor::receive(asio::ip::tcp::socket socket, Guest guest) {
  auto passage = std::make_shared<Passage>(std::move(socket), *context_);
  const std::weak_ptr<Passage> weak = passage;
  asio::co_spawn(io_, shake_hands(std::move(passage), std::move(guest)), asio::detached);
  return [weak](const std::string& why) {
    const auto still_here = weak.lock();
    if (!still_here) return;
    still_here->why_ended = why;
    still_here->close();
  };
}

asio::awaitable<void> TlsDoor::shake_hands(std::shared_ptr<Passage> passage, Guest guest) {
  boost::system::error_code error;
  passage->limit(kHandshakeLimit);
  co_await passage->stream.lowest_layer().async_wait(asio::socket_base::wait_read,
                                                     asio::redirect_error(asio::use_awaitable, error));
  if (!error) {
    guest.on_first_bytes();
    co_await passage->stream.async_handshake(Stream::server,
                                             asio::redirect_error(asio::use_awaitable, error));
  }
  passage->deadline.call_off();
  if (error) {
    guest.on_refused(passage->why_refused(error));
    passage->close();
    co_return;
  }
  try {
    auto [inside, outside] = socket_pair(io_);
    passage->inside = std::move(inside);
    passage->on_deaf =
        guest.let_in(PlainSocket(std::move(outside)), subject_of(passage->stream.native_handle()));
  } catch (const std::exception& problem) {
    guest.on_refused(problem.what());
    passage->close();
    co_return;
  }
  const auto carry = [](std::shared_ptr<Passage> by, bool in) -> asio::awaitable<void> {
    in ? co_await by->carry_in() : co_await by->carry_out();
  };
  asio::co_spawn(io_, carry(passage, true), asio::detached);
  co_await carry(passage, false);
}

}  // namespace drivebench
