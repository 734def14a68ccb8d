#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/book/book_bench.hpp"
#include "tests/book/results/results.hpp"

namespace drivebench {
namespace {

/// The bench im-b or im-b-transformer from the line, then under 5 N m.
struct LineRun {
  double peak_a = 0.0;
  double reached_95_s = 0.0;
  Sample loaded{};
};

LineRun line_run(const std::string& bench, bool locked) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + bench + ".toml");
  config.axes[0].events = {{.tick = 10'000, .action = LoadChange{.load_nm = 5.0, .ramp_ticks = 0}}};
  if (locked) config.setup.axes[0].parameters.mechanics.motion = ShaftMotion::kLocked;
  BookBench run(config);
  LineRun seen;
  run.run_until(4.0, [&](const Sample& s) {
    seen.peak_a =
        std::max({seen.peak_a, std::abs(s.true_i_a_a), std::abs(s.true_i_b_a), std::abs(s.true_i_c_a)});
    if (seen.reached_95_s == 0.0 && s.speed_rad_s >= 0.95 * 40.0 * std::numbers::pi)
      seen.reached_95_s = run.now_s();
  });
  seen.loaded = run.sample();
  return seen;
}

}  // namespace

ResultSection transformer_results() {
  const LineRun stiff = line_run("im-b", false);
  const LineRun behind = line_run("im-b-transformer", false);
  const LineRun locked = line_run("im-b-transformer", true);
  return {"A transformer between line and motor (7.4.3)",
          {{"GRID-01",
            "rotor locked: terminal voltage and current of a phase, rms",
            "a transfer function; derived 114.62 V, 8.027 A",
            {number("", locked.loaded.meter_u_rms_v, "V"), number("", locked.loaded.meter_i_rms_a, "A")},
            "agrees; the numbers of the transformers are ours"},
           {"GRID-01",
            "5 N m: terminal voltage, current, speed",
            "derived 118.20 V, 2.5307 A, 120.35 rad/s",
            {number("", behind.loaded.meter_u_rms_v, "V"), number("", behind.loaded.meter_i_rms_a, "A"),
             number("", behind.loaded.speed_rad_s, "rad/s")},
            "agrees"},
           {"GRID-01",
            "95 % of the synchronous speed on the line, behind the transformers",
            "nothing",
            {number("", stiff.reached_95_s, "s"), number("", behind.reached_95_s, "s"),
             number("peak", stiff.peak_a, "A"), number("peak", behind.peak_a, "A")},
            "the droop costs torque"}}};
}

}  // namespace drivebench
