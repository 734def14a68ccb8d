#include "clients/control/gains/gains.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "clients/control/loop/run.hpp"
#include "clients/control/presets/presets.hpp"

namespace drivebench::control::gains_test {
namespace {

std::string refusal(const Preset& preset, const Gain& gain) {
  try {
    preset.make(std::vector<Gain>{gain});
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

// Catches: an override that is dropped, or that lands in another number.
TEST(Gains, OverridesTakeTheirPlaceAndNoOther) {
  const RunTiming timing = {.sample_rate_hz = 8000.0, .prepare_s = 0.1, .hold_s = 0.2};
  const RunTiming changed = with_gains(timing, std::vector<Gain>{{"run.hold_s", 0.5}});
  EXPECT_EQ(changed.hold_s, 0.5);
  EXPECT_EQ(changed.prepare_s, 0.1);
  EXPECT_EQ(changed.sample_rate_hz, 8000.0);
}

// Catches: a row of a gain table that reaches another member than it names: every gain of every preset, made
// with its own value, must give the same run.
TEST(Gains, EveryGainOfEveryPresetTakesItsOwnValueAndRefusesNaN) {
  for (const Preset& preset : presets()) {
    const std::vector<Gain> gains = preset.gains();
    EXPECT_FALSE(gains.empty()) << preset.name;
    EXPECT_NO_THROW(preset.make(gains)) << preset.name;
    for (const Gain& gain : gains) {
      const Gain bad = {gain.name, std::numeric_limits<double>::quiet_NaN()};
      EXPECT_EQ(refusal(preset, bad), gain.name + " = nan must be finite") << preset.name;
    }
  }
}

// Catches: a refusal that does not say which gain, which value and which rule.
TEST(Gains, WrongNamesAndValuesAreRefusedInWords) {
  const Preset& book = *find_preset("book/8.2.2");
  EXPECT_EQ(refusal(book, {"current.proportional_v_per_a", -1.0}),
            "current.proportional_v_per_a = -1 must not be negative");
  EXPECT_EQ(refusal(book, {"curent.proportional_v_per_a", 7.0}),
            "no gain 'curent.proportional_v_per_a'; did you mean \"current.proportional_v_per_a\"?");
  EXPECT_TRUE(refusal(book, {"warp", 7.0}).starts_with("no gain 'warp'; known here: "))
      << refusal(book, {"warp", 7.0});
  EXPECT_EQ(refusal(book, {"current.proportional_v_per_a", 7.0}), "");
}

}  // namespace
}  // namespace drivebench::control::gains_test
