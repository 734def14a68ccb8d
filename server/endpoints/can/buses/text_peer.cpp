#include "server/endpoints/can/buses/text_peer.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <boost/asio/post.hpp>
#include <cerrno>
#include <utility>

#include "server/endpoints/can/buses/virtual_bus.hpp"

namespace drivebench::can {
namespace {

// After this many bytes other handlers have their turn.
constexpr std::size_t kReadAtOnce = 4096;

}  // namespace

TextPeer::TextPeer(asio::io_context& io, int fd, BusStatus& status, Encode encode)
    : stream_(io), timer_(io), status_(status), encode_(std::move(encode)) {
  ::fcntl(fd, F_SETFL, ::fcntl(fd, F_GETFL) | O_NONBLOCK);
  int type = 0;
  socklen_t size = sizeof type;
  is_socket_ = ::getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) == 0;
  if (!adopt(stream_, fd)) end();
}

bool TextPeer::answer(std::string_view text) {
  if (ended_) return true;
  if (unsent_.size() + text.size() > kMaxUnsent) return false;
  unsent_ += text;
  if (!waiting_) write();
  return true;
}

void TextPeer::send(const Frame& frame) {
  if (ended_) return;
  status_.send_dropped += frames_.push(frame);
  if (!waiting_) write();
}

/// Writes as much as the kernel takes: first the text, then the frames, each converted to text at its turn.
void TextPeer::write() {
  while (!ended_ && !(unsent_.empty() && frames_.empty())) {
    if (unsent_.empty()) {
      encode_(unsent_, frames_.front());
      frames_.pop();
      ++status_.sent;
      if (unsent_.empty()) continue;  // the protocol has no such frame
    }
    const int fd = stream_.native_handle();
    const ssize_t count = is_socket_ ? ::send(fd, unsent_.data(), unsent_.size(), MSG_NOSIGNAL)
                                     : ::write(fd, unsent_.data(), unsent_.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno == EAGAIN) return wait_writable();
    if (count < 0) return end();
    written_ += static_cast<std::uint64_t>(count);
    unsent_.erase(0, static_cast<std::size_t>(count));
  }
}

void TextPeer::wait_writable() {
  waiting_ = true;
  watch_for_stall();
  stream_.async_wait(asio::posix::stream_descriptor::wait_write,
                     [this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                       if (alive.expired() || error) return;
                       waiting_ = false;
                       write();
                     });
}

void TextPeer::watch_for_stall() {
  if (watching_ || stall_limit_.count() == 0) return;
  watching_ = true;
  timer_.expires_after(stall_limit_);
  timer_.async_wait(
      [this, alive = std::weak_ptr(alive_), before = written_](const boost::system::error_code& error) {
        if (alive.expired() || error) return;
        watching_ = false;
        if (waiting_ && written_ == before) return reset();
        if (waiting_) watch_for_stall();
      });
}

/// Resets the connection: an ordinary end would wait in the kernel behind unread bytes.
void TextPeer::reset() {
  const linger at_once{.l_onoff = 1, .l_linger = 0};
  if (!ended_) ::setsockopt(stream_.native_handle(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  if (!ended_ && on_stall) on_stall();
  end();
}

void TextPeer::wait_readable() {
  if (ended_) return;
  stream_.async_wait(asio::posix::stream_descriptor::wait_read,
                     [this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
                       if (alive.expired() || error) return;
                       read();
                       wait_readable();
                     });
}

void TextPeer::read() {
  std::array<char, kReadAtOnce> buffer;
  const ssize_t count = ::read(stream_.native_handle(), buffer.data(), buffer.size());
  if (count > 0) {
    if (on_bytes) on_bytes({buffer.data(), static_cast<std::size_t>(count)});
  } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
    end();  // a terminal whose other end is closed returns EIO
  }
}

void TextPeer::end() {
  if (std::exchange(ended_, true)) return;
  boost::system::error_code ignored;
  timer_.cancel();
  stream_.close(ignored);
  forget_frames();
  asio::post(stream_.get_executor(), [this, alive = std::weak_ptr(alive_)] {
    if (alive.expired() || !on_end) return;
    const auto tell = std::move(on_end);  // moved out, because it may destroy the peer
    tell();
  });
}

}  // namespace drivebench::can
