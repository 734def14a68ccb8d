#include "server/bench/input.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <vector>

namespace drivebench::input_test {
namespace {

Input input_with(const decltype(Input::action)& action) {
  return {.tick = -5, .axis = 3, .owner = 0xffff'ffff'ffff'fffeu, .action = action};
}

/// One of each kind, in the order of the variant.
std::vector<Input> one_of_each() {
  return {input_with(ClearFaults{}),
          input_with(Command{.answers = 1'234'567'890'123,
                             .phases = {.gates = Gates::kZeroVoltage,
                                        .legs_off = 6,
                                        .setpoint = {.a = -0.1, .b = 1e300, .c = -0.0, .field = 5e-324}}}),
          input_with(LeaseAction::kLost),
          input_with(LoadChange{.load_nm = -0.3, .ramp_ticks = 1'000'000'007}),
          input_with(ParameterWrite{.row = 17, .value = 3.9, .ramp_ticks = 1'000'000'000'007}),
          input_with(LateTick{}),
          input_with(Overrun{}),
          input_with(RefusedCommand{}),
          input_with(InjectFault{.row = 27, .value = -0.5}),
          input_with(ShaftBump{.impulse_nms = -1e-3}),
          input_with(Multisine{
              .quantity = Multisine::Quantity::kCurrentOffset,
              .periods = 1'000'000,
              .amplitude = -0.7,
              .lines = {.period_ticks = 1'000'000'007, .lowest = 5, .highest = 400'000'007, .ratio = 1.3}})};
}

// Catches: a field that packing loses, exchanges or narrows; a kind without its pair of functions.
TEST(Input, EveryKindSurvivesPackingWordForWord) {
  const std::vector<Input> inputs = one_of_each();
  ASSERT_EQ(inputs.size(), std::variant_size_v<decltype(Input::action)>);
  for (std::size_t kind = 0; kind < inputs.size(); ++kind) {
    const PackedInput packed = pack(inputs[kind]);
    EXPECT_EQ(packed.kind, kind);
    const Input back = unpack(packed);
    EXPECT_EQ(back.tick, -5);
    EXPECT_EQ(back.axis, 3u);
    EXPECT_EQ(back.owner, 0xffff'ffff'ffff'fffeu);
    ASSERT_EQ(back.action.index(), kind);
    const PackedInput again = pack(back);
    EXPECT_EQ(std::memcmp(&packed, &again, sizeof(packed)), 0);
  }
  const auto command = std::get<Command>(unpack(pack(inputs[1])).action);
  EXPECT_EQ(command.answers, 1'234'567'890'123);
  EXPECT_EQ(command.phases.gates, Gates::kZeroVoltage);
  EXPECT_EQ(command.phases.legs_off, 6u);
  EXPECT_EQ(command.phases.setpoint.a, -0.1);
  EXPECT_EQ(command.phases.setpoint.b, 1e300);
  EXPECT_TRUE(std::signbit(command.phases.setpoint.c));
  EXPECT_EQ(command.phases.setpoint.field, 5e-324);
  EXPECT_EQ(std::get<LeaseAction>(unpack(pack(inputs[2])).action), LeaseAction::kLost);
  const auto load = std::get<LoadChange>(unpack(pack(inputs[3])).action);
  EXPECT_EQ(load.load_nm, -0.3);
  EXPECT_EQ(load.ramp_ticks, 1'000'000'007);
  const auto write = std::get<ParameterWrite>(unpack(pack(inputs[4])).action);
  EXPECT_EQ(write.row, 17u);
  EXPECT_EQ(write.value, 3.9);
  EXPECT_EQ(write.ramp_ticks, 1'000'000'000'007);
  const auto fault = std::get<InjectFault>(unpack(pack(inputs[8])).action);
  EXPECT_EQ(fault.row, 27u);
  EXPECT_EQ(fault.value, -0.5);
  EXPECT_EQ(std::get<ShaftBump>(unpack(pack(inputs[9])).action).impulse_nms, -1e-3);
  const auto multisine = std::get<Multisine>(unpack(pack(inputs[10])).action);
  EXPECT_EQ(multisine.quantity, Multisine::Quantity::kCurrentOffset);
  EXPECT_EQ(multisine.periods, 1'000'000u);
  EXPECT_EQ(multisine.amplitude, -0.7);
  EXPECT_EQ(multisine.lines.period_ticks, 1'000'000'007u);
  EXPECT_EQ(multisine.lines.lowest, 5u);
  EXPECT_EQ(multisine.lines.highest, 400'000'007u);
  EXPECT_EQ(multisine.lines.ratio, 1.3);
}

// Catches: words of the stack in a packed input, which would make equal states hash differently.
TEST(Input, UnusedWordsAreZero) {
  for (const Input& input : one_of_each()) {
    const PackedInput packed = pack(input);
    const std::size_t used = std::holds_alternative<Command>(input.action)          ? 6
                             : std::holds_alternative<Multisine>(input.action)      ? 5
                             : std::holds_alternative<ParameterWrite>(input.action) ? 3
                             : std::holds_alternative<LoadChange>(input.action)     ? 2
                             : std::holds_alternative<InjectFault>(input.action)    ? 2
                             : std::holds_alternative<LeaseAction>(input.action)    ? 1
                             : std::holds_alternative<ShaftBump>(input.action)      ? 1
                                                                                    : 0;
    for (std::size_t i = used; i < std::size(packed.words); ++i)
      EXPECT_EQ(packed.words[i], 0u);
  }
}

// Catches: a kind from a damaged file that reads past the table.
TEST(Input, AnUnknownKindIsAClearWithoutAnOwner) {
  for (const std::uint64_t kind : {std::uint64_t{11}, std::numeric_limits<std::uint64_t>::max()}) {
    const Input input = unpack({.tick = 4, .axis = 1, .owner = 0, .kind = kind, .words = {1, 2, 3, 4, 5, 6}});
    EXPECT_TRUE(std::holds_alternative<ClearFaults>(input.action));
    EXPECT_EQ(input.owner, 0u);
  }
}

// Catches: a limit that is not kept, a sign that a fault has no use for, half a phase.
TEST(Input, FaultsAreCheckedByTheirTable) {
  const auto problem = [](const char* name, double value) {
    return problem_with(kInjectableFaults[find_injectable_fault(name)], value);
  };
  for (const InjectableFault& fault : kInjectableFaults) {
    EXPECT_EQ(problem_with(fault, 0.0), "") << fault.name;
    EXPECT_EQ(problem_with(fault, fault.maximum), "") << fault.name;
    EXPECT_EQ(problem_with(fault, -fault.maximum).empty(), fault.magnitude) << fault.name;
    EXPECT_NE(problem_with(fault, std::nextafter(fault.maximum, 1e300)), "") << fault.name;
    EXPECT_EQ(problem_with(fault, std::numeric_limits<double>::quiet_NaN()), "is not a finite number");
    EXPECT_NE(problem_with(fault, -std::numeric_limits<double>::infinity()), "");
  }
  EXPECT_EQ(problem("open_phase", 4), "is 4 but must lie between 0 and 3 phase");
  EXPECT_EQ(problem("open_phase", 1.5), "is 1.5 but must be a whole number");
  EXPECT_EQ(problem("hall_offset", -4), "is -4 but must lie between -3.15 and 3.15 rad");
}

}  // namespace
}  // namespace drivebench::input_test
