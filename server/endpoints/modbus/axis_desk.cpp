#include "server/endpoints/modbus/axis_desk.hpp"

#include <spdlog/spdlog.h>

#include "plant/faults.hpp"
#include "server/endpoints/modbus/map_info.hpp"

namespace drivebench::modbus {

namespace {

/// Who writes in a free run, which has no owners.
const Client kSomebody{.transport = "modbus", .peer = {}, .subject = {}};

}  // namespace

AxisDesk::AxisDesk(asio::io_context& io, Engine& engine, const RegisterMap& map, std::uint32_t axis)
    : engine_(engine),
      map_(map),
      axis_(axis),
      terminals_(terminals_of(engine.parameters(axis))),
      parameter_rows_(parameter_rows(engine.parameters(axis))),
      lease_time_(engine.config().setup.lease_ticks * engine.config().setup.period_ns),
      idle_timeout_(std::chrono::milliseconds(engine.config().modbus.idle_timeout_ms)),
      timer_(io) {}

// ---- reading ----

void AxisDesk::read(const RegisterMap::Range& range, Visitor who, std::span<std::uint16_t> words) const {
  for (const Row& row : range.rows) {
    std::uint16_t value[4];
    put(bits_of(row, who), row.type, range.order, value);
    for (std::size_t i = 0; i < row.size(); ++i) {  // a value may lie partly outside
      const std::size_t address = row.address + i;
      if (address >= range.first && address - range.first < range.count)
        words[address - range.first] = value[i];
    }
  }
}

std::uint64_t AxisDesk::bits_of(const Row& row, Visitor who) const {
  const Sample& sample = engine_.newest(axis_);
  switch (row.content) {
    case Content::kSignal:
    case Content::kLowBits:
      return signal_bits(row, sample);
    case Content::kStatusWord:
      return status_word(drive_state(), {.voltage_present = sample.bus_voltage_v > 0.0,
                                         .warning = (sample.faults & ~kLatchedFaults) != 0,
                                         .remote = leased(),
                                         .limit = (sample.faults & kVoltageSaturated) != 0});
    case Content::kLeaseKey:
      return holds(who) ? key_ : 0;
    case Content::kLeaseStatus:
      return engine_.owner(axis_) == 0 ? 0 : holds(who) ? 1 : leased() ? 2 : 3;
    case Content::kLastRefusal:
      return static_cast<std::uint64_t>(refusal_row(holds(who) ? holders_refusal_ : last_refusal_).modbus);
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
      return map_.blocks().size() - RegisterMap::kFirstBlocks;
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
    default:
      return 0;  // a request reads as none
  }
}

bool AxisDesk::coil(std::size_t address, Visitor who) const {
  return address == static_cast<std::size_t>(Coil::kLease) && holds(who);
}

bool AxisDesk::latched() const noexcept {
  return (engine_.newest(axis_).faults & kLatchedFaults) != 0;
}

DriveState AxisDesk::drive_state() const noexcept {
  return latched() ? DriveState::kFault : state_;
}

// ---- the lease ----

bool AxisDesk::holds(Visitor who) const noexcept {
  return leased() && holder_ == who;
}

void AxisDesk::spoke(Visitor who) {
  if (owner_ != 0 && holder_ == who) last_word_ = Clock::now();
}

void AxisDesk::connection_ended(Visitor who) {
  if (owner_ == 0 || holder_ != who) return;
  holder_ = 0;
  waiting_ = false;
  watch();
}

void AxisDesk::watch() {
  const auto patience = holder_ != 0 ? idle_timeout_ : lease_time_;
  timer_.expires_at((waiting_ ? Clock::now() : last_word_) + patience);
  timer_.async_wait([this](const boost::system::error_code& error) {
    if (error || owner_ == 0) return;
    if (!leased()) return forget();  // the bench has taken it back
    const bool spoke_since = Clock::now() < last_word_ + (holder_ != 0 ? idle_timeout_ : lease_time_);
    if (waiting_ || spoke_since) return watch();
    if (lapsed_log_.allow()) {
      spdlog::warn("modbus: the owner of axis {} {} and loses its lease ({} more since the last such line)",
                   axis_, holder_ != 0 ? "has fallen silent" : "went away", lapsed_log_.held_back());
    }
    give_back(LeaseAction::kLost);
  });
}

void AxisDesk::give_back(LeaseAction action) {
  const Owner owner = owner_;
  forget();
  engine_.request({.tick = 0, .axis = axis_, .owner = owner, .action = action}, [](Refused, Tick) {});
}

void AxisDesk::forget() {
  owner_ = 0;
  key_ = 0;
  holder_ = 0;
  timer_.cancel();
  command_ = {};
  process_ = {};
  state_ = DriveState::kSwitchOnDisabled;
  holders_refusal_ = Refused::kNot;
  on_lease_change();
}

/// The engine may answer at once or with a later tick.
std::shared_ptr<AxisDesk::Asked> AxisDesk::send(const Input& input) {
  auto asked = std::make_shared<Asked>();
  engine_.request(
      input,
      [asked](Refused refused, Tick) {
        asked->answer = refused;
        if (asked->waiting != nullptr) asked->waiting->cancel();
      },
      input.owner == 0 ? &kSomebody : nullptr);
  return asked;
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

asio::awaitable<Refused> AxisDesk::take_lease(std::uint16_t key, bool renew, Visitor who) {
  if (owner_ != 0 && !leased()) forget();
  Input input{.tick = 0, .axis = axis_, .owner = owner_, .action = LeaseAction::kRenew};
  if (owner_ == 0) {
    input.owner = engine_.new_owner({"modbus", name_of_visitor ? name_of_visitor(who) : "", ""});
    input.action = LeaseAction::kAcquire;
    const Refused why = co_await ask(input);
    if (why != Refused::kNot) co_return why;
    owner_ = input.owner;
    key_ = key;
  } else if (key != key_) {
    co_return Refused::kOwned;
  } else if (renew) {
    const Refused why = co_await ask(input);
    if (why != Refused::kNot) co_return why;
  }
  const bool changes_hands = holder_ != who;
  if (changes_hands) waiting_ = false;
  holder_ = who;
  last_word_ = Clock::now();
  watch();
  if (changes_hands) on_lease_change();
  co_return Refused::kNot;
}

}  // namespace drivebench::modbus
