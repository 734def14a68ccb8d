#include "clients/web/gateway/drive/reference_run.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "clients/reference/preset_fit.hpp"
#include "clients/web/gateway/drive/orders.hpp"

namespace drivebench::web::reference_run_test {
namespace {

constexpr char kServo[] = "book/8.2.2";

std::shared_ptr<v1::BenchDescription> servo_bench() {
  auto bench = std::make_shared<v1::BenchDescription>();
  bench->set_period_s(125e-6);
  v1::FaultDescription& fault = *bench->add_faults();
  fault.set_bit(2);
  fault.set_name("overcurrent");
  fault.set_latched(true);
  v1::AxisDescription& axis = *bench->add_axes();
  axis.set_machine_kind("induction");
  axis.set_drive_kind("voltage_amplifier");
  for (const auto& [name, value] : {std::pair{"encoder.counts_per_revolution", 2000.0},
                                    {"machine.pole_pairs", 3.0},
                                    {"amplifier.voltage_limit_v", 80.0}}) {
    v1::ParameterDescription& row = *axis.add_parameters();
    row.set_name(name);
    row.set_value(value);
  }
  return bench;
}

/// A sample of a machine that stands and has some current, so that the controller has something to answer.
v1::Sample sample_at(std::uint64_t tick) {
  v1::Sample sample;
  sample.set_tick(tick);
  sample.set_state(1);
  sample.set_i_a_a(0.25);
  sample.set_encoder_count(static_cast<std::int64_t>(tick) / 500);
  return sample;
}

std::string problem_of(const std::shared_ptr<v1::BenchDescription>& bench, const std::string& preset) {
  try {
    ReferenceRun(bench, 0, preset, 1);
  } catch (const OrderError& error) {
    return error.what();
  }
  return {};
}

// Catches: a preset on a machine that it was not made for, and a refusal in other words than those of
// `drivebench control`.
TEST(ReferenceRun, APresetThatDoesNotFitIsRefused) {
  const auto bench = servo_bench();
  EXPECT_EQ(problem_of(bench, kServo), "");
  EXPECT_EQ(problem_of(bench, "book/8.2.3"), "no preset 'book/8.2.3'; did you mean \"book/8.2.2\"?");
  EXPECT_EQ(problem_of(bench, "a\nb").substr(0, 15), "no preset 'a?b'");
  const control::Preset& other = *control::find_preset("book/9.1.4");
  const std::string misfit = problem_of(bench, "book/9.1.4");
  EXPECT_EQ(misfit, reference::misfit_text({.bench = *bench, .axis = 0}, other, {},
                                           other.make({}).timing().sample_rate_hz));
  EXPECT_EQ(misfit.find("preset book/9.1.4 does not fit this bench:\n  machine.kind is induction"), 0u)
      << misfit;
  EXPECT_NE(misfit.find("\n  book/8.2.2 would fit"), std::string::npos) << misfit;
  for (const control::Preset& each : control::presets()) {
    if (!each.needs.drives_second) continue;
    EXPECT_NE(problem_of(bench, std::string(each.name)).find("drives two motors"), std::string::npos);
  }
}

// Catches: an offer that the bench or the gateway refuses, or an axis without the lease of its own.
TEST(ReferenceRun, OffersThePresetsThatFit) {
  const auto bench = servo_bench();
  const std::vector<const control::Preset*> offered = offered_presets(*bench, 0);
  EXPECT_GT(offered.size(), 3u);
  for (const control::Preset* const each : offered)
    EXPECT_EQ(problem_of(bench, std::string(each->name)), "");
  bench->mutable_axes(0)->set_shares_amplifier_with("other");
  EXPECT_TRUE(offered_presets(*bench, 0).empty());
}

// Catches: a command that the controller did not give, one for another tick, a trajectory that lost samples
// put off the bench's time, a gate that stays on at the end.
TEST(ReferenceRun, AnswersAsTheControllerDoes) {
  ReferenceRun run(servo_bench(), 0, kServo, 7);
  EXPECT_EQ(run.command(3).gates(), v1::GATES_OFF);
  EXPECT_EQ(run.command(3).tick(), 3u);
  control::Run alone = control::find_preset(kServo)->make({});
  std::uint64_t last_tick = 0;
  for (std::uint64_t tick = 0; !run.is_over(); tick += tick % 32 == 30 ? 2 : 1) {
    const v1::Sample sample = sample_at(tick);
    run.take(sample);
    const control::Setpoint wanted = alone.step({.encoder_count = sample.encoder_count(), .i_a_a = 0.25},
                                                tick == 0 ? 1 : static_cast<std::int64_t>(tick - last_tick));
    last_tick = tick;
    const v1::Command command = run.command(tick);
    ASSERT_EQ(command.tick(), tick);
    if (alone.done()) break;
    ASSERT_EQ(command.gates(), v1::GATES_VOLTAGE);
    ASSERT_EQ(command.u_a_v(), wanted.a);
    ASSERT_EQ(command.u_b_v(), wanted.b);
    ASSERT_TRUE(run.rows().empty());
  }
  EXPECT_EQ(run.command(0).gates(), v1::GATES_OFF);
  run.take(sample_at(5000));
  EXPECT_EQ(run.command(5000).tick(), 5000u);  // the bench goes on
  EXPECT_EQ(run.phase(), "done");
  EXPECT_EQ(run.progress(), 1.0);
  const auto number = [rows = run.rows()](const std::string& name) {
    const auto row = std::ranges::find(rows, name, &reference::ReportRow::name);
    return row == rows.end() ? "missing" : row->value + " " + row->unit;
  };
  EXPECT_EQ(number("duration"), "127.88 ms of the bench's time");
  EXPECT_EQ(number("peak phase current"), "0.25 A");
  EXPECT_EQ(number("samples missed here"), "32 ");  // the last one at the end
  EXPECT_EQ(number("exchange p50"), "missing");
}

// Catches: a run that begins with the flux of the one before, or while the shaft turns or the axis is not
// armed, and one that waits for ever.
TEST(ReferenceRun, BeginsAtRest) {
  const auto bench = servo_bench();
  ReferenceRun run(bench, 0, kServo, 1);
  std::uint64_t tick = 1000;
  for (; run.phase() == "resting" && tick < 3000; ++tick) {
    EXPECT_EQ(run.command(0).gates(), v1::GATES_OFF);
    v1::Sample sample = sample_at(tick);
    sample.set_speed_rad_s(tick < 1700 ? 20.0 : 0.0);
    run.take(sample);
  }
  EXPECT_EQ(tick - 1, 1800u);  // 50 ms are 400 ticks, and the shaft stands at the end of the second time
  EXPECT_EQ(run.phase(), "preparing");

  ReferenceRun turning(bench, 0, kServo, 1);
  for (tick = 1; !turning.is_over() && tick < 50'000; ++tick) {
    v1::Sample sample = sample_at(tick);
    sample.set_speed_rad_s(-20.0);
    turning.take(sample);
  }
  EXPECT_EQ(turning.failure(), "the shaft turns at -20 rad/s; the run starts from rest");
  EXPECT_EQ(tick - 1, 40'001u);  // 5 s
}

// Catches: a run over a latched fault, currents that are no numbers, or a bench that was reset.
TEST(ReferenceRun, EndsWhereItCannotGoOn) {
  const auto bench = servo_bench();
  const auto failure_at = [&bench](std::uint64_t first, const auto& change) {
    ReferenceRun run(bench, 0, kServo, 1);
    for (std::uint64_t tick = 0; tick < 10; ++tick)
      run.take(sample_at(tick));
    EXPECT_EQ(run.phase(), "preparing");
    v1::Sample sample = sample_at(first);
    change(sample);
    run.take(sample);
    EXPECT_EQ(run.command(0).gates(), v1::GATES_OFF);
    EXPECT_EQ(run.phase(), "failed");
    return run.failure();
  };
  EXPECT_EQ(failure_at(10, [](v1::Sample& s) { s.set_faults(2); }), "the bench latched overcurrent");
  EXPECT_EQ(failure_at(10, [](v1::Sample& s) { s.set_i_b_a(std::nan("")); }),
            "the sample of tick 10 has no currents");
  EXPECT_EQ(failure_at(3, [](v1::Sample&) {}), "the bench has gone back in time");
  ReferenceRun latched(bench, 0, kServo, 1);
  v1::Sample sample = sample_at(0);
  sample.set_faults(2);
  latched.take(sample);
  EXPECT_EQ(latched.failure(), "the axis has latched overcurrent; Clear faults clears it");
}

// Catches: a page that has gone and a move that goes on to its end, a reference that jumps.
TEST(ReferenceRun, WindsDownToStandstill) {
  ReferenceRun run(servo_bench(), 0, kServo, 1);
  std::uint64_t tick = 0;
  for (; tick < 500; ++tick)  // in the middle of the move
    run.take(sample_at(tick));
  run.wind_down(0.01);
  for (; !run.is_over(); ++tick) {
    EXPECT_EQ(run.command(0).gates(), v1::GATES_VOLTAGE);
    run.take(sample_at(tick));
  }
  EXPECT_EQ(tick, 580u);  // 10 ms are 80 ticks
  EXPECT_EQ(run.command(0).gates(), v1::GATES_OFF);

  ReferenceRun resting(servo_bench(), 0, kServo, 1);
  resting.wind_down(0.01);
  EXPECT_TRUE(resting.is_over());
}

}  // namespace
}  // namespace drivebench::web::reference_run_test
