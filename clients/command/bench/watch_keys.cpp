#include "clients/command/bench/watch_keys.hpp"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <optional>
#include <string_view>
#include <utility>

namespace drivebench::command {
namespace {

struct KeyBytes {
  std::string_view bytes;
  Key key;
};
constexpr auto kKeyBytes = std::to_array<KeyBytes>({{"\x1b[A", Key::kUp},
                                                    {"\x1bOA", Key::kUp},
                                                    {"k", Key::kUp},
                                                    {"\x1b[B", Key::kDown},
                                                    {"\x1bOB", Key::kDown},
                                                    {"j", Key::kDown},
                                                    {" ", Key::kToggle},
                                                    {"\t", Key::kList},
                                                    {"q", Key::kQuit},
                                                    {"\x04", Key::kQuit}});

constexpr std::array kEnds = {SIGHUP, SIGQUIT};  // they end the program where it stands
termios terminal_before{};                       // what they give back

/// A process in the background is stopped when it changes its terminal. A terminal that controls no processes
/// stops none.
bool is_in_front() {
  const pid_t front = ::tcgetpgrp(STDIN_FILENO);
  return front == -1 || front == ::getpgrp();
}

/// A handler of a signal, which then acts as ever.
void give_back(int signal) {
  if (is_in_front()) ::tcsetattr(STDIN_FILENO, TCSANOW, &terminal_before);
  ::raise(signal);  // acts after the handler, which is no longer one
}

/// Bytes in the sequence that begins here; nothing while its end is missing.
std::optional<std::size_t> sequence_size(std::string_view bytes) {
  if (bytes[0] != '\x1b') return 1;
  if (bytes.size() == 1) return std::nullopt;
  if (bytes[1] == 'O') return bytes.size() < 3 ? std::nullopt : std::optional<std::size_t>(3);
  if (bytes[1] != '[') return 1;
  for (std::size_t i = 2; i < bytes.size(); ++i) {
    if (bytes[i] >= '\x40' && bytes[i] <= '\x7e') return i + 1;
  }
  return std::nullopt;
}

}  // namespace

std::vector<Key> take_keys(std::string& bytes) {
  std::vector<Key> keys;
  while (!bytes.empty()) {
    const std::optional<std::size_t> size = sequence_size(bytes);
    if (!size) break;
    const std::string_view sequence = std::string_view(bytes).substr(0, *size);
    for (const KeyBytes& each : kKeyBytes) {
      if (each.bytes == sequence) keys.push_back(each.key);
    }
    bytes.erase(0, *size);
  }
  return keys;
}

TerminalSize terminal_size() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {.columns = size.ws_col, .rows = size.ws_row};
}

Keyboard::Keyboard() {
  if (::isatty(STDIN_FILENO) == 0 || !is_in_front() || ::tcgetattr(STDIN_FILENO, &before_) != 0) return;
  terminal_before = before_;
  for (std::size_t i = 0; i < kEnds.size(); ++i) {
    ::sigaction(kEnds[i], nullptr, &actions_before_[i]);
    if (actions_before_[i].sa_handler == SIG_IGN) continue;  // of nohup
    struct sigaction action = {};
    action.sa_handler = give_back;
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    ::sigaction(kEnds[i], &action, nullptr);
  }
  termios keys = before_;
  keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  keys.c_cc[VMIN] = 0;
  keys.c_cc[VTIME] = 0;
  is_there_ = ::tcsetattr(STDIN_FILENO, TCSANOW, &keys) == 0;
}

Keyboard::~Keyboard() {
  if (!is_there_) return;
  if (is_in_front()) ::tcsetattr(STDIN_FILENO, TCSANOW, &before_);
  for (std::size_t i = 0; i < kEnds.size(); ++i)
    ::sigaction(kEnds[i], &actions_before_[i], nullptr);
}

std::vector<Key> Keyboard::read() {
  if (!is_there_ || !is_in_front()) return {};
  std::array<char, 64> more{};
  pollfd waiting = {.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  while (::poll(&waiting, 1, 0) > 0 && (waiting.revents & POLLIN) != 0) {
    const ssize_t count = ::read(STDIN_FILENO, more.data(), more.size());
    if (count <= 0) break;
    bytes_.append(more.data(), static_cast<std::size_t>(count));
  }
  return take_keys(bytes_);
}

}  // namespace drivebench::command
