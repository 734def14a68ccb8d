#include <fmt/core.h>

#include <array>
#include <cmath>
#include <limits>

#include "clients/regression/checks/check_kinds.hpp"
#include "clients/regression/checks/golden.hpp"

namespace drivebench::regression {
namespace {

/// The signal stays within abs + rel·|golden| of a golden run or of that of a reference controller, tick by
/// tick. A tick that the golden run lacks is compared with the one before it, so that it may be decimated.
/// What is before its first and after its last tick is not compared, unless the check has a window of its
/// own.
class Tube final : public Check {
 public:
  Tube(const CheckSpec& spec, const RunFacts& facts)
      : Check(spec, facts),
        golden_(spec.reference_run       ? *spec.reference_run
                : spec.reference.empty() ? read_golden(spec.golden_file, spec.signal->name)
                                         : Golden{}),
        abs_(spec.number_or("abs", 0.0)),
        rel_(spec.number_or("rel", 0.0)) {}

 private:
  void take(const Sample& sample, double value) noexcept override {
    while (place_ + 1 < golden_.ticks.size() && golden_.ticks[place_ + 1] <= sample.tick)
      ++place_;
    if (golden_.ticks.empty() || golden_.ticks[place_] > sample.tick) return;
    if (place_ + 1 == golden_.ticks.size() && golden_.ticks[place_] < sample.tick) return;  // after its end
    const double wanted = golden_.values[place_];
    const double room = abs_ + rel_ * std::abs(wanted);
    const double deviation = value - wanted;
    ++compared_;
    if (std::abs(deviation) - room <= excess_) return;
    excess_ = std::abs(deviation) - room;
    deviation_ = deviation;
    room_ = room;
    worst_tick_ = sample.tick;
  }
  Outcome outcome() const override {
    const bool has_compared = compared_ != 0;
    if (has_compared && !covers_window()) {
      return {.passed = false,
              .measured = deviation_,
              .limit = room_,
              .worst_tick = worst_tick_,
              .unit = unit(),
              .sentence = fmt::format("the golden run goes from {:.6g} s to {:.6g} s only",
                                      seconds(golden_.ticks.front()), seconds(golden_.ticks.back()))};
    }
    return {.passed = has_compared && excess_ <= 0.0,
            .measured = deviation_,
            .limit = room_,
            .worst_tick = worst_tick_,
            .unit = unit(),
            .sentence = has_compared ? fmt::format("{} from the golden run, max {}",
                                                   with_unit(deviation_, unit()), with_unit(room_, unit()))
                                     : "never applied: the golden run has no tick of the window"};
  }

  bool covers_window() const noexcept {
    const std::vector<std::uint64_t>& ticks = golden_.ticks;
    const std::uint64_t step = ticks.size() > 1 ? ticks.back() - ticks[ticks.size() - 2] : 1;
    const bool begins_late = spec().from_s > 0.0 && first_tick() < ticks.front();
    const bool ends_early = spec().to_s && last_seen() >= ticks.back() + step;
    return !begins_late && !ends_early;
  }

  Golden golden_;
  double abs_;
  double rel_;
  std::size_t place_ = 0;
  std::uint64_t compared_ = 0;
  double excess_ = -std::numeric_limits<double>::infinity();
  double deviation_ = 0.0;
  double room_ = 0.0;
  std::uint64_t worst_tick_ = 0;
};

std::string problem_with_tube(const CheckSpec& spec) {
  if (!spec.number("abs") && !spec.number("rel")) return "needs abs, rel or both";
  if (!spec.reference.empty()) return {};
  const std::string problem = read_golden(spec.golden_file, spec.signal->name).problem;
  return problem.empty() ? std::string() : "golden " + problem;
}

constexpr auto kTube =
    std::to_array<NumberKey>({{"abs", false, 0.0, kAnyNumber}, {"rel", false, 0.0, kAnyNumber}});

}  // namespace

std::span<const CheckKind> tube_checks() noexcept {
  static constexpr auto kKinds = std::to_array<CheckKind>(
      {{"tube", Watches::kGolden, false, kTube, problem_with_tube, make_check<Tube>}});
  return kKinds;
}

}  // namespace drivebench::regression
