#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "clients/link/common/address.hpp"
#include "clients/link/common/requests.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::link {

/// What a controller of one axis needs of a link over any transport. Requests throw Refused and LinkError
/// as those of Link do; references to samples hold until the next call.
class AxisLink {
 public:
  AxisLink() = default;
  AxisLink(const AxisLink&) = delete;
  AxisLink& operator=(const AxisLink&) = delete;
  virtual ~AxisLink() = default;

  /// What the link tells of the bench. One that carries no description leaves axes without parameters and no
  /// faults, and may not know the mode before acquire().
  virtual const v1::BenchDescription& bench() const noexcept = 0;
  /// Which of its axes this is about.
  virtual std::uint32_t axis() const noexcept = 0;
  /// The signals that samples carry; the other members of a Sample mean nothing.
  virtual SignalMask known() const noexcept = 0;
  bool knows(std::string_view signal) const noexcept {
    const Signal* const row = find_signal(signal);
    return row != nullptr && (known() >> (row - kSignals.data()) & 1) != 0;
  }

  virtual void acquire() = 0;
  virtual void release() = 0;
  virtual void clear_faults() = 0;

  /// The newest sample, at once.
  virtual const Sample& newest() = 0;
  /// Answers the sample of command.tick; command.axis means nothing, the link is about one. Lockstep: the
  /// sample of tick + 1. Real time: the first sample that the link brings afterwards. A link that has no
  /// words for one of the setpoints refuses it.
  virtual const Sample& exchange(const Command& command) = 0;

  virtual void write_parameter(std::string_view name, double value) = 0;
  virtual bool can_set_load() const noexcept = 0;
  virtual void set_load(const LoadChange& change) = 0;
};

/// For what a link has no words for: refused before anything is sent.
[[noreturn]] inline void refuse(v1::RefusalCode code, std::string_view sentence,
                                std::string_view field = {}) {
  v1::Refusal refusal;
  refusal.set_code(code);
  refusal.set_message(std::string(sentence));
  refusal.set_field(std::string(field));
  throw Refused(refusal);
}

}  // namespace drivebench::link
