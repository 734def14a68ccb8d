// drivebench-identification: identifies random motors and prints tests/book/IDENTIFICATION.md, or with
// --blind SEED the score of motors and wirings that the identification does not know.
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string_view>
#include <system_error>
#include <thread>

#include "tests/clients/identification/monte_carlo/blind.hpp"
#include "tests/clients/identification/monte_carlo/monte_carlo.hpp"

int main(int argc, char** argv) {
  using namespace drivebench::identification;
  try {
    const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    if (argc == 1) {
      const auto trials = run_table({kAllMotors, kAllNoises, threads});
      const auto verdicts = run_verdicts(motor_draws(), kVerdictMotors, threads);
      std::fputs(markdown_of(trials, verdicts).c_str(), stdout);
      return 0;
    }
    std::uint64_t seed = 0;
    const std::string_view text = argc == 3 ? argv[2] : "";
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
    if (text.empty() || std::string_view(argv[1]) != "--blind" || error != std::errc() ||
        end != text.data() + text.size()) {
      std::fputs("drivebench-identification [--blind SEED]: SEED is a whole number\n", stderr);
      return 2;
    }
    std::fputs(blind_markdown(seed, run_blind(seed, kBlindMotors, threads)).c_str(), stdout);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
