// Machines with a phase c or a field winding over Modbus, and the parameters of their kinds.
#include <algorithm>
#include <cmath>
#include <set>

#include "plant/injected_faults.hpp"
#include "plant/parameters/parameters.hpp"
#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::terminals_test {
namespace {

float real_at(const Words& words, std::size_t at) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(words[at] << 16 | words[at + 1]));
}

/// The servo motor, wound in an isolated star and with Hall lines.
BenchConfig star_config(DriveKind drive = DriveKind::kVoltage) {
  BenchConfig config = modbus_bench_config();
  AxisParameters& p = config.setup.axes[0].parameters;
  induction(p).star = true;
  p.sensors.hall.enabled = true;
  p.drive.kind = drive;
  p.drive.current_loop = {.proportional_v_per_a = 20.0, .limit_a = 100.0};
  config.setup.substeps = 10;
  return config;
}

/// Beside the servo a DC motor whose field has terminals of its own.
BenchConfig servo_and_dc_config() {
  BenchConfig config = modbus_bench_config(2);
  config.setup.axes[1].parameters.machine = SeparateDcMachineParameters{.armature_resistance_ohm = 1.0,
                                                                        .armature_inductance_h = 0.01,
                                                                        .motor_constant = 0.5,
                                                                        .field_resistance_ohm = 10.0,
                                                                        .field_inductance_h = 0.1};
  return config;
}

// Catches: a phase c that does not reach the machine, a sensor of it that one transaction does not bring
// back.
TEST(ModbusTerminals, OneTransactionCommandsThreePhasesAndReadsEverySensor) {
  ModbusBench bench(star_config());
  Client client(bench.port());
  ASSERT_EQ(client.write(420, {7}), 0);
  ASSERT_NE(bench.owner(), 0u);
  for (std::uint32_t tick = 0; tick < 50; ++tick) {
    const Words words = Client::words_in(
        client.ask(read_write_pdu(200, 124, 422, command_words(1, tick, {20.0f, -12.5f, -7.5f, 0.0f}))));
    ASSERT_EQ(words.size(), 124u);
    const Sample s = bench.newest();
    ASSERT_EQ(s.tick, tick + 1u);
    ASSERT_EQ(s.u_c_v, -7.5);
    EXPECT_EQ(words[3], tick + 1u);
    EXPECT_EQ(real_at(words, 286 - 200), static_cast<float>(s.i_c_a));
    EXPECT_EQ(real_at(words, 290 - 200), -7.5f);
    EXPECT_EQ(words[299 - 200], s.hall_lines);
    EXPECT_EQ(real_at(words, 322 - 200), static_cast<float>(s.true_i_c_a));
  }
  EXPECT_EQ(client.read(405, 4), client.read(425, 4)) << "the same registers";
  EXPECT_EQ(client.read(429, 2), (Words{0xc0f0, 0}));
  EXPECT_TRUE(client.exchange(1, 50, 1.0f, 2.0f).size() > 0) << "a write of phases a and b leaves c as it is";
  EXPECT_EQ(bench.newest().u_c_v, -7.5);
}

// Catches: a leg of a star whose duty is taken across the whole link, a duty of phase c or the field
// beyond 1.
TEST(ModbusTerminals, ADutyIsOfTheHalfLinkInAStar) {
  ModbusBench bench(star_config());
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const double bus_v = bench.newest().bus_voltage_v;
  EXPECT_EQ(client.write(422, command_words(3, 0, {0.5f, -0.25f, 0.125f, 0.0f})), 0);
  EXPECT_EQ(bench.newest().u_a_v, 0.25 * bus_v);
  EXPECT_EQ(bench.newest().u_c_v, 0.0625 * bus_v);
  EXPECT_EQ(client.write(422, command_words(3, 1, {0.5f, 0.0f, 1.25f, 0.0f})), 3);
  EXPECT_EQ(client.write(422, command_words(3, 1, {0.5f, 0.0f, 0.0f, -1.25f})), 3);
  EXPECT_EQ(client.read_one(410), 8);
}

// Catches: duties of legs that count from the middle of the link, legs that are off in the wrong order or for
// one command only, a mask of legs that do not exist, voltages of the terminals at another address.
TEST(ModbusTerminals, LegsHaveDutiesAndCanBeOff) {
  BenchConfig config = star_config(DriveKind::kAveraged);
  config.setup.axes[0].parameters.sensors.terminals = true;
  ModbusBench bench(config);
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const double bus_v = bench.newest().bus_voltage_v;
  Words legs = command_words(5, 0, {1.0f, 0.25f, 0.0f, 0.0f});
  EXPECT_EQ(client.write(422, legs), 0);
  const Words terminals = client.read(340, 16);
  EXPECT_EQ(terminals[3], bench.newest().tick);
  EXPECT_EQ(real_at(terminals, 4), static_cast<float>(bus_v));
  EXPECT_EQ(real_at(terminals, 10), static_cast<float>(bus_v));
  EXPECT_EQ(real_at(terminals, 12), static_cast<float>(0.25 * bus_v));
  legs = command_words(5, 1, {0.5f, 0.5f, 0.5f, 0.0f});
  legs.push_back(5);
  EXPECT_EQ(client.write(422, legs), 0);
  EXPECT_EQ(client.read_one(433), 5);
  for (std::uint32_t tick = 2; tick < 100; ++tick)
    ASSERT_EQ(client.write(422, command_words(5, tick, {0.5f, 0.5f, 0.5f, 0.0f})), 0);
  EXPECT_EQ(bench.newest().true_i_a_a, 0.0) << "a and c are off: no current is left";
  EXPECT_EQ(bench.newest().true_i_b_a, 0.0);
  EXPECT_EQ(client.write(433, {8}), 3);
  EXPECT_EQ(client.write(400, {0}), 0);
  EXPECT_EQ(client.read_one(433), 0) << "the next controller finds all legs on";
}

// CMD-11. Catches: currents taken for voltages or duties, by command and by process data; a current that is
// no number and not refused; a refusal without its reason.
TEST(ModbusTerminals, CurrentsAreForCurrentAmplifiers) {
  ModbusBench bench(star_config(DriveKind::kCurrent));
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  for (std::uint32_t tick = 0; tick < 200; ++tick)
    ASSERT_EQ(client.write(422, command_words(4, tick, {1.0f, 0.5f, -1.5f, 0.0f})), 0);
  EXPECT_NEAR(bench.newest().true_i_a_a, 1.0, 0.1) << "of a proportional loop";
  EXPECT_NEAR(bench.newest().true_i_c_a, -1.5, 0.15);
  const auto count = [](double value) { return static_cast<std::uint16_t>(std::lround(100.0 * value)); };
  for (const std::uint16_t control : Words{0x06, 0x0f})
    ASSERT_EQ(client.write(121, {control, 1, count(-1.0), count(-0.5), count(1.5), 0}), 0);
  for (int tick = 0; tick < 200; ++tick)
    ASSERT_EQ(client.write(125, {count(1.5)}), 0);
  EXPECT_NEAR(bench.newest().true_i_a_a, -1.0, 0.1);
  EXPECT_NEAR(bench.newest().true_i_c_a, 1.5, 0.15);
  EXPECT_EQ(static_cast<std::int16_t>(client.read_one(131)), std::lround(100.0 * bench.newest().i_c_a));
  EXPECT_EQ(client.read(101, 3), (Words{0x0f, count(-1.0), count(-0.5)})) << "the same registers";
  EXPECT_EQ(client.write(122, {2}), 3) << "references that do not exist";
  const auto tick = static_cast<std::uint32_t>(bench.newest().tick);
  for (std::size_t terminal = 0; terminal < 4; ++terminal) {
    for (const float bad : {std::nanf(""), HUGE_VALF, -HUGE_VALF, 1e38f}) {
      std::array<float, 4> currents{1.0f, 0.5f, -1.5f, 0.0f};
      currents[terminal] = bad;
      EXPECT_EQ(client.write(422, command_words(4, tick, currents)), 3);
    }
  }
  EXPECT_EQ(bench.newest().tick, tick);

  ModbusBench voltages(star_config());
  Client other(voltages.port());
  ASSERT_EQ(other.write(400, {7}), 0);
  EXPECT_EQ(other.write(422, command_words(4, 0, {1.0f, 0.5f, -1.5f, 0.0f})), 4);
  EXPECT_EQ(other.read_one(410), 10);
  ASSERT_EQ(other.write(121, {0x06, 1, 0, 0, 0, 0}), 0) << "the gates are off";
  EXPECT_EQ(other.write(121, {0x0f, 1, 0, 0, 0, 0}), 4);
  EXPECT_EQ(other.read_one(410), 10);
  ASSERT_EQ(other.write(121, {0x06, 1, 0, 0, 0, 0}), 0);
  EXPECT_EQ(voltages.newest().refused_commands, 2u);
}

// Catches: a field that gets another's voltage; two kinds of machines that are shown with one table.
TEST(ModbusTerminals, EachUnitHasTheParametersOfItsMachine) {
  ModbusBench bench(servo_and_dc_config());
  Client client(bench.port());
  EXPECT_EQ(client.read(40, 3, 1), (Words{0, 0, 3}));
  EXPECT_EQ(client.read(40, 3, 2), (Words{6, 3, 9}));
  const Words servo = client.read(1000, 2, 1);
  EXPECT_EQ(real_at(servo, 0), 3.0f) << "pole pairs";

  const AxisParameters p = servo_and_dc_config().setup.axes[1].parameters;
  const std::vector<std::uint32_t> rows = parameter_rows(p);
  EXPECT_EQ(client.read_one(17, 2), 2 * rows.size());
  const Words all = client.read_all(1000, 2 * rows.size(), 2);
  for (std::size_t place = 0; place < rows.size(); ++place) {
    const Parameter& parameter = axis_parameters(p)[rows[place]];
    EXPECT_EQ(real_at(all, 2 * place), static_cast<float>(parameter.get(p))) << parameter.name;
  }
  const auto resistance = std::find_if(rows.begin(), rows.end(), [&](std::uint32_t row) {
    return axis_parameters(p)[row].name == "machine.armature_resistance_ohm";
  });
  ASSERT_NE(resistance, rows.end());
  const auto address = static_cast<std::size_t>(1000 + 2 * (resistance - rows.begin()));
  const Words before = client.read_all(1000, 100, 1);
  ASSERT_EQ(client.write(400, {7}, 2), 0);
  EXPECT_EQ(client.write(address, {0x4000, 0}, 2), 0) << "2 ohm";
  EXPECT_EQ(client.read(address, 2, 2), (Words{0x4000, 0}));
  EXPECT_EQ(client.read_all(1000, 100, 1), before);
  ASSERT_EQ(client.write(400, {7}, 1), 0);
  EXPECT_EQ(client.write(422, command_words(1, 0, {0.0f, 0.0f, 0.0f, 0.0f}), 1), 0);
  EXPECT_EQ(client.write(422, command_words(1, 0, {24.0f, 0.0f, 0.0f, 12.0f}), 2), 0);
  EXPECT_EQ(bench.newest(1).u_a_v, 24.0);
  EXPECT_EQ(bench.newest(1).u_f_v, 12.0);
}

// Catches: a parameter of the induction machine that has moved; a parameter that has no register, or two.
TEST(ModbusTerminals, TheParametersOfTheFirstMapStayWhereTheyWere) {
  constexpr auto kFirst = std::to_array<std::string_view>({
      "machine.pole_pairs",           "machine.stator_resistance_ohm",  "machine.rotor_resistance_ohm",
      "machine.stator_inductance_h",  "machine.rotor_inductance_h",     "machine.mutual_inductance_h",
      "mechanics.inertia_kgm2",       "mechanics.viscous_friction_nms", "mechanics.coulomb_friction_nm",
      "mechanics.static_friction_nm", "amplifier.voltage_limit_v",      "amplifier.gain",
      "amplifier.offset_a_v",         "amplifier.offset_b_v",           "amplifier.over_current_a",
      "amplifier.over_current_trip",  "encoder.counts_per_revolution",  "encoder.half_count_offset",
      "current_sensor.bits",          "current_sensor.full_scale_a",    "current_sensor.gain_a",
      "current_sensor.gain_b",        "current_sensor.offset_a_a",      "current_sensor.offset_b_a",
      "current_sensor.noise_rms_a",
  });
  for (std::size_t i = 0; i < kFirst.size(); ++i)
    EXPECT_EQ(address_of(kFirst[i]), 1000 + 2 * i) << kFirst[i];
  for (std::size_t kind = 0; kind < machine_kinds().size(); ++kind) {
    AxisParameters p;
    p.machine = make_machine(kind);
    const std::vector<std::uint32_t> rows = parameter_rows(p);
    EXPECT_EQ(std::set<std::uint32_t>(rows.begin(), rows.end()).size(), rows.size()) << machine_kinds()[kind];
    EXPECT_EQ(rows.size(), axis_parameters(p).size()) << machine_kinds()[kind];
    EXPECT_LT(1000 + 2 * rows.size(), kMirrorOffset);
  }
}

// Catches: a header that shows old clients blocks that they do not know, or hides them from new clients.
TEST(ModbusTerminals, TheHeaderTellsOfTheOtherBlocks) {
  ModbusBench bench;
  Client client(bench.port());
  const Words header = client.read(0, 59);
  EXPECT_EQ(Words(header.begin() + 5, header.begin() + 17),
            (Words{4, 1, 100, 13, 2, 200, 86, 3, 400, 11, 4, 1000}));
  EXPECT_EQ(Words(header.begin() + 30, header.begin() + 40), (Words{3, 5, 120, 22, 6, 286, 50, 7, 420, 13}));
  EXPECT_EQ(Words(header.begin() + 43, header.begin() + 59),
            (Words{5, 8, 433, 1, 9, 340, 16, 10, 360, 32, 11, 440, 44, 12, 490, 18}));
  for (const std::size_t at : {31u, 34u, 37u, 44u, 47u, 50u, 53u, 56u})
    EXPECT_FALSE(client.read(header[at + 1], header[at + 2]).empty()) << at;
}

// Catches: Hall lines or an injected fault that a PLC cannot see, or sees as another's.
TEST(ModbusTerminals, HallLinesAndInjectedFaultsAreDiscreteInputs) {
  ModbusBench bench(star_config());
  Client client(bench.port());
  const auto inputs = [&] {
    const Bytes bytes = client.ask(pdu_of(2, {28, 35}));
    std::uint64_t bits = 0;
    for (std::size_t i = 2; i < bytes.size(); ++i)
      bits |= std::uint64_t{bytes[i]} << 8 * (i - 2);
    return bits;
  };
  EXPECT_EQ(inputs(), bench.newest().hall_lines);
  const std::size_t row = find_injectable_fault("command_corruption");
  const InjectFault fault{static_cast<std::uint32_t>(row), 0.25};
  ASSERT_EQ(bench.request({.tick = 0, .axis = 0, .owner = 0, .action = fault}), Refused::kNot);
  ASSERT_EQ(client.write(400, {7}), 0);
  ASSERT_EQ(client.write(402, command_words(0, 0, 0.0f, 0.0f)), 0);
  const Sample s = bench.newest();
  ASSERT_EQ(s.injected, std::uint64_t{1} << row);
  EXPECT_EQ(inputs(), s.hall_lines | s.injected << 3);
  EXPECT_EQ(client.read(138, 2), (Words{static_cast<std::uint16_t>(s.injected >> 16), 0}));
}

}  // namespace
}  // namespace drivebench::modbus::terminals_test
