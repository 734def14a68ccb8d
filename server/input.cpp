#include "server/input.hpp"

#include <bit>

namespace drivebench {
namespace {

using Words = std::uint64_t[4];

// One pair for each action that has contents.
void put(Words& w, const Command& c) noexcept {
  w[0] = static_cast<std::uint64_t>(c.answers);
  w[1] = static_cast<std::uint64_t>(c.phases.gates);
  w[2] = std::bit_cast<std::uint64_t>(c.phases.voltage_v.a);
  w[3] = std::bit_cast<std::uint64_t>(c.phases.voltage_v.b);
}
void get(const Words& w, Command& c) noexcept {
  c.answers = static_cast<Tick>(w[0]);
  c.phases.gates = static_cast<Gates>(w[1]);
  c.phases.voltage_v = {std::bit_cast<double>(w[2]), std::bit_cast<double>(w[3])};
}

void put(Words& w, const LeaseAction& action) noexcept {
  w[0] = static_cast<std::uint64_t>(action);
}
void get(const Words& w, LeaseAction& action) noexcept {
  action = static_cast<LeaseAction>(w[0]);
}

void put(Words& w, const LoadChange& change) noexcept {
  w[0] = std::bit_cast<std::uint64_t>(change.load_nm);
  w[1] = static_cast<std::uint64_t>(change.ramp_ticks);
}
void get(const Words& w, LoadChange& change) noexcept {
  change.load_nm = std::bit_cast<double>(w[0]);
  change.ramp_ticks = static_cast<Tick>(w[1]);
}

void put(Words& w, const ParameterWrite& write) noexcept {
  w[0] = write.row;
  w[1] = std::bit_cast<std::uint64_t>(write.value);
}
void get(const Words& w, ParameterWrite& write) noexcept {
  write.row = static_cast<std::uint32_t>(w[0]);
  write.value = std::bit_cast<double>(w[1]);
}

template <class Empty>
void put(Words&, const Empty&) noexcept {}
template <class Empty>
void get(const Words&, Empty&) noexcept {}

template <std::size_t Kind = 0>
void unpack_action(const PackedInput& packed, Input& input) noexcept {
  if constexpr (Kind < std::variant_size_v<decltype(input.action)>) {
    if (packed.kind != Kind) return unpack_action<Kind + 1>(packed, input);
    get(packed.words, input.action.template emplace<Kind>());
  }
}

}  // namespace

PackedInput pack(const Input& input) noexcept {
  PackedInput packed{
      .tick = input.tick, .axis = input.axis, .owner = input.owner, .kind = input.action.index()};
  std::visit([&packed](const auto& action) { put(packed.words, action); }, input.action);
  return packed;
}

Input unpack(const PackedInput& packed) noexcept {
  Input input{.tick = packed.tick,
              .axis = static_cast<std::uint32_t>(packed.axis),
              .owner = packed.owner,
              .action = {}};
  unpack_action(packed, input);
  return input;
}

std::string_view sentence_of(Refused why) noexcept {
  switch (why) {
    case Refused::kUnknownAxis:
      return "there is no such axis";
    case Refused::kNotOwner:
      return "this session does not hold the lease of the axis";
    case Refused::kOwned:
      return "another session holds the lease of the axis";
    case Refused::kNotFinite:
      return "a value is not a finite number";
    case Refused::kLatched:
      return "a latched fault is in force; its owner must clear it first";
    case Refused::kStale:
      return "the command answers a sample that is too old, already answered or not taken yet";
    case Refused::kBusy:
      return "too many requests are waiting for the bench";
    case Refused::kNot:
      break;
  }
  return {};
}

}  // namespace drivebench
