// drivebench-identification: identifies random motors and prints tests/book/IDENTIFICATION.md.
#include <algorithm>
#include <cstdio>
#include <exception>
#include <thread>

#include "tests/clients/identification/monte_carlo/monte_carlo.hpp"

int main() {
  using namespace drivebench::identification;
  try {
    const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    const auto trials = run_trials(motor_draws(), {kAllMotors, kAllNoises, threads});
    const auto verdicts = run_verdicts(motor_draws(), kVerdictMotors, threads);
    std::fputs(markdown_of(trials, verdicts).c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
