#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "clients/link/common/address.hpp"
#include "clients/link/common/requests.hpp"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::link {

/// The link of a controller to one axis over any transport. Requests throw RefusalError and LinkError as
/// those of Link do; references to samples hold until the next call.
class AxisLink {
 public:
  AxisLink() = default;
  AxisLink(const AxisLink&) = delete;
  AxisLink& operator=(const AxisLink&) = delete;
  virtual ~AxisLink() = default;

  /// The description of the bench. A transport without descriptions leaves out parameters and faults, and may
  /// leave out the mode before acquire().
  virtual const v1::BenchDescription& bench() const noexcept = 0;
  /// The number of the axis.
  virtual std::uint32_t axis() const noexcept = 0;
  /// The signals that samples carry; the other members of a Sample are undefined.
  virtual SignalMask known() const noexcept = 0;
  bool knows(std::string_view signal) const noexcept {
    const Signal* const row = find_signal(signal);
    return row != nullptr && (known() >> (row - kSignals.data()) & 1) != 0;
  }

  virtual void acquire() = 0;
  virtual void release() = 0;
  virtual void clear_faults() = 0;

  /// The newest sample, without waiting for a tick.
  virtual const Sample& newest() = 0;
  /// The sample of the axis that shares the amplifier of this one, of the tick of the last sample. Null:
  /// there is no such axis, or the transport does not carry both.
  virtual const Sample* second() const noexcept { return nullptr; }
  /// Sends the answer to the sample of command.tick; ignores command.axis. Returns in lockstep the sample of
  /// tick + 1, in real time the first sample that arrives afterwards. A transport that cannot carry a
  /// set-point refuses the command.
  virtual const Sample& exchange(const AxisCommand& command) = 0;

  virtual void write_parameter(std::string_view name, double value) = 0;
  virtual bool can_set_load() const noexcept = 0;
  virtual void set_load(const LoadChange& change) = 0;
};

/// Refuses a request that the transport cannot carry, before sending anything.
[[noreturn]] inline void refuse(v1::RefusalCode code, std::string_view sentence,
                                std::string_view field = {}) {
  v1::Refusal refusal;
  refusal.set_code(code);
  refusal.set_message(std::string(sentence));
  refusal.set_field(std::string(field));
  throw RefusalError(refusal);
}

}  // namespace drivebench::link
