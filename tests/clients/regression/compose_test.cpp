#include "clients/regression/suite/compose.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "clients/regression/suite/place_in_case.hpp"
#include "clients/regression/tables/key_table.hpp"
#include "tests/clients/regression/suite_folder.hpp"

namespace drivebench::regression::compose_test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBench = R"(
[bench]
name = "x"
mode = "realtime"
period_us = 100
[tcp]
port = 7300
[[can]]
backend = "udp_multicast"
[[axis]]
name = "first"
motor = "motors/m.toml"
[axis.machine]
rotor_resistance_ohm = 1.0
[[axis.load]]
at_s = 0.5
load_nm = 1.0
[[axis]]
name = "second"
motor = "motors/m.toml"
shares_shaft_with = "first"
)";

class Compose : public Suite {
 protected:
  Compose() {
    bench_ = file("bench.toml", kBench);
    file("motors/m.toml",
         "name = \"M\"\nsource = \"s\"\n[machine]\nkind = \"induction\"\nrotor_resistance_ohm = 2.0\n"
         "pole_pairs = 3\n[mechanics]\ninertia_kgm2 = 0.1\n");
  }

  ConfigNode composed(const std::string& keys) {
    const Case c = the_case("bench = \"b\"\nduration_s = 1\n" + keys +
                            "\n[[check]]\nkind = \"never\"\ncondition = \"state == 4\"\n");
    ProblemList problems;
    text_ = composed_bench(c, bench_);
    return *parse_document(text_, "composed", problems);
  }
  std::string refusal(const std::string& keys) {
    try {
      composed(keys);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "none";
  }
  static const ConfigNode& at(const ConfigNode& node, const std::vector<std::string>& path) {
    const ConfigNode* place = &node;
    for (const std::string& key : path) {
      place = place->kind == ConfigNode::Kind::kArray ? &place->children.at(std::stoul(key))
                                                      : find_child(*place, key);
      if (place == nullptr) throw std::runtime_error("no " + key);
    }
    return *place;
  }

  fs::path bench_;
  std::string text_;
};

// Catches: a motor that overrides its bench, a file that the composed bench still needs, a bus that two cases
// would share.
TEST_F(Compose, TheComposedBenchNeedsNoOtherFile) {
  const ConfigNode bench = composed("");
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "machine", "rotor_resistance_ohm"})), 1.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "machine", "rotor_resistance_ohm"})), 2.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "machine", "pole_pairs"})), 3.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "mechanics", "inertia_kgm2"})), 0.1);
  EXPECT_EQ(find_child(at(bench, {"axis", "1"}), "mechanics"), nullptr);  // those of the first
  EXPECT_EQ(find_child(at(bench, {"axis", "0"}), "motor"), nullptr);
  EXPECT_EQ(find_child(bench, "can"), nullptr);
  EXPECT_EQ(find_child(bench, "tcp"), nullptr);
}

// Catches: a bench in real time that would lose its delay of a tick in lockstep.
TEST_F(Compose, LockstepKeepsTheDelayOfRealTime) {
  const ConfigNode bench = composed("seed = 7");
  EXPECT_EQ(std::get<std::string>(at(bench, {"bench", "mode"}).scalar), "lockstep");
  EXPECT_EQ(number_in(at(bench, {"bench", "command_delay_ticks"})), 1.0);
  EXPECT_EQ(number_in(at(bench, {"bench", "arming_commands"})), 10.0);
  EXPECT_EQ(number_in(at(bench, {"bench", "seed"})), 7.0);
}

// Catches: an override of the wrong axis, one that drops its neighbours, one of an axis that is not there.
TEST_F(Compose, OverridesMergeIntoTheAxisByNameOrNumber) {
  const ConfigNode bench = composed(
      "[override.bench]\nsubsteps = 4\n[override.axis.second.machine]\nrotor_resistance_ohm = 3.0\n"
      "[override.axis.0.encoder]\ncounts_per_revolution = 4000");
  EXPECT_EQ(number_in(at(bench, {"bench", "substeps"})), 4.0);
  EXPECT_EQ(number_in(at(bench, {"bench", "period_us"})), 100.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "machine", "rotor_resistance_ohm"})), 1.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "machine", "rotor_resistance_ohm"})), 3.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "encoder", "counts_per_revolution"})), 4000.0);
  EXPECT_NE(refusal("[override.axis.thrid.machine]\nx = 1").find("no axis of the bench"), std::string::npos);
}

// Catches: a step on the wrong axis, in the wrong table, or that replaces the bench's own events.
TEST_F(Compose, StepsAtATimeAreScheduledEvents) {
  const ConfigNode bench = composed(
      "[[step]]\nat_s = 0.1\nload_nm = 0.2\nramp_s = 0.05\n[[step]]\nat_s = 0.2\naxis = \"second\"\nfault = "
      "\"open_phase\"\nvalue = 2\n[[step]]\nat_s = 0.3\nimpulse_nms = 0.01\n[[step]]\nat_s = 0.4\nparameter "
      "= \"a.b\"\n"
      "value = \"word\"");
  const ConfigNode& loads = at(bench, {"axis", "0", "load"});
  ASSERT_EQ(loads.children.size(), 2U);
  EXPECT_EQ(number_in(at(loads, {"0", "load_nm"})), 1.0);
  EXPECT_EQ(number_in(at(loads, {"1", "load_nm"})), 0.2);
  EXPECT_EQ(number_in(at(loads, {"1", "ramp_s"})), 0.05);
  EXPECT_EQ(std::get<std::string>(at(bench, {"axis", "1", "fault", "0", "name"}).scalar), "open_phase");
  EXPECT_TRUE(std::holds_alternative<std::int64_t>(at(bench, {"axis", "1", "fault", "0", "value"}).scalar));
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "bump", "0", "impulse_nms"})), 0.01);
  EXPECT_EQ(std::get<std::string>(at(bench, {"axis", "0", "set", "0", "value"}).scalar), "word");
  EXPECT_NE(refusal("[[step]]\nat_s = 0\naxis = \"9\"\nload_nm = 1").find("step.axis is \"9\""),
            std::string::npos);
}

// Catches: a refusal that names a line of a file that its reader never sees, or the line of another step.
TEST_F(Compose, ALineOfTheComposedBenchIsOneOfTheCase) {
  const std::string keys =
      "[override.bench]\nsubsteps = 4\n[override.axis.second.machine]\nrotor_resistance_ohm = 3.0\n"
      "[[step]]\nat_s = 0.1\nload_nm = 0.2\n[[step]]\nat_s = 0.2\naxis = \"second\"\nfault = \"open_phase\"\n"
      "value = 2\n[[step]]\nat_s = 0.3\nload_nm = 0.3\n"
      "[[step]]\nat_s = 0.4\naxis = \"second\"\nload_nm = 0.4\n";
  composed(keys);
  const Case c = the_case("bench = \"b\"\nduration_s = 1\n" + keys +
                          "[[check]]\nkind = \"never\"\ncondition = \"state == 4\"\n");
  const auto line_of = [&](std::string_view part) {
    const auto line =
        1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(text_.find(part)), '\n');
    return line_in_case(c, text_, static_cast<int>(line));
  };
  EXPECT_EQ(line_of("substeps = 4"), 4);
  EXPECT_EQ(line_of("rotor_resistance_ohm = 3.0"), 6);
  EXPECT_EQ(line_of("load_nm = 0.2"), 7);
  EXPECT_EQ(line_of("open_phase"), 10);
  EXPECT_EQ(line_of("load_nm = 0.3"), 15);
  EXPECT_EQ(line_of("load_nm = 0.4"), 18);
  EXPECT_EQ(line_of("load_nm = 1.0"), 0);  // of the bench file, as what follows
  EXPECT_EQ(line_of("period_us"), 0);
  EXPECT_EQ(line_of("rotor_resistance_ohm = 1.0"), 0);
}

// Catches: a port that the system chooses, at which a drive that runs already would never look.
TEST_F(Compose, OnlyAProgramIsToldThePortOfModbus) {
  const ConfigNode attached =
      composed("mode = \"realtime\"\n[dut]\nattached = \"modbus\"\n[dut.modbus]\naddress = \"127.0.0.1\"");
  EXPECT_EQ(std::ranges::count(at(attached, {"modbus"}).children, std::string("port"), &ConfigNode::key), 0);
  const ConfigNode started = composed("[dut]\ncommand = [\"program\"]\nlink = \"modbus\"");
  EXPECT_EQ(std::get<std::int64_t>(at(started, {"modbus", "port"}).scalar), 0);
}

// Catches: tokens that are looked for beside the composed bench, which stands elsewhere.
TEST_F(Compose, TheTokensOfAnAttachedDriveStandBesideItsCase) {
  const ConfigNode bench = composed(
      "mode = \"realtime\"\n[dut]\nattached = \"tcp\"\n[dut.tcp]\nport = 7300\ntokens_file = \"users.toml\"");
  EXPECT_EQ(std::get<std::string>(at(bench, {"tcp", "tokens_file"}).scalar),
            (folder_ / "users.toml").string());
}

// Catches: a multisine that does not reach the bench, a check that measures another step or the first period.
TEST_F(Compose, AMultisineIsAnEventThatChecksKnow) {
  const std::string sum = "periods = 5, period_s = 0.2, from_hz = 5.0, to_hz = 400.0}\n";
  const std::string step = "[[step]]\nat_s = 0.1\naxis = \"second\"\nmultisine = {load_nm = 0.01, " + sum;
  const std::string check =
      "[[check]]\nkind = \"frequency_response\"\nname = \"loop\"\nmin_gain_margin_db = 6\n";
  const ConfigNode bench = composed(step + check);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "multisine", "0", "to_hz"})), 400.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "multisine", "0", "at_s"})), 0.1);
  const auto read = [this](const std::string& keys) {
    return the_case("bench = \"b\"\nduration_s = 2\n" + keys);
  };
  const Case c = read(step + check);
  const CheckSpec& spec = c.checks.back();
  EXPECT_EQ(spec.axis, "second");
  EXPECT_EQ(spec.from_s, 0.1 + 0.2);
  EXPECT_EQ(spec.to_s, 0.1 + 5 * 0.2);
  ASSERT_TRUE(spec.excitation);
  EXPECT_TRUE(spec.excitation->is_load);
  EXPECT_NE(refusal(check).find("\"loop\" (line "), std::string::npos);
  EXPECT_NE(refusal(check).find("needs a step with a multisine"), std::string::npos);
  EXPECT_NE(refusal(step + step + check).find("needs the number of its step"), std::string::npos);
  EXPECT_EQ(read(step + step + check + "step = 1\n").checks.back().axis, "second");
  EXPECT_NE(refusal(step + check + "step = 4\n").find("has step 4, which is no step"), std::string::npos);
  const std::string offset = "[[step]]\nat_s = 0.1\nmultisine = {current_offset_a = 0.01, " + sum;
  EXPECT_NE(refusal(offset + "[[step]]\nat_s = 0.2\nfault = \"current_sensor_offset\"\nvalue = 1.0\n" + check)
                .find("has a second step that changes the offset"),
            std::string::npos);
}

// Catches: a condition that is lost, or that acts on another axis than it should.
TEST_F(Compose, StepsOnAConditionWaitInTheBench) {
  const ConfigNode bench = composed(
      "[[step]]\nwhen = \"speed_rad_s > 100\"\naxis = \"1\"\nfor_s = 0.005\ndelay_s = 0.01\nfault = "
      "\"open_phase\"\n"
      "value = 2");
  const ConfigNode& event = at(bench, {"axis", "1", "fault", "0"});
  EXPECT_EQ(std::get<std::string>(at(event, {"when"}).scalar), "speed_rad_s > 100");
  EXPECT_EQ(std::get<std::string>(at(event, {"name"}).scalar), "open_phase");
  EXPECT_EQ(number_in(at(event, {"for_s"})), 0.005);
  EXPECT_EQ(number_in(at(event, {"delay_s"})), 0.01);
}

}  // namespace
}  // namespace drivebench::regression::compose_test
