#include "server/endpoints/can/buses/terminal.hpp"

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "server/endpoints/can/buses/virtual_bus.hpp"

namespace drivebench::can {
namespace {

// The kernel does not report the opening of a terminal.
constexpr auto kPollPeriod = std::chrono::milliseconds(20);

}  // namespace

Terminal::~Terminal() {
  std::error_code error;
  if (!link_.empty() && std::filesystem::read_symlink(link_, error) == device_ && !error)
    std::filesystem::remove(link_, error);
  if (fd_ >= 0) ::close(fd_);
}

std::string Terminal::open(const std::string& link) {
  if (fd_ < 0) {
    fd_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    std::array<char, 64> device{};
    if (fd_ < 0 || ::grantpt(fd_) != 0 || ::unlockpt(fd_) != 0 ||
        ::ptsname_r(fd_, device.data(), device.size()) != 0)
      return reason();
    device_ = device.data();
  }
  if (!renew()) return reason();
  link_ = link;
  std::string problem = make_link();
  if (problem.empty()) {
    poll_later();
  } else {
    link_.clear();
  }
  return problem;
}

/// Makes the link. It replaces only a link that points nowhere, which a crashed server left; any other file
/// belongs to another program.
std::string Terminal::make_link() {
  std::error_code error;
  const bool is_link = std::filesystem::is_symlink(std::filesystem::symlink_status(link_, error));
  if (is_link && !std::filesystem::exists(link_, error)) std::filesystem::remove(link_, error);
  std::filesystem::create_symlink(device_, link_, error);
  if (!error) return {};
  return error.message() + (error == std::errc::file_exists ? " (remove it, or name another path)" : "");
}

void Terminal::release() {
  renew();
  poll_later();
}

/// Makes the terminal raw again and drops unread bytes. Because it opens and closes the terminal, the kernel
/// afterwards reports whether a program has it open.
bool Terminal::renew() {
  const int fd = ::open(device_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) return false;
  termios line{};
  ::tcgetattr(fd, &line);
  ::cfmakeraw(&line);
  ::tcsetattr(fd, TCSANOW, &line);
  ::tcflush(fd, TCIOFLUSH);
  ::close(fd);
  return true;
}

void Terminal::poll_later() {
  poll_.expires_after(kPollPeriod);
  poll_.async_wait([this, alive = std::weak_ptr(alive_)](const boost::system::error_code& error) {
    if (alive.expired() || error) return;
    pollfd state{.fd = fd_, .events = POLLIN, .revents = 0};
    ::poll(&state, 1, 0);
    // A quick program may have closed the terminal already and left bytes to read.
    const bool there = (state.revents & POLLHUP) == 0 || (state.revents & POLLIN) != 0;
    const int fd = there ? ::fcntl(fd_, F_DUPFD_CLOEXEC, 0) : -1;
    if (fd < 0) return poll_later();
    on_client(fd);
  });
}

}  // namespace drivebench::can
