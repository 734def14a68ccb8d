#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "bench.pb.h"
#include "clients/command/bench/watch_keys.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {

/// `axis 0 (servo) of bench servo, lockstep`.
std::string watch_title(const v1::BenchDescription& bench, std::uint32_t axis);
/// The value for people: states, faults and injected faults by their names.
std::string watched_text(const Signal& signal, const Sample& sample, const v1::BenchDescription& bench);

/// A block of lines in a terminal that is drawn again and again: values with curves, or the list of all
/// signals from which keys choose.
class WatchScreen {
 public:
  WatchScreen(const v1::BenchDescription& bench, std::uint32_t axis, std::vector<const Signal*> signals,
              bool utf8)
      : bench_(bench), axis_(axis), signals_(std::move(signals)), utf8_(utf8) {}

  const std::vector<const Signal*>& signals() const noexcept { return signals_; }

  /// The next sample: a point of each curve.
  void take(const Sample& sample);
  /// Values alone, when other signals are chosen.
  void show(const Sample& present);
  /// Whether the signals have changed.
  bool press(Key key);
  /// A word for the last lines, until the next sample.
  void note(std::string text) { note_ = std::move(text); }

  /// What to print: the block in the place of the one before. With keys its last lines say which.
  std::string draw(TerminalSize size, bool has_keys);

 private:
  // Their size is the room for them.
  std::vector<std::string> value_lines(TerminalSize size, bool has_keys) const;
  std::vector<std::string> list_lines(TerminalSize size) const;
  std::vector<std::string> last_lines(TerminalSize size, bool has_keys) const;
  std::string value_text(const Signal& signal) const;
  bool toggle(const Signal& signal);

  const v1::BenchDescription& bench_;
  std::uint32_t axis_;
  std::vector<const Signal*> signals_;
  bool utf8_;
  Sample sample_{};
  std::map<const Signal*, std::vector<double>> curves_;
  std::set<const Signal*> unseen_;  // chosen since the last sample, which has them not
  std::string note_;
  bool is_list_ = false;
  std::size_t mark_ = 0;         // a row of the values or of the list
  std::size_t drawn_lines_ = 0;  // of the block before
};

}  // namespace drivebench::command
