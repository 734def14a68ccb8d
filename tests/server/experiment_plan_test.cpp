// Requests for experiments: what is right, what is wrong and how that is told; one run in process.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <fstream>
#include <limits>

#include "protocols/mapped_file.hpp"
#include "server/experiments/plan.hpp"
#include "server/experiments/row_file.hpp"
#include "server/experiments/run.hpp"
#include "server/replay.hpp"
#include "tests/server/config_test_bench.hpp"

namespace drivebench {
namespace {

const BenchConfig& bench(const std::string& name) {
  static std::map<std::string, BenchConfig> loaded;
  if (!loaded.contains(name)) loaded[name] = load_config(test::kConfigs / "benches" / (name + ".toml"));
  return loaded.at(name);
}

std::shared_ptr<const SignalTable> no_tables(std::uint64_t) {
  return nullptr;
}

/// A request to the servo that is right.
v1::RunExperiment good() {
  v1::RunExperiment r;
  r.set_owner("somebody's secret");
  r.set_mode(v1::MODE_FREE);
  r.set_ticks(400);
  r.add_signals("i_a_a");
  r.add_signals("speed_rad_s");
  r.mutable_input()->set_kind(v1::INPUT_KIND_PHASE_VOLTAGES);
  v1::Shape& shape = *r.mutable_input()->add_shapes();
  shape.mutable_three_phase()->set_amplitude(80.0);
  shape.mutable_three_phase()->set_frequency_hz(60.0);
  return r;
}

ExperimentPlan plan_of(const v1::RunExperiment& r, const std::string& name = "servo") {
  return make_plan(r, bench(name), no_tables);
}

/// What the refusal of a request is about.
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

// Catches: a rule that is not checked, or told with another field.
TEST(ExperimentPlan, TellsWhatIsWrongWithARequest) {
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

// Catches: a voltage for a terminal that the machine has not, and one that it has and that is refused.
TEST(ExperimentPlan, AShapeDrivesTheTerminalsThatThereAre) {
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

// Catches: a setting that breaks a rule between values and is found out by a replay only.
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

// Catches: dq voltages that turn by the mechanical angle, with the wrong sign, or half a count aside.
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

// Catches: a register that is shifted through 2^20 bits for each shape while the I/O thread waits (2 ms), and
// bits that each plan in the queue has of its own (128 KiB).
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

struct Ran {
  RunOutcome outcome;
  std::vector<double> rows;
  ReplayReport replay;
};

Ran run(const ExperimentPlan& plan) {
  const test::Folder folder;
  RunProgress progress;
  const RunFiles files{.recording = folder.path() / "1.mcap", .rows = folder.path() / "1.rows"};
  Ran ran{.outcome = run_experiment(plan, files, "a request", progress, [] {}), .rows = {}, .replay = {}};
  ran.rows.resize(progress.rows.load() * plan.signals.size());
  EXPECT_EQ(std::filesystem::file_size(files.rows), ran.rows.size() * 8);
  FileReader(files.rows).read(0, std::as_writable_bytes(std::span(ran.rows)));
  ran.replay = replay(MappedFile(files.recording.string()).bytes(), nullptr);
  return ran;
}

// Catches: a run that is not that of a bench with the same commands, a row too many or too few, a recording
// that does not replay.
TEST(ExperimentRun, IsThatOfABenchWithTheSameCommandsAndReplays) {
  const ExperimentPlan plan = plan_of(good());
  const Ran ran = run(plan);
  Bench by_hand(plan.config.setup);
  by_hand.submit({.tick = 0, .axis = 0, .owner = 1, .action = LeaseAction::kAcquire});
  ASSERT_EQ(ran.rows.size(), 401u * 2);
  for (Tick tick = 0; tick <= 400; ++tick) {
    const Sample& sample = by_hand.sample(0);
    const auto row = static_cast<std::size_t>(tick);
    ASSERT_EQ(ran.rows[2 * row], sample.i_a_a) << tick;
    ASSERT_EQ(ran.rows[2 * row + 1], sample.speed_rad_s) << tick;
    if (tick == 400) break;
    const Command command{.answers = tick, .phases = command_of(plan, sample, tick)};
    by_hand.submit({.tick = tick, .axis = 0, .owner = 1, .action = command});
    by_hand.step();
  }
  by_hand.dismiss_controllers();
  EXPECT_EQ(ran.outcome.state, v1::EXPERIMENT_STATE_COMPLETED);
  EXPECT_EQ(ran.outcome.verdict.state_hash, by_hand.state_hash());
  EXPECT_EQ(ran.replay.result, ReplayReport::Result::kEqual) << ran.replay.problem;
  EXPECT_NE(ran.rows[2 * 400 + 1], 0.0);
}

// Catches: a limit that is looked at in the kept samples only, or after another tick has run.
TEST(ExperimentRun, EndsWithTheFirstSampleBeyondALimit) {
  v1::RunExperiment r = good();
  r.mutable_stop()->set_current_a(5.0);
  r.set_decimation(100);
  const Ran stopped = run(plan_of(r));
  EXPECT_EQ(stopped.outcome.state, v1::EXPERIMENT_STATE_STOPPED);
  EXPECT_NE(stopped.outcome.reason.find("current"), std::string::npos) << stopped.outcome.reason;
  r.clear_stop();
  r.set_decimation(1);
  r.set_signals(0, "true_i_a_a");
  r.set_signals(1, "true_i_b_a");
  const Ran whole = run(plan_of(r));
  Tick first = 0;
  while (std::abs(whole.rows[static_cast<std::size_t>(2 * first)]) <= 5.0 &&
         std::abs(whole.rows[static_cast<std::size_t>(2 * first + 1)]) <= 5.0)
    ++first;
  // One tick of safe action ends the run.
  EXPECT_EQ(stopped.outcome.verdict.ticks, static_cast<std::uint64_t>(first + 1));
  EXPECT_NE(stopped.outcome.reason.find("tick " + std::to_string(first) + ":"), std::string::npos);
  EXPECT_EQ(stopped.replay.result, ReplayReport::Result::kEqual) << stopped.replay.problem;
}

// Catches: an initial speed that depends on the inertia, an event a tick late, a setting that is not in
// force.
TEST(ExperimentRun, BeginsWithTheSpeedThatWasAskedForAndHasItsEvents) {
  v1::RunExperiment r = good();
  r.mutable_input()->Clear();
  r.mutable_input()->set_kind(v1::INPUT_KIND_NONE);
  r.mutable_initial()->set_speed_rad_s(50.0);
  r.set_signals(0, "load_nm");
  v1::NamedValue& friction = *r.add_settings();
  friction.set_name("mechanics.viscous_friction_nms");
  friction.set_value(0.0);
  v1::ExperimentEvent& load = *r.add_events();
  load.set_at_s(0.02);  // tick 160
  load.set_load_nm(0.1);
  const Ran ran = run(plan_of(r));
  EXPECT_NEAR(ran.rows[2 * 1 + 1], 50.0, 1e-9);  // one rounding of the impulse
  EXPECT_NEAR(ran.rows[2 * 160 + 1], 50.0, 1e-9);
  EXPECT_EQ(ran.rows[2 * 160], 0.0);
  EXPECT_EQ(ran.rows[2 * 161], 0.1);
  EXPECT_LT(ran.rows[2 * 161 + 1], 50.0);
  EXPECT_EQ(ran.replay.result, ReplayReport::Result::kEqual) << ran.replay.problem;
}

// Catches: commands that a latched bench refuses, so that its lease runs out and the counters grow.
TEST(ExperimentRun, GoesOnBehindATrip) {
  v1::RunExperiment r = good();
  r.set_ticks(20'000);  // 2.5 s: longer than the lease
  v1::NamedValue& limit = *r.add_settings();
  limit.set_name("amplifier.over_current_a");
  limit.set_value(4.0);
  v1::NamedValue& trip = *r.add_settings();
  trip.set_name("amplifier.over_current_trip");
  trip.set_value(1.0);
  r.set_signals(0, "refused_commands");
  r.set_signals(1, "faults");
  const Ran ran = run(plan_of(r));
  EXPECT_EQ(ran.outcome.state, v1::EXPERIMENT_STATE_COMPLETED);
  EXPECT_EQ(ran.rows[2 * 20'000], 0.0);
  EXPECT_EQ(static_cast<std::uint64_t>(ran.rows[2 * 20'000 + 1]) & kLeaseLost, 0u);
  EXPECT_NE(static_cast<std::uint64_t>(ran.rows[2 * 20'000 + 1]) & kLatchedFaults, 0u);
}

}  // namespace
}  // namespace drivebench
