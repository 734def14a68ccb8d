#include "server/endpoints/modbus/axis_desk.hpp"

#include <utility>

#include "plant/faults.hpp"
#include "server/access/address.hpp"
#include "server/endpoints/modbus/map_info.hpp"
#include "server/host/logging/log.hpp"

namespace drivebench::modbus {

namespace {

/// The client behind a write in a free run, which has no owners.
const Client kAnyClient{.transport = "modbus", .peer = {}, .subject = {}};

}  // namespace

AxisDesk::AxisDesk(asio::io_context& io, Engine& engine, const RegisterMap& map, std::uint32_t axis)
    : engine_(engine),
      map_(map),
      axis_(axis),
      terminals_(terminals_of(engine.parameters(axis))),
      parameter_rows_(parameter_rows(engine.parameters(axis))),
      lease_time_(engine.config().setup.lease_ticks * engine.config().setup.period_ns),
      idle_timeout_(std::chrono::milliseconds(engine.config().modbus.idle_timeout_ms)),
      seat_(engine, axis),
      timer_(io) {}

// ---- reading ----

void AxisDesk::read(const RegisterMap::Range& range, Visitor visitor, std::span<std::uint16_t> words) const {
  for (const Row& row : range.rows) {
    std::uint16_t value[4];
    put(bits_of(row, visitor), row.type, range.order, value);
    for (std::size_t i = 0; i < row.size(); ++i) {  // a value may lie partly outside
      const std::size_t address = row.address + i;
      if (address >= range.first && address - range.first < range.count)
        words[address - range.first] = value[i];
    }
  }
}

std::uint64_t AxisDesk::bits_of(const Row& row, Visitor visitor) const {
  const Sample& sample = engine_.newest(axis_);
  switch (row.content) {
    case Content::kSignal:
    case Content::kLowBits:
      return signal_bits(row, sample);
    case Content::kStatusWord:
      return status_word(drive_state(), {.voltage_present = sample.bus_voltage_v > 0.0,
                                         .warning = (sample.faults & ~kLatchedFaults) != 0,
                                         .remote = seat_.is_held(),
                                         .limit = (sample.faults & kVoltageSaturated) != 0});
    case Content::kLeaseKey:
      return holds(visitor) ? key_ : 0;
    case Content::kLeaseStatus:
      return engine_.owner(axis_) == 0 ? 0 : holds(visitor) ? 1 : seat_.is_held() ? 2 : 3;
    case Content::kLastRefusal:
      return static_cast<std::uint64_t>(
          refusal_row(holds(visitor) ? holders_refusal_ : last_refusal_).modbus);
    case Content::kParameter:
      return float_bits(parameter(row).get(engine_.parameters(axis_)));
    default:
      return row.address < kProcessStart ? header_bits(row) : input_bits(row.content);
  }
}

std::uint64_t AxisDesk::header_bits(const Row& row) const {
  const BenchConfig& config = engine_.config();
  switch (row.content) {
    case Content::kMarkerWord:
      return kMarker;
    case Content::kVersionWord:
      return kMapVersion;
    case Content::kAxes:
      return config.axes.size();
    case Content::kAxis:
      return axis_;
    case Content::kMirror:
      return kMirrorOffset;
    case Content::kBlocks:
      return RegisterMap::kFirstBlocks;
    case Content::kMoreBlocks:
      return RegisterMap::kMoreBlocks;
    case Content::kFurtherBlocks:
      return map_.blocks().size() - RegisterMap::kFirstBlocks - RegisterMap::kMoreBlocks;
    case Content::kBlockId:
      return map_.blocks()[row.index].id;
    case Content::kBlockStart:
      return map_.blocks()[row.index].start;
    case Content::kBlockLength:
      return map_.blocks()[row.index].length;
    case Content::kFixedFloat:
      return std::bit_cast<std::uint32_t>(kTestFloat);
    case Content::kFixedInteger:
      return static_cast<std::uint32_t>(kTestInteger);
    case Content::kMode:
      return static_cast<std::uint64_t>(config.mode);
    case Content::kWrites:
      return map_.writable() ? 1 : 0;
    case Content::kPeriod:
      return static_cast<std::uint64_t>(config.setup.period_ns);
    case Content::kMachineKind:
      return engine_.parameters(axis_).machine.index();
    case Content::kConnection:
      return static_cast<std::uint64_t>(terminals_.connection);
    case Content::kTerminals:
      return terminals_.bits();
    default:
      return 0;
  }
}

std::uint64_t AxisDesk::input_bits(Content content) const {
  const auto word = [](std::int16_t value) { return std::uint64_t{static_cast<std::uint16_t>(value)}; };
  const auto real = [](float value) { return std::uint64_t{std::bit_cast<std::uint32_t>(value)}; };
  switch (content) {
    case Content::kControlWord:
      return process_.control_word;
    case Content::kReferenceMode:
      return static_cast<std::uint64_t>(process_.mode);
    case Content::kReferenceA:
      return word(process_.a);
    case Content::kReferenceB:
      return word(process_.b);
    case Content::kReferenceC:
      return word(process_.c);
    case Content::kReferenceField:
      return word(process_.field);
    case Content::kCommandMode:
      return static_cast<std::uint64_t>(command_.mode);
    case Content::kCounter:
      return command_.counter;
    case Content::kSetpointA:
      return real(command_.a);
    case Content::kSetpointB:
      return real(command_.b);
    case Content::kSetpointC:
      return real(command_.c);
    case Content::kSetpointField:
      return real(command_.field);
    case Content::kLegsOff:
      return command_.legs_off;
    default:
      return 0;  // a request register reads as no request
  }
}

bool AxisDesk::coil(std::size_t address, Visitor visitor) const {
  return address == static_cast<std::size_t>(Coil::kLease) && holds(visitor);
}

bool AxisDesk::latched() const noexcept {
  return engine_.latched(axis_) != 0;
}

DriveState AxisDesk::drive_state() const noexcept {
  return latched() ? DriveState::kFault : state_;
}

// ---- the lease ----

bool AxisDesk::holds(Visitor visitor) const noexcept {
  return seat_.is_held() && holder_ == visitor;
}

void AxisDesk::spoke(Visitor visitor) {
  if (seat_.owner() != 0 && holder_ == visitor) seat_.hear(Clock::now());
}

void AxisDesk::connection_ended(Visitor visitor) {
  if (seat_.owner() == 0 || holder_ != visitor) return;
  holder_ = 0;
  waiting_ = false;
  watch();
}

void AxisDesk::watch() {
  if (waiting_) seat_.wait(Clock::now());
  timer_.expires_at(seat_.silent_since() + patience());
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || seat_.owner() == 0) return;
    if (seat_.notice_end()) return forget_holder();
    if (waiting_ || !seat_.is_silent(Clock::now(), patience())) return watch();
    if (lapsed_log_.allow()) {
      log::warn("modbus: the owner of axis {} {} and loses its lease ({} more since the last such line)",
                axis_, holder_ != 0 ? "has fallen silent" : "went away", lapsed_log_.held_back());
    }
    forget_holder();
    seat_.lose();
  });
}

/// Forgets the holder of a seat that is empty or about to be.
void AxisDesk::forget_holder() {
  key_ = last_wrong_key_ = 0;
  holder_ = 0;
  holder_name_.clear();
  timer_.cancel();
  command_ = {};
  process_ = {};
  state_ = DriveState::kSwitchOnDisabled;
  holders_refusal_ = Refused::kNot;
  on_lease_change();
}

/// Sends the input to the engine, which may answer at once or with a later tick.
std::shared_ptr<AxisDesk::Asked> AxisDesk::send(const Input& input) {
  auto asked = std::make_shared<Asked>();
  engine_.request(input, answer_into(asked), input.owner == 0 ? &kAnyClient : nullptr);
  return asked;
}

asio::awaitable<Refused> AxisDesk::ask(LeaseAction action, Owner number, const Client* from) {
  auto asked = std::make_shared<Asked>();
  seat_.ask(action, number, answer_into(asked), from);
  return answer_to(std::move(asked));
}

Engine::Answer AxisDesk::answer_into(std::shared_ptr<Asked> asked) {
  return [asked = std::move(asked)](Refused refused, Tick) {
    asked->answer = refused;
    if (asked->waiting != nullptr) asked->waiting->cancel();
  };
}

asio::awaitable<Refused> AxisDesk::answer_to(std::shared_ptr<Asked> asked) {
  if (!asked->answer) {
    ServerTimer timer(timer_.get_executor(), Clock::time_point::max());
    asked->waiting = &timer;
    boost::system::error_code cancelled;
    co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, cancelled));
    asked->waiting = nullptr;
  }
  co_return asked->answer.value_or(Refused::kBusy);
}

Client AxisDesk::client_of(Visitor visitor) const {
  return {.transport = "modbus", .peer = name_of_visitor ? name_of_visitor(visitor) : "", .subject = {}};
}

/// Whether this is the key of the holder: the only place that compares keys. The holder's own connection
/// never waits for the guesses of others at its address, and a client that repeats one wrong key learns
/// nothing new.
bool AxisDesk::opens(std::uint16_t key, Visitor visitor) {
  if (holder_ == visitor) return key == key_;
  if (key == last_wrong_key_) return false;
  const std::string address = address_of(client_of(visitor));
  const auto now = Clock::now();
  if (guesses_.wait_of(address, now) > GuessLimit::Duration{}) {
    ++unread_keys_;
    return false;
  }
  if (key == key_) {
    guesses_.note_right(address);
    return true;
  }
  guesses_.note_wrong(address, now);
  last_wrong_key_ = key;
  const std::chrono::duration<double> wait = guesses_.wait_of(address, now);
  if (wait.count() > 0.0 && guess_log_.allow()) {
    log::warn(
        "modbus: a wrong key for axis {} from {}: the next one is read in {:.1f} s ({} more since the last "
        "such line)",
        axis_, address, wait.count(), guess_log_.held_back());
  }
  return false;
}

/// A connection that follows an ended one of the same address is that of a client that connects for each
/// request.
void AxisDesk::note_takeover(const Client& by) {
  const Client before{.transport = "modbus", .peer = std::exchange(holder_name_, by.peer), .subject = {}};
  if (before.peer.empty() || (holder_ == 0 && address_of(before) == address_of(by))) return;
  if (on_takeover) on_takeover(by, before.peer);
}

/// Takes the lease for a key that opens it, or a new one.
asio::awaitable<Refused> AxisDesk::take_lease(std::uint16_t key, bool renew, Visitor visitor) {
  if (seat_.notice_end()) forget_holder();
  if (seat_.owner() == 0) {
    const Client client = client_of(visitor);
    const Refused why = co_await ask(LeaseAction::kAcquire, seat_.number_for(client), &client);
    if (why != Refused::kNot) co_return why;
    key_ = key;
  } else if (renew) {
    const Refused why = co_await ask(LeaseAction::kRenew, seat_.owner());
    if (why != Refused::kNot) co_return why;
  }
  const bool changes_hands = holder_ != visitor;
  if (changes_hands) {
    waiting_ = false;
    note_takeover(client_of(visitor));
  }
  holder_ = visitor;
  seat_.hear(Clock::now());
  watch();
  if (changes_hands) on_lease_change();
  co_return Refused::kNot;
}

}  // namespace drivebench::modbus
