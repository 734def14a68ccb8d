#pragma once

#include <map>
#include <memory>
#include <string>

#include "server/experiments/plan.hpp"
#include "tests/server/config/config_test_bench.hpp"

/// Requests for experiments, and plans made of them.
namespace drivebench {

inline const BenchConfig& bench_of(const std::string& name) {
  static std::map<std::string, BenchConfig> loaded;
  if (!loaded.contains(name)) loaded[name] = load_config(test::kConfigs / "benches" / (name + ".toml"));
  return loaded.at(name);
}

inline std::shared_ptr<const SignalTable> no_tables(std::uint64_t) {
  return nullptr;
}

/// A request to the servo that is right.
inline v1::RunExperiment good() {
  v1::RunExperiment r;
  r.set_owner("a secret");
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

inline ExperimentPlan plan_of(const v1::RunExperiment& r, const std::string& name = "servo") {
  return make_plan(r, bench_of(name), no_tables);
}

}  // namespace drivebench
