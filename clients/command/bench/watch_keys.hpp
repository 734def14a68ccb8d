#pragma once

#include <termios.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <string>
#include <vector>

namespace drivebench::command {

enum class Key { kUp, kDown, kToggle, kList, kQuit };

/// Takes the keys out of what a terminal sent; the beginning of a sequence stays. Others are left out.
std::vector<Key> take_keys(std::string& bytes);

struct TerminalSize {
  std::size_t columns = 80;
  std::size_t rows = 24;
};
/// The size of the terminal on standard output; the usual one if it does not tell.
TerminalSize terminal_size();

/// Keys of the terminal on standard input: each counts at once and is not echoed. Ctrl-C stays a signal.
/// The destructor gives the terminal back as it was, and so do the signals that end the program at once.
class Keyboard {
 public:
  /// Does nothing where standard input is no terminal, or one that belongs to programs in front of this one.
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  bool is_there() const noexcept { return is_there_; }
  /// What was pressed; does not wait.
  std::vector<Key> read();

 private:
  bool is_there_ = false;
  termios before_{};
  std::array<struct sigaction, 2> actions_before_{};
  std::string bytes_;
};

}  // namespace drivebench::command
