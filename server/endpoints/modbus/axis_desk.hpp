#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "protocols/modbus/drive_profile.hpp"
#include "protocols/modbus/pdu.hpp"
#include "protocols/modbus/register_map.hpp"
#include "server/access/guess_limit.hpp"
#include "server/access/seat.hpp"
#include "server/bench/terminals.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"

namespace drivebench::modbus {

/// Number of a connection; 0 is none.
using Visitor = std::uint64_t;

/// One axis on Modbus: registers and coils, the lease behind its key, and the state machine behind the
/// control word.
///
/// The lease belongs to the connection that wrote the key last. When that connection ends, the lease stays
/// for the key until the lease time of the bench has passed by the wall clock. A holder that is connected but
/// silent for idle_timeout_ms loses the lease as well: otherwise a bench in lockstep would wait for it for
/// ever.
class AxisDesk {
 public:
  AxisDesk(asio::io_context& io, Engine& engine, const RegisterMap& map, std::uint32_t axis);

  /// Called when the lease has a new owner or has ended, so that no exchange waits for it any longer.
  std::function<void()> on_lease_change;
  /// Address and port of a connection, for the limit of guesses and the logs; empty for one that has ended.
  std::function<std::string(Visitor)> name_of_visitor;
  /// Called when a connection takes the lease from another one that is still there or has another address.
  std::function<void(const Client& by, const std::string& from)> on_takeover;

  std::uint32_t axis() const noexcept { return axis_; }
  const RegisterMap& map() const noexcept { return map_; }

  /// Writes the registers of the range to words[0..count).
  void read(const RegisterMap::Range& range, Visitor visitor, std::span<std::uint16_t> words) const;
  bool coil(std::size_t address, Visitor visitor) const;
  bool discrete_input(std::size_t address) const {
    return modbus::discrete_input(address, engine_.newest(axis_));
  }

  struct Outcome {
    Exception exception = Exception::kNone;
    Refused refused = Refused::kNot;
    bool commanded = false;  ///< the bench has accepted a command
  };
  /// Carries out a write that has been validated: all of it or nothing.
  asio::awaitable<Outcome> write(RegisterMap::Range range, std::span<const std::uint16_t> words,
                                 Visitor visitor);
  asio::awaitable<Outcome> write_coils(std::size_t address, std::size_t count, std::uint8_t bits,
                                       Visitor visitor);

  /// Notes that a write was refused for its values: a command of the owner in it counts as refused.
  void count_refused(const RegisterMap::Range& range, std::span<const std::uint16_t> words, Visitor visitor);
  /// Notes a refused write, for the register last_refusal.
  void note_refusal(Visitor visitor, Refused why) noexcept;

  /// Whether this connection holds the lease.
  bool holds(Visitor visitor) const noexcept;
  /// Whether process data of this connection come in time but find that the tick has its command already.
  bool has_answered_tick(Visitor visitor) const {
    return holds(visitor) && engine_.check(axis_, seat_.owner(), gates_off()) == Refused::kStale;
  }
  /// Notes that a request of this connection has arrived.
  void spoke(Visitor visitor);
  /// A holder that waits for its tick is not silent.
  void set_waiting(Visitor visitor, bool waiting) noexcept {
    if (holder_ == visitor) waiting_ = waiting;
  }
  void connection_ended(Visitor visitor);
  /// Keys that were not compared, because their address had to wait.
  std::uint64_t unread_keys() const noexcept { return unread_keys_; }
  Owner owner() const noexcept { return seat_.owner(); }

 private:
  using Clock = ServerClock;

  /// A program with a wrong key in its settings does not hold up another one at its address.
  static constexpr unsigned kMistakes = 3;

  /// The content of the registers of the command block.
  struct CommandInput {
    CommandMode mode = CommandMode::kOff;
    std::uint32_t counter = 0;
    float a = 0.0f;
    float b = 0.0f;
    float c = 0.0f;
    float field = 0.0f;
    std::uint16_t legs_off = 0;
  };
  /// The content of the writable registers of the process data.
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

  /// The reason why a write without the lease is refused.
  Refused no_lease() const;
  asio::awaitable<Outcome> write_process(Written written, Visitor visitor);
  asio::awaitable<Outcome> write_command(Written written, Visitor visitor);
  asio::awaitable<Outcome> write_parameters(Written written, Visitor visitor);
  asio::awaitable<Outcome> carry_out(AxisRequest request, Visitor visitor);
  asio::awaitable<Refused> take_lease(std::uint16_t key, bool renew, Visitor visitor);
  bool opens(std::uint16_t key, Visitor visitor);
  Client client_of(Visitor visitor) const;
  void note_takeover(const Client& by);
  /// An input on its way to the bench.
  struct Asked {
    std::optional<Refused> answer;
    ServerTimer* waiting = nullptr;
  };
  std::shared_ptr<Asked> send(const Input& input);
  asio::awaitable<Refused> answer_to(std::shared_ptr<Asked> asked);
  asio::awaitable<Refused> ask(Input input) { return answer_to(send(input)); }
  asio::awaitable<Refused> ask(LeaseAction action, Owner number, const Client* from = nullptr);
  static Engine::Answer answer_into(std::shared_ptr<Asked> asked);

  std::uint64_t bits_of(const Row& row, Visitor visitor) const;
  /// The bits of a register that shows the last write to it; 0 for other registers.
  std::uint64_t input_bits(Content content) const;
  std::uint64_t header_bits(const Row& row) const;
  const Parameter& parameter(const Row& row) const {
    return axis_parameters(engine_.parameters(axis_))[parameter_rows_[row.index]];
  }
  /// The command that the bench takes for this tick in any state.
  Command gates_off() const { return {.answers = engine_.tick(), .phases = {}}; }
  Command command_of(const CommandInput& input) const;
  Command command_of(const ProcessInput& input, DriveState state) const;
  Outcome command(const Command& command);
  static Outcome refuse(Refused why) noexcept;

  bool latched() const noexcept;
  DriveState drive_state() const noexcept;
  std::chrono::nanoseconds patience() const noexcept { return holder_ != 0 ? idle_timeout_ : lease_time_; }
  void forget_holder();
  void watch();

  Engine& engine_;
  const RegisterMap& map_;
  std::uint32_t axis_;
  Terminals terminals_;
  std::vector<std::uint32_t> parameter_rows_;  ///< of the table of this kind of machine, by place in the map
  std::chrono::nanoseconds lease_time_;
  std::chrono::nanoseconds idle_timeout_;

  Seat seat_;
  std::uint16_t key_ = 0;             ///< of the holder
  std::uint16_t last_wrong_key_ = 0;  ///< of this lease; 0: none
  GuessLimit guesses_{kMistakes};
  std::uint64_t unread_keys_ = 0;
  Visitor holder_ = 0;       ///< 0: the connection has ended, and the key keeps the lease
  std::string holder_name_;  ///< address and port of its connection, also after its end
  bool waiting_ = false;     ///< the holder waits for its tick
  ServerTimer timer_;

  CommandInput command_;
  ProcessInput process_;
  DriveState state_ = DriveState::kSwitchOnDisabled;  ///< never kFault, which the sample shows
  Refused last_refusal_ = Refused::kNot;
  Refused holders_refusal_ = Refused::kNot;  ///< the last refusal of the holder
  LogLimit lapsed_log_;
  LogLimit guess_log_;
};

}  // namespace drivebench::modbus
