#include "clients/link/common/tls_tunnel.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <exception>
#include <future>
#include <memory>
#include <thread>
#include <utility>

#include "clients/link/common/address.hpp"

namespace drivebench::link {
namespace {

using Context = std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)>;
using Tls = std::unique_ptr<SSL, decltype(&SSL_free)>;

[[noreturn]] void fail(const std::string& what) {
  const unsigned long error = ERR_get_error();
  const char* const reason = error != 0 ? ERR_reason_error_string(error) : nullptr;
  ERR_clear_error();
  throw ConnectError("TLS: " + what + (reason != nullptr ? std::string(": ") + reason : ""));
}

Context context_for(const TlsFiles& files) {
  // The library must not clean up at exit: the thread of a link may still use it.
  OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr);
  Context context(SSL_CTX_new(TLS_client_method()), &SSL_CTX_free);
  if (!context) fail("no memory");
  SSL_CTX_set_min_proto_version(context.get(), TLS1_3_VERSION);
  SSL_CTX_set_verify(context.get(), SSL_VERIFY_PEER, nullptr);
  const bool trusted = files.ca.empty()
                           ? SSL_CTX_set_default_verify_paths(context.get()) == 1
                           : SSL_CTX_load_verify_locations(context.get(), files.ca.c_str(), nullptr) == 1;
  if (!trusted) fail("cannot use the certificates of " + files.ca);
  if (files.certificate.empty()) return context;
  if (SSL_CTX_use_certificate_chain_file(context.get(), files.certificate.c_str()) != 1) {
    fail("cannot use the certificate " + files.certificate);
  }
  if (SSL_CTX_use_PrivateKey_file(context.get(), files.key.c_str(), SSL_FILETYPE_PEM) != 1) {
    fail("cannot use the key " + files.key);
  }
  return context;
}

void expect_host(SSL* tls, const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> address{};
  const bool is_address = ::inet_pton(AF_INET, host.c_str(), address.data()) == 1 ||
                          ::inet_pton(AF_INET6, host.c_str(), address.data()) == 1;
  const bool known = is_address ? X509_VERIFY_PARAM_set1_ip_asc(SSL_get0_param(tls), host.c_str()) == 1
                                : SSL_set1_host(tls, host.c_str()) == 1 &&
                                      SSL_ctrl(tls, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name,
                                               const_cast<char*>(host.c_str())) == 1;
  if (!known) fail("cannot expect the host " + host);
}

void limit(int fd, std::chrono::milliseconds deadline) {
  const timeval time{.tv_sec = deadline.count() / 1000, .tv_usec = deadline.count() % 1000 * 1000};
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
  ::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &time, sizeof time);
}

void never_wait(int fd) {
  ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) | O_NONBLOCK);
}

/// Ignores SIGPIPE in this thread: OpenSSL writes to sockets without MSG_NOSIGNAL.
void ignore_broken_pipes() {
  sigset_t pipe;
  sigemptyset(&pipe);
  sigaddset(&pipe, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &pipe, nullptr);
}

/// A block of bytes in one direction.
struct Block {
  std::array<char, 16 * 1024> bytes;
  std::size_t begin = 0;
  std::size_t end = 0;

  bool empty() const noexcept { return begin == end; }
  void took(std::size_t count) noexcept {
    begin += count;
    if (empty()) begin = end = 0;
  }
};

class Tunnel {
 public:
  Tunnel(FileDescriptor outside, FileDescriptor inside, Tls tls)
      : outside_(std::move(outside)), inside_(std::move(inside)), tls_(std::move(tls)) {}

  /// Throws ConnectError.
  void shake_hands(const std::string& host) {
    if (SSL_connect(tls_.get()) == 1) return;
    const long verdict = SSL_get_verify_result(tls_.get());
    if (verdict != X509_V_OK) fail(host + ": " + X509_verify_cert_error_string(verdict));
    fail(host + " does not shake hands");
  }

  void run() {
    never_wait(outside_.get());
    never_wait(inside_.get());
    while (carry_in() && carry_out())
      wait();
    SSL_shutdown(tls_.get());
  }

 private:
  /// Returns false at the end of the connection.
  bool carry_in() {
    for (;;) {
      while (!in_.empty()) {
        const ssize_t count =
            ::send(inside_.get(), in_.bytes.data() + in_.begin, in_.end - in_.begin, MSG_NOSIGNAL);
        if (count < 0) return errno == EAGAIN || errno == EINTR;
        in_.took(static_cast<std::size_t>(count));
      }
      const int count = SSL_read(tls_.get(), in_.bytes.data(), static_cast<int>(in_.bytes.size()));
      if (count <= 0) return goes_on(count);
      in_.end = static_cast<std::size_t>(count);
    }
  }

  bool carry_out() {
    for (;;) {
      while (!out_.empty()) {
        const int count =
            SSL_write(tls_.get(), out_.bytes.data() + out_.begin, static_cast<int>(out_.end - out_.begin));
        if (count <= 0) return goes_on(count);
        out_.took(static_cast<std::size_t>(count));
      }
      const ssize_t count = ::recv(inside_.get(), out_.bytes.data(), out_.bytes.size(), 0);
      if (count == 0) return false;
      if (count < 0) return errno == EAGAIN || errno == EINTR;
      out_.end = static_cast<std::size_t>(count);
    }
  }

  bool goes_on(int result) {
    const int error = SSL_get_error(tls_.get(), result);
    return error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE;
  }

  void wait() {
    const auto events = [](bool reads, bool writes) {
      return static_cast<short>((reads ? POLLIN : 0) | (writes ? POLLOUT : 0));
    };
    std::array<pollfd, 2> fds{
        pollfd{.fd = outside_.get(), .events = events(in_.empty(), !out_.empty()), .revents = 0},
        pollfd{.fd = inside_.get(), .events = events(out_.empty(), !in_.empty()), .revents = 0}};
    ::poll(fds.data(), fds.size(), -1);
  }

  FileDescriptor outside_;
  FileDescriptor inside_;
  Tls tls_;
  Block in_{};
  Block out_{};
};

}  // namespace

FileDescriptor tunnel_through_tls(FileDescriptor socket, const std::string& host, const TlsFiles& files,
                                  std::chrono::milliseconds deadline) {
  const Context context = context_for(files);
  Tls tls(SSL_new(context.get()), &SSL_free);
  if (!tls || SSL_set_fd(tls.get(), socket.get()) != 1) fail("no memory");
  SSL_set_mode(tls.get(), SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  expect_host(tls.get(), host);
  limit(socket.get(), deadline);
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) fail("no socket pair");
  FileDescriptor ours(ends[0]);
  auto tunnel = std::make_unique<Tunnel>(std::move(socket), FileDescriptor(ends[1]), std::move(tls));
  std::promise<std::string> shaken;  // the error of the handshake; empty: none
  std::future<std::string> why_not = shaken.get_future();
  std::thread([tunnel = std::move(tunnel), shaken = std::move(shaken), host]() mutable {
    ignore_broken_pipes();
    try {
      tunnel->shake_hands(host);
    } catch (const std::exception& error) {
      return shaken.set_value(error.what());
    }
    shaken.set_value({});
    tunnel->run();
  }).detach();
  if (const std::string why = why_not.get(); !why.empty()) throw ConnectError(why);
  return ours;
}

}  // namespace drivebench::link
