// Messages of the wire and of recordings: a command or input that is taken can be written down and read back.
#include <bench.pb.h>

#include <algorithm>
#include <array>
#include <bit>

#include "server/recording/input_codec.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/quiet_protobuf.hpp"

namespace drivebench::fuzz {
namespace {

LegEdges edges_of(const Input& input) noexcept {
  const auto* const command = std::get_if<Command>(&input.action);
  return command != nullptr ? command->phases.edges : LegEdges{};
}

bool equal(const Input& a, const Input& b) noexcept {
  const PackedInput x = pack(a);
  const PackedInput y = pack(b);
  return x.tick == y.tick && x.axis == y.axis && x.owner == y.owner && x.kind == y.kind &&
         std::ranges::equal(x.words, y.words) &&
         std::bit_cast<std::array<std::uint64_t, 12>>(edges_of(a)) ==
             std::bit_cast<std::array<std::uint64_t, 12>>(edges_of(b));
}

/// An axis of every kind of machine.
const ParameterTables& tables() {
  static const ParameterTables all = [] {
    ParameterTables result;
    for (std::size_t kind = 0; kind < machine_kinds().size(); ++kind) {
      AxisParameters p;
      p.machine = make_machine(kind);
      result.push_back(axis_parameters(p));
    }
    return result;
  }();
  return all;
}

void check_input(const v1::Input& message) {
  const std::optional<Input> input = decode_input(message, tables());
  if (!input) return;
  const auto* lease = std::get_if<LeaseAction>(&input->action);
  const auto* write = std::get_if<ParameterWrite>(&input->action);
  require(write == nullptr || write->row < tables()[input->axis].size(), "only known parameters are written");
  const auto* fault = std::get_if<InjectFault>(&input->action);
  require(fault == nullptr || fault->row < kInjectableFaultCount, "only known faults are injected");
  require(lease == nullptr || v1::LeaseRequest::Action_IsValid(static_cast<int>(*lease)),
          "only known lease actions are taken");
  v1::Input written;
  encode_input(static_cast<Tick>(message.received_tick()), *input, tables(), written);
  const std::optional<Input> again = decode_input(written, tables());
  require(again && equal(*input, *again), "an input survives a recording");
  require(!may_be_scheduled(input->action) || equal(*input, unpack(pack(*input))),
          "an input survives a saved state");
}

/// The commands of an exchange, in the form of a recording.
void check_commands(const v1::Exchange& exchange) {
  for (const v1::Command& each : exchange.commands()) {
    v1::Input recorded;
    *recorded.mutable_command() = each;
    EdgeRecords edges{};
    const bool in_order = each.gates() != v1::GATES_EDGES ||
                          (read_edges(each, edges).sentence.empty() &&
                           problem_with(edges, std::int64_t{kMaxOffsetNs} + 1).sentence.empty());
    require(decode_input(recorded, tables()).has_value() ==
                (v1::Gates_IsValid(each.gates()) && each.legs_off() <= kAllLegs && in_order),
            "only known gates and legs and edges in order make a command");
    check_input(recorded);
  }
}

}  // namespace
}  // namespace drivebench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  fuzz::silence_protobuf();
  v1::Envelope envelope;
  if (envelope.ParseFromArray(data, static_cast<int>(size))) fuzz::check_commands(envelope.exchange());
  v1::Input input;
  if (input.ParseFromArray(data, static_cast<int>(size))) fuzz::check_input(input);
  return 0;
}
