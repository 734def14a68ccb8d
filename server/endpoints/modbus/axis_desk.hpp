#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "protocols/modbus/drive_profile.hpp"
#include "protocols/modbus/pdu.hpp"
#include "protocols/modbus/register_map.hpp"
#include "server/bench/terminals.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"

namespace drivebench::modbus {

/// Number of a connection; 0 is none.
using Visitor = std::uint64_t;

/// One axis as Modbus sees it: registers and coils, the lease behind its key, and the state machine behind
/// the control word.
///
/// The lease belongs to the connection that wrote the key last. When that connection ends it stays for the
/// key until the lease time of the bench has passed by the wall clock; so does the lease of an owner that is
/// connected but silent for idle_timeout_ms, which in lockstep nobody else would notice.
class AxisDesk {
 public:
  AxisDesk(asio::io_context& io, Engine& engine, const RegisterMap& map, std::uint32_t axis);

  /// Called when the lease has changed hands or is gone, so that nobody waits for it.
  std::function<void()> on_lease_change;
  /// Address and port of a connection, for the audit log; may be empty.
  std::function<std::string(Visitor)> name_of_visitor;

  std::uint32_t axis() const noexcept { return axis_; }
  const RegisterMap& map() const noexcept { return map_; }

  /// Puts the registers asked for to words[0..count).
  void read(const RegisterMap::Range& range, Visitor who, std::span<std::uint16_t> words) const;
  bool coil(std::size_t address, Visitor who) const;
  bool discrete_input(std::size_t address) const {
    return modbus::discrete_input(address, engine_.newest(axis_));
  }

  struct Outcome {
    Exception exception = Exception::kNone;
    Refused refused = Refused::kNot;
    bool commanded = false;  ///< the bench has accepted a command
  };
  /// Carries out a write that has been validated: all of it or nothing.
  asio::awaitable<Outcome> write(RegisterMap::Range range, std::span<const std::uint16_t> words, Visitor who);
  asio::awaitable<Outcome> write_coils(std::size_t address, std::size_t count, std::uint8_t bits,
                                       Visitor who);

  /// A write was turned away for its values: a command in it counts as refused.
  void count_refused(const RegisterMap::Range& range, std::span<const std::uint16_t> words, Visitor who);
  /// A write was refused, as last_refusal is to say.
  void note_refusal(Visitor who, Refused why) noexcept;

  /// Whether this connection holds the lease.
  bool holds(Visitor who) const noexcept;
  /// Whether process data of this connection would be in time, but for a command that this tick has already.
  bool has_answered_tick(Visitor who) const {
    return holds(who) && engine_.check(axis_, owner_, gates_off()) == Refused::kStale;
  }
  /// A request of this connection came in.
  void spoke(Visitor who);
  /// An owner that waits for its tick is not silent.
  void set_waiting(Visitor who, bool waiting) noexcept {
    if (holder_ == who) waiting_ = waiting;
  }
  void connection_ended(Visitor who);

 private:
  using Clock = ServerClock;

  /// What the registers of the command block hold.
  struct CommandInput {
    CommandMode mode = CommandMode::kOff;
    std::uint32_t counter = 0;
    float a = 0.0f;
    float b = 0.0f;
    float c = 0.0f;
    float field = 0.0f;
  };
  /// What the writable registers of the process data hold.
  struct ProcessInput {
    std::uint16_t control_word = 0;
    ReferenceMode mode = ReferenceMode::kVoltage;
    std::int16_t a = 0;
    std::int16_t b = 0;
    std::int16_t c = 0;
    std::int16_t field = 0;
  };
  /// Bits of the values in a write.
  struct Written {
    RegisterMap::Range range;
    std::span<const std::uint16_t> words;
    std::optional<std::uint64_t> operator[](Content content) const noexcept;
  };

  asio::awaitable<Outcome> write_process(Written written, Visitor who);
  asio::awaitable<Outcome> write_command(Written written, Visitor who);
  asio::awaitable<Outcome> write_parameters(Written written, Visitor who);
  asio::awaitable<Outcome> carry_out(LeaseRequest request, Visitor who);
  asio::awaitable<Refused> take_lease(std::uint16_t key, bool renew, Visitor who);
  /// An input on its way to the bench.
  struct Asked {
    std::optional<Refused> answer;
    ServerTimer* waiting = nullptr;
  };
  std::shared_ptr<Asked> send(const Input& input);
  asio::awaitable<Refused> answer_to(std::shared_ptr<Asked> asked);
  asio::awaitable<Refused> ask(Input input) { return answer_to(send(input)); }

  std::uint64_t bits_of(const Row& row, Visitor who) const;
  /// Of a register that shows what was written; 0 if it is another one.
  std::uint64_t input_bits(Content content) const;
  std::uint64_t header_bits(const Row& row) const;
  const Parameter& parameter(const Row& row) const {
    return axis_parameters(engine_.parameters(axis_))[parameter_rows_[row.index]];
  }
  /// What the bench takes for this tick in any state.
  Command gates_off() const { return {.answers = engine_.tick(), .phases = {}}; }
  Command command_of(const CommandInput& input) const;
  Command command_of(const ProcessInput& input, DriveState state) const;
  Outcome command(const Command& command);
  static Outcome refuse(Refused why) noexcept;

  bool latched() const noexcept;
  DriveState drive_state() const noexcept;
  /// Whether the bench still knows the lease.
  bool leased() const noexcept { return owner_ != 0 && engine_.owner(axis_) == owner_; }
  void give_back(LeaseAction action);
  void forget();
  void watch();

  Engine& engine_;
  const RegisterMap& map_;
  std::uint32_t axis_;
  Terminals terminals_;
  std::vector<std::uint32_t> parameter_rows_;  ///< of the table of this kind of machine, by place in the map
  std::chrono::nanoseconds lease_time_;
  std::chrono::nanoseconds idle_timeout_;

  Owner owner_ = 0;  ///< in the bench; 0: Modbus does not hold the lease
  std::uint16_t key_ = 0;
  Visitor holder_ = 0;  ///< 0: the connection has ended, the key still counts
  bool waiting_ = false;
  Clock::time_point last_word_{};
  ServerTimer timer_;

  CommandInput command_;
  ProcessInput process_;
  DriveState state_ = DriveState::kSwitchOnDisabled;  ///< never kFault, which the sample tells
  Refused last_refusal_ = Refused::kNot;
  Refused holders_refusal_ = Refused::kNot;  ///< the last one of whoever holds the lease
  LogLimit lapsed_log_;
};

}  // namespace drivebench::modbus
