#include "server/recording/recorder.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <cstring>
#include <map>
#include <system_error>

#include "bench.pb.h"
#include "plant/parameters/parameters.hpp"
#include "protocols/mcap/mcap.hpp"
#include "protocols/sample_codec.hpp"
#include "server/recording/recording.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::recorder_test {
namespace {

bool same_words(const Sample& a, const Sample& b) {
  return std::memcmp(&a, &b, sizeof(a)) == 0;
}

/// The contents of a recording, in order.
struct Recording {
  explicit Recording(const std::filesystem::path& file) : bytes(content_of(file)), reader(bytes) {
    for (McapMessage message; reader.next(message);) {
      const std::string topic(reader.channels().at(message.header.channel).topic);
      order.push_back(topic);
      times_ns.push_back(message.header.log_time_ns);
      const auto size = static_cast<int>(message.payload.size());
      if (topic == kInputTopic) {
        EXPECT_TRUE(inputs.emplace_back().ParseFromArray(message.payload.data(), size));
      } else if (topic == kVerdictTopic) {
        EXPECT_TRUE(verdicts.emplace_back().ParseFromArray(message.payload.data(), size));
      } else if (const auto sample = decode_sample(message.payload)) {
        samples[topic].push_back(*sample);
      } else {
        ADD_FAILURE() << "a sample cannot be read";
      }
      EXPECT_EQ(message.header.sequence, sequences[topic]++) << topic;
    }
  }

  std::vector<std::byte> bytes;
  McapReader reader;
  std::vector<std::string> order;
  std::vector<std::uint64_t> times_ns;
  std::map<std::string, std::vector<Sample>> samples;
  std::vector<v1::Input> inputs;
  std::vector<v1::Verdict> verdicts;
  std::map<std::string, std::uint32_t> sequences;
};

Sample sample_of(std::uint64_t tick, double current_a) {
  return {.tick = tick, .command_tick = 0, .index_tick = -1, .i_a_a = current_a};
}

// Catches: an entry that is lost, doubled, changed or out of order on its way into the file; a file without
// verdict, configuration or schema.
TEST(Recorder, EverySampleAndInputIsInTheFileInOrder) {
  const TestFolder folder;
  const BenchConfig config = servo_bench(2);
  Recorder recorder(folder / "run.mcap", config);
  constexpr std::uint64_t kTicks = 20'000;
  for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
    recorder.wait_for_room();
    if (tick % 10 == 0) {
      recorder.on_input(
          static_cast<Tick>(tick),
          {.tick = static_cast<Tick>(tick + 5), .axis = 1, .owner = 3, .action = LoadChange{0.5, 7}});
    }
    for (std::uint32_t axis = 0; axis < 2; ++axis)
      recorder.on_sample(axis, sample_of(tick, axis + 1e-3 * static_cast<double>(tick)));
  }
  recorder.finish({.ticks = kTicks, .state_hash = 0x1234});
  EXPECT_EQ(recorder.gaps(), 0u);

  const Recording recording(folder / "run.mcap");
  EXPECT_FALSE(recording.reader.problem()) << recording.reader.problem()->what;
  EXPECT_EQ(recording.reader.profile(), kRecordingProfile);
  ASSERT_EQ(recording.samples.size(), 2u);
  for (std::uint32_t axis = 0; axis < 2; ++axis) {
    const auto& samples = recording.samples.at(sample_topic(config.axes[axis].name));
    ASSERT_EQ(samples.size(), kTicks);
    for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
      ASSERT_TRUE(same_words(samples[tick], sample_of(tick, axis + 1e-3 * static_cast<double>(tick))))
          << tick;
    }
  }
  ASSERT_EQ(recording.inputs.size(), kTicks / 10);
  for (std::size_t n = 0; n < recording.inputs.size(); ++n) {
    const v1::Input& input = recording.inputs[n];
    EXPECT_EQ(input.received_tick(), 10 * n);
    EXPECT_EQ(input.tick(), 10 * n + 5);
    EXPECT_EQ(input.axis(), 1u);
    EXPECT_EQ(input.owner(), 3u);
    EXPECT_EQ(input.load().load_nm(), 0.5);
    EXPECT_EQ(input.load().ramp_ticks(), 7u);
  }
  EXPECT_EQ(recording.order[0], kInputTopic) << "in the order of the calls";
  EXPECT_EQ(recording.order[1], "/axis0/sample");
  EXPECT_EQ(recording.order.back(), kVerdictTopic);
  EXPECT_EQ(recording.times_ns[1 + 2 + 2], 2 * 125'000u) << "plant time, not wall time";
  ASSERT_EQ(recording.verdicts.size(), 1u);
  EXPECT_EQ(recording.verdicts[0].ticks(), kTicks);
  EXPECT_EQ(recording.verdicts[0].state_hash(), 0x1234u);
  EXPECT_TRUE(recording.verdicts[0].exact());
  ASSERT_EQ(recording.reader.attachments().size(), 1u);
  EXPECT_EQ(recording.reader.attachments()[0].name, kConfigurationAttachment);
  for (const auto& [id, schema] : recording.reader.schemas())
    EXPECT_EQ(schema.encoding, "protobuf") << schema.name;
}

// Catches: an action that is recorded as another one, or without its contents.
TEST(Recorder, EveryKindOfInputKeepsItsContents) {
  const TestFolder folder;
  Recorder recorder(folder / "run.mcap", servo_bench());
  const auto put = [&recorder](const auto& action) {
    recorder.on_input(4, {.tick = 4, .axis = 0, .owner = 9, .action = action});
  };
  put(ClearFaults{});
  put(Command{.answers = 3,
              .phases = {.gates = Gates::kZeroVoltage,
                         .setpoint = {.a = -0.0, .b = 5e-324, .c = 1.0, .field = -2.0}}});
  put(LeaseAction::kLost);
  put(LoadChange{-0.25, 0});
  put(ParameterWrite{.row = 1, .value = 2.5, .ramp_ticks = 77});
  put(LateTick{});
  put(Overrun{});
  put(RefusedCommand{});
  put(fault_of("hall_offset", -0.25));
  put(ShaftBump{-0.5});
  put(Multisine{.quantity = Multisine::Quantity::kCurrentOffset,
                .periods = 6,
                .amplitude = 0.25,
                .lines = {.period_ticks = 800, .lowest = 3, .highest = 300, .ratio = 1.5}});
  put(Command{
      .answers = 4,
      .phases = {.gates = Gates::kCurrent, .setpoint = {.a = 1.0, .b = 2.0, .c = 3.0, .field = 4.0}}});
  recorder.finish({});

  const Recording recording(folder / "run.mcap");
  ASSERT_EQ(recording.inputs.size(), 12u);
  EXPECT_TRUE(recording.inputs[0].clear());
  EXPECT_EQ(recording.inputs[1].command().tick(), 3u);
  EXPECT_EQ(recording.inputs[1].command().gates(), v1::GATES_ZERO);
  EXPECT_TRUE(std::signbit(recording.inputs[1].command().u_a_v()));
  EXPECT_EQ(recording.inputs[1].command().u_b_v(), 5e-324);
  EXPECT_EQ(recording.inputs[1].command().u_c_v(), 1.0);
  EXPECT_EQ(recording.inputs[1].command().u_f_v(), -2.0);
  EXPECT_EQ(recording.inputs[2].lease(), v1::LeaseRequest::ACTION_LOST);
  EXPECT_EQ(recording.inputs[3].load().load_nm(), -0.25);
  EXPECT_EQ(recording.inputs[4].parameter().name(), axis_parameters(servo_axis())[1].name);
  EXPECT_EQ(recording.inputs[4].parameter().value(), 2.5);
  EXPECT_EQ(recording.inputs[4].parameter().ramp_ticks(), 77u);
  EXPECT_EQ(recording.inputs[5].action_case(), v1::Input::kLateTick);
  EXPECT_EQ(recording.inputs[6].action_case(), v1::Input::kOverrun);
  EXPECT_EQ(recording.inputs[7].action_case(), v1::Input::kRefusedCommand);
  EXPECT_EQ(recording.inputs[8].inject().name(), "hall_offset");
  EXPECT_EQ(recording.inputs[8].inject().value(), -0.25);
  EXPECT_EQ(recording.inputs[9].bump().impulse_nms(), -0.5);
  const v1::Multisine& sum = recording.inputs[10].multisine();
  EXPECT_EQ(sum.quantity(), v1::Multisine::QUANTITY_CURRENT_OFFSET);
  EXPECT_EQ(sum.periods(), 6u);
  EXPECT_EQ(sum.amplitude(), 0.25);
  EXPECT_EQ(sum.period_ticks(), 800u);
  EXPECT_EQ(sum.lowest(), 3u);
  EXPECT_EQ(sum.highest(), 300u);
  EXPECT_EQ(sum.ratio(), 1.5);
  const v1::Command& currents = recording.inputs[11].command();
  EXPECT_EQ(currents.gates(), v1::GATES_CURRENT);
  EXPECT_EQ(currents.u_a_v() + currents.u_b_v() + currents.u_c_v() + currents.u_f_v(), 0.0);
  EXPECT_EQ(currents.i_a_a(), 1.0);
  EXPECT_EQ(currents.i_b_a(), 2.0);
  EXPECT_EQ(currents.i_c_a(), 3.0);
  EXPECT_EQ(currents.i_f_a(), 4.0);
}

// Catches: yesterday's recording overwritten; a name that follows a symbolic link elsewhere. REC-07.
TEST(Recorder, REC_07_TheFileMustBeNew) {
  const TestFolder folder;
  std::ofstream(folder / "there.mcap") << "precious";
  std::filesystem::create_symlink(folder / "elsewhere", folder / "link.mcap");
  std::filesystem::create_directory(folder / "folder.mcap");
  for (const char* name :
       {"there.mcap", "link.mcap", "folder.mcap", "no/such/folder.mcap", "/proc/run.mcap", ""}) {
    EXPECT_THROW(Recorder(folder / name, servo_bench()), std::system_error) << name;
  }
  EXPECT_EQ(content_of(folder / "there.mcap").size(), 8u);
  EXPECT_FALSE(std::filesystem::exists(folder / "elsewhere"));
}

// Catches: a full queue that blocks, overwrites or forgets in silence. The queue is small here (a period of a
// second), and a tick that only copies is faster than a thread that encodes and writes.
TEST(Recorder, RT_04_AFullQueueLosesEntriesAndCountsThem) {
  const TestFolder folder;
  BenchConfig config = servo_bench();
  config.setup.period_ns = 1'000'000'000;
  Recorder recorder(folder / "run.mcap", config);
  std::uint64_t pushed = 0;
  while (recorder.gaps() < 1000 && pushed < 200'000'000)
    recorder.on_sample(0, sample_of(pushed++, 1.0));
  recorder.finish({.ticks = pushed});
  ASSERT_GE(recorder.gaps(), 1000u);
  const Recording recording(folder / "run.mcap");
  EXPECT_FALSE(recording.reader.problem());
  const auto& samples = recording.samples.at("/axis0/sample");
  EXPECT_EQ(samples.size() + recorder.gaps(), pushed);
  for (std::size_t n = 1; n < samples.size(); ++n)
    ASSERT_GT(samples[n].tick, samples[n - 1].tick);
  EXPECT_EQ(recording.verdicts.at(0).gaps(), recorder.gaps());
  EXPECT_FALSE(recording.verdicts.at(0).exact());
}

/// Lets no file of this process grow beyond a size, as a full disk would.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : old_handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit limit{.rlim_cur = bytes, .rlim_max = old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit old_{};
  void (*old_handler_)(int);
};

// Catches: a full disk that ends the process, that is not reported, or that costs more than is counted: the
// readable and the lost entries must add up to all. REC-03, REC-04.
TEST(Recorder, REC_03_AFullDiskIsCountedToTheLastEntry) {
  for (const rlim_t limit : {rlim_t{100}, rlim_t{50'000}, rlim_t{700'000}, rlim_t{1'500'000}}) {
    const TestFolder folder;
    constexpr std::uint64_t kTicks = 30'000;
    std::uint64_t gaps = 0;
    {
      const FileSizeLimit full_disk(limit);
      Recorder recorder(folder / "run.mcap", servo_bench());
      for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
        recorder.wait_for_room();
        recorder.on_sample(0, sample_of(tick, 1.0 / static_cast<double>(tick + 1)));
      }
      recorder.finish({.ticks = kTicks});
      gaps = recorder.gaps();
    }
    const Recording recording(folder / "run.mcap");
    EXPECT_TRUE(recording.reader.problem()) << "it is not whole";
    const auto found = recording.samples.find("/axis0/sample");
    const std::uint64_t samples = found == recording.samples.end() ? 0 : found->second.size();
    // The verdict is an entry as well.
    EXPECT_EQ(samples + recording.verdicts.size() + gaps, kTicks + 1) << limit;
  }
}

// Catches: a file that lost its end only and still counts as whole.
TEST(Recorder, REC_03_ADiskThatFillsAtTheVeryEndIsCounted) {
  const TestFolder folder;
  std::uintmax_t whole = 0;
  for (const std::uintmax_t missing : {0u, 1u, 300u}) {
    const FileSizeLimit full_disk(whole == 0 ? RLIM_INFINITY : whole - missing);
    const std::string name = "run" + std::to_string(missing);
    Recorder recorder(folder / name.c_str(), servo_bench());
    recorder.on_sample(0, sample_of(0, 1.0));
    recorder.finish({.ticks = 1});
    if (whole == 0) {
      whole = std::filesystem::file_size(folder / name.c_str());
      EXPECT_EQ(recorder.gaps(), 0u);
    } else {
      EXPECT_GT(recorder.gaps(), 0u) << missing;
    }
  }
}

// Catches: a run that ends in an exception and then waits for its recorder forever, or kills the process.
TEST(Recorder, MayBeDestroyedWithoutFinish) {
  const TestFolder folder;
  {
    Recorder recorder(folder / "run.mcap", servo_bench());
    recorder.on_sample(0, sample_of(0, 1.0));
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "run.mcap"));
}

}  // namespace
}  // namespace drivebench::recorder_test
