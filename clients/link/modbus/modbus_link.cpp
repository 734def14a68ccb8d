#include "clients/link/modbus/modbus_link.hpp"

#include <modbus/modbus.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <random>
#include <thread>
#include <utility>

#include "clients/link/common/address.hpp"
#include "protocols/modbus/register_map.hpp"

namespace drivebench::link {
namespace {

using modbus::Content;
using modbus::Row;
using Clock = std::chrono::steady_clock;

constexpr std::string_view kModbusScheme = "modbus:";

/// The first of the fixed rows with this content.
constexpr const Row& row_of(Content content) {
  for (const Row& row : modbus::map_detail::kFixedRows) {
    if (row.content == content) return row;
  }
  std::abort();
}
constexpr std::uint16_t address_of(Content content) {
  return row_of(content).address;
}

/// The value of a row in `words`, which hold the registers from `start` on.
double value_of(const Row& row, std::uint16_t start, std::span<const std::uint16_t> words) {
  return modbus::number_of(row.type,
                           modbus::get(row.type, modbus::WordOrder::kAbcd, &words[row.address - start]));
}

constexpr SignalMask kKnown = [] {
  SignalMask mask = 0;
  for (const Row& row : modbus::map_detail::kFixedRows) {
    const bool is_read = row.address >= modbus::kSampleStart &&
                         row.end() <= std::size_t{modbus::kSampleStart} + modbus::kSensorsLength;
    if (is_read && row.content == Content::kSignal) mask |= SignalMask{1} << row.index;
  }
  return mask;
}();

/// The mode in the numbers of the register.
modbus::CommandMode mode_of(v1::Gates gates) {
  if (gates == v1::GATES_CURRENT) return modbus::CommandMode::kCurrent;
  return gates == v1::GATES_DUTY ? modbus::CommandMode::kLegDuty : static_cast<modbus::CommandMode>(gates);
}

}  // namespace

bool is_modbus_address(std::string_view text) noexcept {
  return text.starts_with(kModbusScheme);
}

ModbusAddress parse_modbus_address(std::string_view text) {
  std::string_view place = is_modbus_address(text) ? text.substr(kModbusScheme.size()) : text;
  ModbusAddress address;
  if (const std::size_t mark = place.find('?'); mark != std::string_view::npos) {
    const std::string_view key = place.substr(mark + 1);
    constexpr std::string_view kUnit = "unit=";
    const char* const end = key.data() + key.size();
    const char* const digits = key.starts_with(kUnit) ? key.data() + kUnit.size() : end;
    const auto [stop, error] = std::from_chars(digits, end, address.unit);
    if (error != std::errc{} || stop != end || address.unit < 1 || address.unit > 247) {
      throw AddressError("'" + std::string(text) + "' is not an address: after ? comes unit=1 to unit=247");
    }
    place = place.substr(0, mark);
  }
  const bool has_port = place.rfind(':') != std::string_view::npos && !place.ends_with(']');
  try {
    const Address tcp = parse_address("tcp:" + std::string(place) + (has_port ? "" : ":1502"));
    address.host = tcp.host;
    address.port = tcp.port;
  } catch (const AddressError&) {
    throw AddressError("'" + std::string(text) + "' is not an address: expected modbus:HOST[:PORT][?unit=N]");
  }
  return address;
}

void ModbusLink::Free::operator()(_modbus* context) const noexcept {
  ::modbus_close(context);
  ::modbus_free(context);
}

ModbusLink::ModbusLink(const ModbusAddress& address, std::chrono::milliseconds deadline)
    : name_(std::string(kModbusScheme) + address.host + ":" + address.port +
            "?unit=" + std::to_string(address.unit)),
      deadline_(deadline),
      modbus_(::modbus_new_tcp_pi(address.host.c_str(), address.port.c_str())),
      key_(static_cast<std::uint16_t>(1 + std::random_device{}() % 0xFFFF)) {
  if (!modbus_) throw ConnectError(name_ + ": " + ::modbus_strerror(errno));
  const auto us = std::chrono::microseconds(deadline).count();
  ::modbus_set_slave(modbus_.get(), address.unit);
  ::modbus_set_response_timeout(modbus_.get(), static_cast<std::uint32_t>(us / 1'000'000),
                                static_cast<std::uint32_t>(us % 1'000'000));
  if (::modbus_connect(modbus_.get()) != 0) {
    throw ConnectError("nothing answers at " + name_ + ": " + ::modbus_strerror(errno));
  }
  describe();
}

void ModbusLink::describe() {
  std::array<std::uint16_t, row_of(Content::kPeriod).end()> words{};
  read(0, words);
  const auto value = [&words](Content content) { return value_of(row_of(content), 0, words); };
  if (words[0] != modbus::kMarker || words[1] != modbus::kMapVersion) {
    throw LinkError(name_ + " has no register map of drivebench, version " +
                    std::to_string(modbus::kMapVersion));
  }
  bench_.set_name(name_);
  bench_.set_period_s(value(Content::kPeriod) * 1e-9);
  const auto mode = static_cast<unsigned>(value(Content::kMode));
  bench_.set_mode(mode == 0 ? v1::MODE_REALTIME : mode == 1 ? v1::MODE_LOCKSTEP : v1::MODE_FREE);
  bench_.add_axes()->set_name(std::to_string(static_cast<unsigned>(value(Content::kAxis))));
  writes_allowed_ = value(Content::kWrites) != 0.0;
}

ModbusLink::~ModbusLink() {
  if (!holds_axis_) return;
  try {
    release();  // the end of the connection alone keeps the axis for the client that has the key
  } catch (const std::exception&) {
    return;  // the lease runs out
  }
}

void ModbusLink::acquire() {
  if (!writes_allowed_) refuse(v1::REFUSAL_READ_ONLY, "the bench allows no writes over Modbus");
  write(address_of(Content::kLeaseKey), key_);
  holds_axis_ = true;
}

void ModbusLink::release() {
  holds_axis_ = false;
  write(address_of(Content::kRequest), static_cast<std::uint16_t>(modbus::AxisRequest::kRelease));
}

void ModbusLink::clear_faults() {
  write(address_of(Content::kRequest), static_cast<std::uint16_t>(modbus::AxisRequest::kClearFaults));
}

void ModbusLink::write_parameter(std::string_view name, double) {
  refuse(v1::REFUSAL_READ_ONLY, "over Modbus parameters have no names; write their registers", name);
}

void ModbusLink::set_load(const LoadChange&) {
  refuse(v1::REFUSAL_READ_ONLY, "the load cannot be set over Modbus", "load");
}

SignalMask ModbusLink::known() const noexcept {
  return kKnown;
}

const Sample& ModbusLink::newest() {
  std::array<std::uint16_t, modbus::kSensorsLength> words{};
  read(modbus::kSampleStart, words);
  sample_ = modbus::read_sample(words);
  return sample_;
}

const Sample& ModbusLink::exchange(const AxisCommand& command) {
  constexpr std::span<const Row> kRows(modbus::map_detail::kMoreCommand);
  constexpr const Row& kLegs = modbus::map_detail::kLegs.front();
  constexpr std::uint16_t kFirst = kRows[2].address;  // after lease and request
  static_assert(kRows[2].content == Content::kCommandMode && kLegs.address == kRows.back().end());
  const Setpoints x = setpoints_of(command);
  std::array<std::uint16_t, kLegs.end() - kFirst> registers{};
  for (const Row& row : kRows.subspan(2)) {
    std::uint64_t bits = command.tick;
    if (row.content == Content::kCommandMode) bits = static_cast<std::uint64_t>(mode_of(command.gates));
    if (row.content == Content::kSetpointA) bits = modbus::float_bits(x.a);
    if (row.content == Content::kSetpointB) bits = modbus::float_bits(x.b);
    if (row.content == Content::kSetpointC) bits = modbus::float_bits(x.c);
    if (row.content == Content::kSetpointField) bits = modbus::float_bits(x.f);
    modbus::put(bits, row.type, modbus::WordOrder::kAbcd, &registers[row.address - kFirst]);
  }
  // A bench of an earlier build has no register for the legs, and it keeps its value from write to write.
  commands_legs_ = commands_legs_ || command.legs_off != 0;
  registers.back() = static_cast<std::uint16_t>(std::min(command.legs_off, 0xFFFFu));
  const std::size_t count = registers.size() - (commands_legs_ ? 0 : kLegs.size());
  const std::uint64_t tick = command.tick;
  std::array<std::uint16_t, modbus::kSensorsLength> words{};
  check(::modbus_write_and_read_registers(modbus_.get(), kFirst, static_cast<int>(count), registers.data(),
                                          modbus::kSampleStart, static_cast<int>(words.size()), words.data()),
        "the sample after tick " + std::to_string(tick));
  sample_ = modbus::read_sample(words);
  // In real time the answer may come within the same tick.
  const Clock::time_point give_up = Clock::now() + deadline_;
  while (sample_.tick <= tick) {
    if (Clock::now() > give_up) throw LinkError(name_ + " gave no sample after tick " + std::to_string(tick));
    std::this_thread::sleep_for(std::chrono::duration<double>(bench_.period_s() / 4));
    newest();
  }
  return sample_;
}

void ModbusLink::read(std::uint16_t start, std::span<std::uint16_t> words) {
  check(::modbus_read_registers(modbus_.get(), start, static_cast<int>(words.size()), words.data()),
        "registers from " + std::to_string(start));
}

void ModbusLink::write(std::uint16_t address, std::uint16_t value) {
  check(::modbus_write_register(modbus_.get(), address, value), "register " + std::to_string(address));
}

void ModbusLink::check(int result, std::string_view doing) {
  if (result >= 0) return;
  switch (errno) {
    case EMBXILFUN:
      refuse(v1::REFUSAL_MALFORMED, "the bench does not have this function code", doing);
    case EMBXILADD:
      refuse(v1::REFUSAL_READ_ONLY, "there are no such registers, or they cannot be written", doing);
    case EMBXILVAL:
      refuse(v1::REFUSAL_OUT_OF_RANGE, "a value is not a number or out of range", doing);
    case EMBXGPATH:
    case EMBXGTAR:
      refuse(v1::REFUSAL_UNKNOWN_AXIS, "the bench has no axis at this unit id", "unit");
    case EMBXSBUSY:
    case EMBXSFAIL:
      refuse_busy();
    default:
      break;
  }
  const std::string why = ::modbus_strerror(errno);
  ::modbus_close(modbus_.get());  // a late answer must not pass for that of the next request
  throw LinkError(name_ + " gave no answer about " + std::string(doing) + ": " + why);
}

/// Exception 6 has many reasons; a register holds the actual one.
void ModbusLink::refuse_busy() {
  std::uint16_t why = 0;
  const bool is_read =
      ::modbus_read_registers(modbus_.get(), address_of(Content::kLastRefusal), 1, &why) >= 0;
  const auto code = is_read && why != 0 ? static_cast<modbus::Refusal>(why) : modbus::Refusal::kBusy;
  const RefusalRow& meaning = refusal_meant_by(&RefusalRow::modbus, code, drivebench::Refused::kBusy);
  refuse(static_cast<v1::RefusalCode>(meaning.tcp), meaning.sentence);
}

}  // namespace drivebench::link
