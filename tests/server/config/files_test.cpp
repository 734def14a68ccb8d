#include "server/config/config.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>

#include "tests/repetitions.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::files_test {
namespace {

// Catches: an override that is lost or that hides the motor's other values.
TEST(ConfigFiles, BenchFileOverridesTheMotorFile) {
  const std::string servo = fs::canonical(kConfigs / "motors/servo-im.toml").string();
  std::string text = with("name = \"x\"", "name = \"x\"\nmotor = \"" + servo + "\"");
  const std::size_t machine = text.find("pole_pairs");
  text.replace(machine, text.find("[axis.mechanics]") - machine, "rotor_resistance_ohm = 5.85\n");
  const AxisParameters p = parse(text).setup.axes[0].parameters;
  const auto& motor = std::get<InductionMachineParameters>(p.machine);
  EXPECT_EQ(motor.rotor_resistance_ohm, 5.85);
  EXPECT_EQ(motor.stator_resistance_ohm, 1.7);
  EXPECT_EQ(motor.pole_pairs, 3);
  EXPECT_EQ(p.mechanics.viscous_friction_nms, 1.4e-4);
}

// Catches: problems of the motor file reported with lines of the bench file, twice, or not at all.
TEST(ConfigFiles, ProblemsOfTheMotorFileAreReportedOnceWithItsName) {
  const Folder folder;
  folder.write("m.toml", "name = \"m\"\n[machine]\npole_pairs = 3\nstator_resistance_ohm = 0\n[shaft]\n");
  EXPECT_EQ(
      problems_of(with("[axis.machine]", "motor = \"n.toml\"\n[axis.other]"), folder.path()).find("machine."),
      std::string::npos);
  const std::string axis = kBench.substr(kBench.find("[axis.amplifier]"));
  const std::string text = kBench.substr(0, kBench.find("[axis.machine]")) + "motor = \"m.toml\"\n" + axis +
                           "[[axis]]\nname = \"y\"\nmotor = \"./m.toml\"\n" + axis;
  const std::string m = (folder.path() / "m.toml").string();
  EXPECT_EQ(problems_of(text, folder.path()),
            m + ":1: mechanics.inertia_kgm2 is missing\n" +            //
                m + ":1: source is missing\n" +                        //
                m + ":2: machine.mutual_inductance_h is missing\n" +   //
                m + ":2: machine.rotor_inductance_h is missing\n" +    //
                m + ":2: machine.rotor_resistance_ohm is missing\n" +  //
                m + ":2: machine.stator_inductance_h is missing\n" +   //
                m + ":4: machine.stator_resistance_ohm is 0 but must lie between 1e-06 and 1e+06 ohm\n" + m +
                ":5: shaft is not a known key; known here: name, source, machine, mechanics, thermal");
}

// Catches: an open address without tokens, and a tokens file whose problems are not reported with the others.
TEST(ConfigFiles, CFG_07_SEC_04_TokensComeFromAFileThatOnlyItsOwnerReads) {
  const Folder folder;
  const std::string text = kBench + "[tcp]\naddress = \"0.0.0.0\"\ntokens_file = \"tokens.toml\"\n";
  EXPECT_NE(problems_of(text, folder.path()).find(":23: tcp.tokens_file names"), std::string::npos);
  const fs::path file =
      folder.write("tokens.toml", "[[token]]\nname = 'anna'\nrole = 'operator'\ntoken = 'open sesame'\n");
  ASSERT_EQ(::chmod(file.c_str(), 0640), 0);
  EXPECT_NE(problems_of(text, folder.path()).find("read by others"), std::string::npos);
  ASSERT_EQ(::chmod(file.c_str(), 0600), 0);
  const BenchConfig config = parse_config(text, "b.toml", folder.path());
  EXPECT_TRUE(config.tcp.asks_for_token);
  ASSERT_EQ(config.tcp.grants.size(), 1u);
  EXPECT_EQ(config.tcp.grants[0].hash, hash_of_token("open sesame"));
  EXPECT_EQ(config.tcp.address, "0.0.0.0");
  folder.write("tokens.toml", "[[token]]\nname = 'anna'\nrole = 'king'\n");
  const std::string found = problems_of(text, folder.path());
  EXPECT_NE(found.find("token.role is \"king\""), std::string::npos) << found;
  EXPECT_NE(found.find("in line 1 token.token or sha256"), std::string::npos) << found;
}

// Catches: an audit log in the wrong folder, and mixed-up words.
TEST(ConfigFiles, AuditAndLogAreRead) {
  const Folder folder;
  const auto with_audit = [&](const std::string& more) { return problems_of(kBench + more, folder.path()); };
  const BenchConfig config =
      parse_config(kBench + "[audit]\nfile = 'logs/a.jsonl'\non_failure = 'safe'\n[log]\nlevel = 'warn'\n",
                   "b.toml", folder.path());
  EXPECT_EQ(config.audit.file, folder.path() / "logs/a.jsonl");
  EXPECT_EQ(config.audit.on_failure, AuditFailure::kSafe);
  EXPECT_EQ(config.log_level, LogLevel::kWarn);
  EXPECT_NE(with_audit("[audit]\non_failure = 'safe'\n").find("audit.file is missing"), std::string::npos);
  EXPECT_NE(with_audit("[audit]\nfile = 'a'\non_failure = 'stop'\n").find("continue"), std::string::npos);
  EXPECT_NE(with_audit("[log]\nlevel = 'loud'\n").find("debug"), std::string::npos);
  EXPECT_TRUE(parse_config(kBench, "b.toml", folder.path()).audit.file.empty());
}

// Catches: a reader that crashes, hangs or fills the terminal on a file that is no configuration.
TEST(ConfigFiles, CFG_06_HostileFilesAreRefusedInFewWords) {
  const Folder folder;
  const auto refused = [&](const std::string& text) {
    const std::string found = problems_of(text, folder.path());
    EXPECT_NE(found, "none");
    EXPECT_LT(found.size(), 60'000u);
    return found;
  };
  const auto repeated = [](const std::string& piece, int times) {
    std::string text;
    for (int i = 0; i < times; ++i)
      text += piece;
    return text;
  };
  std::string keys;
  for (int i = 0; i < 20'000; ++i)
    keys += "k" + std::to_string(i) + "=1\n";
  EXPECT_NE(refused(keys).find("more problems"), std::string::npos);
  EXPECT_NE(refused(repeated(keys, 50)).find("is larger than"), std::string::npos) << "a million keys";
  EXPECT_NE(refused(repeated("x", 2'000'000)).find("is larger than"), std::string::npos);
  EXPECT_NE(refused("a = \"" + repeated("x", 200'000) + '"').find("line is longer"), std::string::npos);
  EXPECT_NE(refused(repeated("a.", 100'000) + "a = 1").find("line is longer"), std::string::npos);
  EXPECT_NE(refused("a = " + repeated("[\n", 10'000)).find("nested"), std::string::npos);
  EXPECT_NE(refused("a = " + repeated("{a=[\n", 10'000)).find("nested"), std::string::npos);
  refused(repeated("[" + repeated("a.", 490) + "a]\n", 200));
  EXPECT_NE(refused(repeated("[[axis]]\n", 10'000)).find("at most 64 times"), std::string::npos);
  EXPECT_NE(refused("a = \"\xff\"").find("utf-8"), std::string::npos);
  EXPECT_EQ(refused("\"\\u001b[31m\" = 1\n").find('\x1b'), std::string::npos);
  EXPECT_EQ(refused("a = 1\n[b]\n[[[c]]]\nd = 1\n"),
            "b.toml:3: is not TOML: no key or value can begin like this");
  refused(std::string(1000, '\0'));
  refused("");
  EXPECT_THROW(load_config(folder.path()), ConfigError);
  EXPECT_THROW(load_config(folder.path() / "missing.toml"), ConfigError);
  ASSERT_EQ(::mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(load_config(folder.path() / "pipe"), ConfigError);  // and does not wait for a writer
}

// Catches: a reader that only takes the line ends of its own system.
TEST(ConfigFiles, CFG_06_ByteOrderMarkAndCarriageReturnsAreTaken) {
  std::string text = "\xef\xbb\xbf";
  for (const char c : kBench)
    text += c == '\n' ? std::string("\r\n") : std::string(1, c);
  expect_equal(parse(text), parse(kBench));
}

// Catches: a crash, or an exception that the program does not expect, on any damaged byte.
TEST(ConfigFiles, CFG_08_OneDamagedByteEitherLoadsOrGivesAConfigError) {
  const Folder folder;
  fs::create_directories(folder.path() / "benches");
  fs::create_directories(folder.path() / "motors");
  const std::string bench = read(kConfigs / "benches/servo.toml") +
                            "[[can]]\nbackend = 'slcan'\nchannel = 'tcp:127.0.0.1:0'\nbit_rate = 500_000\n"
                            "[can.ids]\nstate = 0x600\n[can.units]\ncurrent_a = 1e-3\n"
                            "[modbus]\naddress = '::1'\nallow_writes = true\n";
  const std::string motor = read(kConfigs / "motors/servo-im.toml");
  folder.write("motors/servo-im.toml", motor);
  int loaded = 0;
  int refused = 0;
  const auto try_it = [&](const std::string& text) {
    try {
      const BenchConfig config = parse_config(text, "b.toml", folder.path() / "benches");
      EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
      ++loaded;
    } catch (const ConfigError& error) {
      EXPECT_FALSE(error.problems().empty());
      ++refused;
    }
  };
  const auto damage = [](std::string text, std::size_t at, unsigned bit) {
    text[at] = static_cast<char>(static_cast<unsigned char>(text[at]) ^ (1u << bit));
    return text;
  };
  constexpr unsigned kEvery = kSanitized ? 8 : 1;
  for (std::size_t i = 0; i < bench.size(); ++i) {
    for (unsigned bit = i % kEvery; bit < 8; bit += kEvery)
      try_it(damage(bench, i, bit));
    if (i % kEvery == 0) try_it(std::string(bench).erase(i, 1));
  }
  for (std::size_t i = 0; i < motor.size(); ++i) {
    folder.write("motors/servo-im.toml", damage(motor, i, i % 8));
    try_it(bench);
  }
  EXPECT_GT(loaded, repetitions(1000));  // comments
  EXPECT_GT(refused, repetitions(1000));
}

// Catches: a foreign recording whose configuration makes the replay open files of this machine.
TEST(ConfigFiles, ATextWithoutAFolderMayNameNoOtherFile) {
  try {
    parse_config("[tcp]\ntokens_file = 'secret'\n[[axis]]\nname = 'a'\nmotor = 'motor.toml'\n", "bench.toml",
                 {});
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("motor names another file"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("tokens_file names another file"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace drivebench::test::files_test
