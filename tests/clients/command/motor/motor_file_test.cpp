#include "clients/command/motor/motor_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "clients/command/common/basics/errors.hpp"
#include "protocols/document.hpp"

namespace drivebench::command::motor_file_test {
namespace {

/// A file that goes with the test.
class MotorFile : public ::testing::Test {
 protected:
  std::string written(const std::string& text) {
    file_ = std::filesystem::path(::testing::TempDir()) /
            (std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".toml");
    std::ofstream(file_) << text;
    return file_.string();
  }
  ~MotorFile() override {
    std::error_code ignored;
    std::filesystem::remove(file_, ignored);
  }

 private:
  std::filesystem::path file_;
};

// Catches: a value taken from the wrong key; a friction of the file that the circuit silently leaves out.
TEST_F(MotorFile, GivesTheValuesAndNamesTheOnesLeftOut) {
  const InductionMotorFile found = read_induction_motor(
      written("name = 'a'\n[machine]\nkind = 'induction'\nstar = true\npole_pairs = 3\n"
              "stator_resistance_ohm = 1.85\nrotor_resistance_ohm = 2.1\nstator_inductance_h = 0.25\n"
              "rotor_inductance_h = 0.24\nmutual_inductance_h = 0.225\n"
              "[mechanics]\ninertia_kgm2 = 0.02\nviscous_friction_nms = 1e-3\ncoulomb_friction_nm = 0.1\n"));
  EXPECT_EQ(found.name, "a");
  EXPECT_TRUE(found.star);
  EXPECT_EQ(found.motor.machine.pole_pairs, 3.0);
  EXPECT_EQ(found.motor.machine.mutual_inductance_h, 0.225);
  EXPECT_EQ(found.motor.machine.rotor_resistance_ohm, 2.1);
  EXPECT_EQ(found.motor.machine.rotor_inductance_h, 0.24);
  EXPECT_EQ(found.motor.machine.friction_nms, 1e-3);
  EXPECT_EQ(found.motor.stator_resistance_ohm, 1.85);
  EXPECT_EQ(found.motor.stator_inductance_h, 0.25);
  EXPECT_EQ(found.left_out, std::vector<std::string>{"coulomb_friction_nm"});
}

// Catches: a machine without this circuit that is computed anyway; a missing value taken as 1.
TEST_F(MotorFile, RefusesWhatHasNoCircuit) {
  EXPECT_THROW(read_induction_motor("no-such-motor"), UsageError);
  EXPECT_THROW(read_induction_motor(written("[machine]\nkind = 'pm_dc'\n")), UsageError);
  try {
    read_induction_motor(written("[machine]\npole_pairs = -3\nstator_resistance_ohm = 1\n"));
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.problems().size(), 5U);
    EXPECT_NE(std::string(error.what()).find("machine.pole_pairs must be a number above 0"),
              std::string::npos)
        << error.what();
  }
  EXPECT_THROW(read_induction_motor(written(
                   "[machine]\npole_pairs = 3\nstator_resistance_ohm = 1\nrotor_resistance_ohm = 1\n"
                   "stator_inductance_h = 0.1\nrotor_inductance_h = 0.1\nmutual_inductance_h = 0.1\n")),
               UsageError);
}

}  // namespace
}  // namespace drivebench::command::motor_file_test
