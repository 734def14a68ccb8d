// Requests for experiments: which are taken, which are refused, and the field that the refusal names.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/server/experiments/experiment_requests.hpp"

namespace drivebench::experiment_plan_test {
namespace {

/// The field that the refusal of a request names.
std::string field_of(const v1::RunExperiment& r, const std::string& name = "servo") {
  try {
    plan_of(r, name);
  } catch (const BadRequest& bad) {
    EXPECT_STRNE(bad.what(), "");
    return bad.field();
  }
  return "nothing";
}

struct Bad {
  std::string field;
  void (*change)(v1::RunExperiment&);
};

// Catches: a rule that is not checked, or whose refusal names another field.
TEST(ExperimentPlan, NamesTheWrongFieldOfARequest) {
  const std::vector<Bad> bads = {
      {"nothing", [](v1::RunExperiment&) {}},
      {"owner", [](v1::RunExperiment& r) { r.set_owner("short"); }},
      {"user", [](v1::RunExperiment& r) { r.set_user("a\nb"); }},
      {"mode", [](v1::RunExperiment& r) { r.set_mode(v1::MODE_LOCKSTEP); }},
      {"axis", [](v1::RunExperiment& r) { r.set_axis(1); }},
      {"duration_s", [](v1::RunExperiment& r) { r.set_duration_s(1.0); }},
      {"duration_s", [](v1::RunExperiment& r) { r.clear_ticks(); }},
      {"duration_s",
       [](v1::RunExperiment& r) {
         r.clear_ticks();
         r.set_duration_s(std::numeric_limits<double>::quiet_NaN());
       }},
      {"ticks", [](v1::RunExperiment& r) { r.set_ticks(~std::uint64_t{0}); }},
      {"decimation", [](v1::RunExperiment& r) { r.set_decimation(401); }},
      {"signals", [](v1::RunExperiment& r) { r.clear_signals(); }},
      {"signals[1]", [](v1::RunExperiment& r) { r.set_signals(1, "i_a_a"); }},
      {"signals[0]", [](v1::RunExperiment& r) { r.set_signals(0, "i_x_a"); }},
      {"settings[0].name", [](v1::RunExperiment& r) { r.add_settings()->set_name("machine.resistance"); }},
      {"settings[0].value",
       [](v1::RunExperiment& r) { r.add_settings()->set_name("machine.rotor_resistance_ohm"); }},
      {"input.kind", [](v1::RunExperiment& r) { r.mutable_input()->clear_kind(); }},
      {"input.kind", [](v1::RunExperiment& r) { r.mutable_input()->set_kind(v1::INPUT_KIND_SOURCE); }},
      {"input.kind",
       [](v1::RunExperiment& r) { r.mutable_input()->set_kind(v1::INPUT_KIND_PHASE_CURRENTS); }},
      {"input.shapes", [](v1::RunExperiment& r) { r.mutable_input()->set_kind(v1::INPUT_KIND_NONE); }},
      {"input.angle", [](v1::RunExperiment& r) { r.mutable_input()->set_angle(v1::ANGLE_SOURCE_TRUE); }},
      {"input.shapes[1]",
       [](v1::RunExperiment& r) { r.mutable_input()->add_shapes()->set_channel(v1::CHANNEL_A); }},
      {"input.shapes[1].channel",
       [](v1::RunExperiment& r) { r.mutable_input()->add_shapes()->mutable_constant(); }},
      {"input.shapes[0].channel",
       [](v1::RunExperiment& r) { r.mutable_input()->mutable_shapes(0)->set_channel(v1::CHANNEL_A); }},
      {"input.shapes[0].three_phase.frequency_hz",
       [](v1::RunExperiment& r) {
         r.mutable_input()->mutable_shapes(0)->mutable_three_phase()->set_frequency_hz(4001.0);
       }},
      {"input.shapes[0].three_phase.amplitude",
       [](v1::RunExperiment& r) {
         r.mutable_input()->mutable_shapes(0)->mutable_three_phase()->set_amplitude(-HUGE_VAL);
       }},
      {"input.shapes[0].end_s",
       [](v1::RunExperiment& r) {
         r.mutable_input()->mutable_shapes(0)->set_start_s(0.01);
         r.mutable_input()->mutable_shapes(0)->set_end_s(0.01);
       }},
      {"input.shapes[1].table.id",
       [](v1::RunExperiment& r) {
         v1::Shape& shape = *r.mutable_input()->add_shapes();
         shape.set_channel(v1::CHANNEL_B);
         shape.mutable_table()->set_id(7);
       }},
      {"input.shapes[1].prbs.order",
       [](v1::RunExperiment& r) {
         v1::Shape& shape = *r.mutable_input()->add_shapes();
         shape.set_channel(v1::CHANNEL_B);
         shape.mutable_prbs()->set_order(21);
       }},
      {"input.shapes[1].multisine.harmonics",
       [](v1::RunExperiment& r) {
         v1::Shape& shape = *r.mutable_input()->add_shapes();
         shape.set_channel(v1::CHANNEL_B);
         shape.mutable_multisine()->set_base_hz(1000.0);
         shape.mutable_multisine()->add_harmonics(5);
       }},
      {"events[0]", [](v1::RunExperiment& r) { r.add_events(); }},
      {"events[0].at_s",
       [](v1::RunExperiment& r) {
         r.add_events()->set_load_nm(0.1);
         r.mutable_events(0)->set_at_s(0.05);
       }},
      {"events[0].axis",
       [](v1::RunExperiment& r) {
         r.add_events()->set_load_nm(0.1);
         r.mutable_events(0)->set_axis(1);
       }},
      {"events[0].load_nm", [](v1::RunExperiment& r) { r.add_events()->set_load_nm(1e7); }},
      {"events[0].fault.name",
       [](v1::RunExperiment& r) { r.add_events()->mutable_fault()->set_name("gremlins"); }},
      {"events[0].fault.value",
       [](v1::RunExperiment& r) {
         r.add_events()->mutable_fault()->set_name("open_phase");
         r.mutable_events(0)->mutable_fault()->set_value(4.0);
       }},
      {"events[0].bump_nms", [](v1::RunExperiment& r) { r.add_events()->set_bump_nms(-1e9); }},
      {"events[0].parameter.name",
       [](v1::RunExperiment& r) {
         r.add_events()->mutable_parameter()->set_name("machine.pole_pairs");
         r.mutable_events(0)->mutable_parameter()->set_value(2.0);
       }},
      {"events[0].parameter.name",
       [](v1::RunExperiment& r) { r.add_events()->mutable_parameter()->set_name("machine.colour"); }},
      {"input.shapes",
       [](v1::RunExperiment& r) {
         for (int i = 0; i < 1000; ++i)
           *r.mutable_input()->add_shapes() = r.input().shapes(0);
       }},
      {"input.angle", [](v1::RunExperiment& r) { r.mutable_input()->set_kind(v1::INPUT_KIND_DQ_VOLTAGES); }},
      {"input.back_emf_vs",
       [](v1::RunExperiment& r) {
         r.mutable_input()->set_kind(v1::INPUT_KIND_DQ_VOLTAGES);
         r.mutable_input()->set_angle(v1::ANGLE_SOURCE_MEASURED);
         r.mutable_input()->set_back_emf_vs(HUGE_VAL);
       }},
      {"initial.speed_rad_s", [](v1::RunExperiment& r) { r.mutable_initial()->set_speed_rad_s(1e6); }},
      {"stop.current_a", [](v1::RunExperiment& r) { r.mutable_stop()->set_current_a(-1.0); }},
  };
  for (const Bad& bad : bads) {
    v1::RunExperiment r = good();
    bad.change(r);
    EXPECT_EQ(field_of(r), bad.field) << r.ShortDebugString();
  }
}

v1::RunExperiment on_channel(v1::Channel channel, v1::InputKind kind) {
  v1::RunExperiment r = good();
  r.mutable_input()->set_kind(kind);
  if (kind == v1::INPUT_KIND_DQ_VOLTAGES) r.mutable_input()->set_angle(v1::ANGLE_SOURCE_TRUE);
  r.mutable_input()->clear_shapes();
  v1::Shape& shape = *r.mutable_input()->add_shapes();
  shape.set_channel(channel);
  shape.mutable_constant()->set_value(1.0);
  return r;
}

// Catches: a voltage that is taken for a terminal that the machine lacks, or refused for one that it has.
TEST(ExperimentPlan, AShapeDrivesOnlyTerminalsOfTheMachine) {
  struct Terminals {
    const char* bench;
    v1::InputKind kind;
    std::vector<v1::Channel> there;
  };
  const std::vector<Terminals> rows = {
      {"servo", v1::INPUT_KIND_PHASE_VOLTAGES, {v1::CHANNEL_A, v1::CHANNEL_B}},
      {"bldc-servo", v1::INPUT_KIND_PHASE_VOLTAGES, {v1::CHANNEL_A, v1::CHANNEL_B, v1::CHANNEL_C}},
      {"dc-separate-servo", v1::INPUT_KIND_PHASE_VOLTAGES, {v1::CHANNEL_A, v1::CHANNEL_F}},
      {"servo", v1::INPUT_KIND_DQ_VOLTAGES, {v1::CHANNEL_D, v1::CHANNEL_Q}},
  };
  for (const Terminals& row : rows) {
    for (const v1::Channel channel :
         {v1::CHANNEL_A, v1::CHANNEL_B, v1::CHANNEL_C, v1::CHANNEL_F, v1::CHANNEL_D, v1::CHANNEL_Q}) {
      const bool there = std::find(row.there.begin(), row.there.end(), channel) != row.there.end();
      EXPECT_EQ(field_of(on_channel(channel, row.kind), row.bench),
                there ? "nothing" : "input.shapes[0].channel")
          << row.bench << " " << v1::Channel_Name(channel);
    }
  }
  EXPECT_EQ(field_of(on_channel(v1::CHANNEL_D, v1::INPUT_KIND_DQ_VOLTAGES), "dc-a"), "input.kind");
}

// Catches: a setting that breaks a rule between values, noticed by the replay only.
TEST(ExperimentPlan, SettingsKeepTheRulesOfAConfiguration) {
  v1::RunExperiment r = good();
  v1::NamedValue& setting = *r.add_settings();
  setting.set_name("machine.mutual_inductance_h");
  setting.set_value(1.0);  // more than the self inductances allow
  EXPECT_EQ(field_of(r), "settings");
  setting.set_name("machine.rotor_resistance_ohm");
  setting.set_value(5.85);
  const ExperimentPlan plan = plan_of(r);
  EXPECT_EQ(find_parameter(plan.config.setup.axes[0].parameters, "machine.rotor_resistance_ohm")
                ->get(plan.config.setup.axes[0].parameters),
            5.85);
}

// Catches: dq voltages that turn by the mechanical angle, with the wrong sign, or half a count off.
TEST(ExperimentPlan, TurnsDqVoltagesByTheElectricalAngle) {
  v1::RunExperiment r = good();
  r.mutable_input()->Clear();
  r.mutable_input()->set_kind(v1::INPUT_KIND_DQ_VOLTAGES);
  r.mutable_input()->set_angle(v1::ANGLE_SOURCE_TRUE);
  r.mutable_input()->set_back_emf_vs(0.5);
  v1::Shape& shape = *r.mutable_input()->add_shapes();
  shape.set_channel(v1::CHANNEL_Q);
  shape.mutable_constant()->set_value(3.0);
  ExperimentPlan plan = plan_of(r, "pm-stepper-20khz");
  const double pole_pairs = plan.dq.pole_pairs;
  ASSERT_EQ(pole_pairs, 50.0);
  Sample sample;
  sample.angle_rad = 0.01;
  sample.speed_rad_s = 4.0;
  PhaseCommand command = command_of(plan, sample, 0);
  EXPECT_EQ(command.gates, Gates::kVoltage);
  EXPECT_NEAR(command.setpoint.a, -5.0 * std::sin(0.5), 1e-14);
  EXPECT_NEAR(command.setpoint.b, 5.0 * std::cos(0.5), 1e-14);

  r.mutable_input()->set_back_emf_vs(0.0);
  r.mutable_input()->set_angle(v1::ANGLE_SOURCE_MEASURED);
  plan = plan_of(r, "pm-stepper-20khz");
  sample.encoder_count = 2;  // of 2000, half a count is in it already: 0.1 pi of the electrical angle
  command = command_of(plan, sample, 0);
  EXPECT_NEAR(command.setpoint.a, -3.0 * std::sin(0.31415926535897931), 1e-14);
}

// Catches: a register that the I/O thread shifts through 2^20 bits for each shape (2 ms), and bits that each
// plan in the queue stores again (128 KiB).
TEST(ExperimentPlan, AllRequestsShareTheSequencesOfBits) {
  v1::RunExperiment r = good();
  r.mutable_input()->clear_shapes();
  for (int i = 0; i < kMaxShapes; ++i) {
    v1::Shape& shape = *r.mutable_input()->add_shapes();
    shape.set_channel(v1::CHANNEL_A);
    shape.mutable_prbs()->set_amplitude(0.5);
    shape.mutable_prbs()->set_order(kMaxPrbsOrder);
    shape.mutable_prbs()->set_seed((1u << kMaxPrbsOrder) + static_cast<std::uint32_t>(i));
  }
  const std::vector<ExperimentPlan> plans = {plan_of(r), plan_of(r)};
  const auto& first = std::get<PrbsShape>(plans[0].shapes[0].shape);
  EXPECT_EQ(first.first_bit, 1u);  // the seed, which goes once round
  for (const ExperimentPlan& plan : plans) {
    for (const InputShape& shape : plan.shapes)
      ASSERT_EQ(std::get<PrbsShape>(shape.shape).bits, first.bits);
  }
}

}  // namespace
}  // namespace drivebench::experiment_plan_test
