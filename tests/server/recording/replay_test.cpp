#include "server/recording/replay.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "bench.pb.h"
#include "plant/parameters/parameters.hpp"
#include "protocols/mcap/mcap.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"
#include "server/host/build_id.hpp"
#include "server/recording/recording.hpp"
#include "tests/repetitions.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::replay_test {
namespace {

using Result = ReplayReport::Result;
using Bytes = std::vector<std::byte>;

/// Axes of a servo, with loads and a bump on the second one, some of them behind a trigger.
BenchConfig bench_with_events(std::size_t axes) {
  BenchConfig config = servo_bench(axes);
  const auto load = static_cast<std::uint64_t>(find_signal("load_nm") - kSignals.data());
  const Trigger loaded{.axis = 1, .condition = {.signal = load, .number = 0.01}};
  config.axes[1].events = {
      {.tick = 5, .action = LoadChange{.load_nm = 0.02, .ramp_ticks = 3}},
      {.tick = 2, .action = LoadChange{.load_nm = 0.01, .ramp_ticks = 0}, .trigger = loaded},
      {.tick = 3, .action = ShaftBump{2e-4}, .trigger = loaded}};
  return config;
}

/// A lockstep run with every event that a recording can hold: two axes, a lease, commands, loads from the
/// file, one of them behind a trigger, and from clients, a parameter write and a ramp, a fault, a bump,
/// refused commands, a clear.
Bytes record(Tick ticks, std::uint64_t* state_hash = nullptr, std::size_t axes = 2) {
  const TestFolder folder;
  const BenchConfig config = bench_with_events(axes);
  asio::io_context io(1);
  const auto engine =
      make_lockstep_engine(config, std::make_unique<Recorder>(folder / "run.mcap", config), io);
  const auto send = [&engine](std::uint32_t axis, const auto& action, Tick tick = 0) {
    engine->request({.tick = tick, .axis = axis, .owner = axis == 0 ? Owner{1} : 0, .action = action},
                    [](Refused, Tick) {});
  };
  send(0, LeaseAction::kAcquire);
  for (Tick tick = 0; tick < ticks; ++tick) {
    if (tick == 3) send(0, LoadChange{0.05, 0}, 9);
    if (tick == 6) send(0, write_of(servo_axis(), "machine.rotor_resistance_ohm", 5.0));
    if (tick == 4) send(0, write_of(servo_axis(), "machine.stator_resistance_ohm", 2.5, 9), 5);
    if (tick == 4) send(1, fault_of("current_sensor_gain", -0.25), 8);
    if (tick == 4) send(1, ShaftBump{1e-4}, 6);
    if (tick == 8) engine->command(0, 1, voltage(tick, std::nan(""), 1.0));
    if (tick == 9) send(0, ClearFaults{});
    engine->command(0, 1, voltage(tick, 20.0, -10.0));
    engine->advance();
  }
  const Verdict verdict = engine->stop();
  EXPECT_EQ(verdict.ticks, static_cast<std::uint64_t>(ticks) + 1) << "the last tick is one of safe action";
  if (state_hash != nullptr) *state_hash = verdict.state_hash;
  return content_of(folder / "run.mcap");
}

struct Entry {
  std::string topic;
  McapMessageHeader header;
  Bytes payload;
};

/// The recording written anew, with right checksums and counts, each message changed by `edit`; a message for
/// which `edit` returns false is dropped.
Bytes rewritten(const Bytes& recording, const std::function<bool(Entry&)>& edit, int repeat_from = -1) {
  McapReader reader(recording);
  Bytes out;
  McapWriter writer([&out](std::span<const std::byte> b) { out.insert(out.end(), b.begin(), b.end()); },
                    {.profile = std::string(kRecordingProfile), .library = "test"});
  std::vector<Entry> entries;
  for (McapMessage message; reader.next(message);) {
    entries.push_back({.topic = std::string(reader.channels().at(message.header.channel).topic),
                       .header = message.header,
                       .payload = {message.payload.begin(), message.payload.end()}});
    const auto n = static_cast<int>(entries.size()) - 1;
    if (n == repeat_from) entries.push_back(entries.back());
  }
  EXPECT_FALSE(reader.problem());
  for (const McapAttachment& a : reader.attachments())
    writer.add_attachment(a.name, a.media_type, a.log_time_ns, a.data);
  for (const auto& [id, s] : reader.schemas())
    writer.add_schema(s.name, s.encoding, std::as_bytes(std::span(s.data.data(), s.data.size())));
  for (const auto& [id, c] : reader.channels())
    writer.add_channel(c.topic, c.schema_id, c.message_encoding);
  for (Entry& entry : entries) {
    if (edit(entry)) writer.add_message(entry.header, entry.payload);
  }
  writer.finish();
  return out;
}

ReplayReport replayed(const Bytes& recording) {
  return replay(recording, nullptr);
}

// Catches: an input that is recorded or applied differently from how it acted in the run.
TEST(Replay, REC_12_ARunReplaysBitForBit) {
  std::uint64_t state_hash = 0;
  const Bytes recording = record(500, &state_hash);
  const ReplayReport report = replayed(recording);
  EXPECT_EQ(report.result, Result::kEqual) << report.problem;
  EXPECT_EQ(report.ticks, 501u);
  EXPECT_EQ(report.samples, 2 * 502u) << "of two axes, with those of tick 0";
  EXPECT_EQ(report.inputs, 8 + 3 + 500u + 1) << "the last one takes the lease back";
  EXPECT_EQ(report.state_hash, state_hash);
  EXPECT_NE(report.recorded_by.find("drivebench"), std::string::npos);
  EXPECT_FALSE(report.difference);
  // Rewriting by itself changes nothing.
  EXPECT_EQ(replayed(rewritten(recording, [](Entry&) { return true; })).result, Result::kEqual);
}

// Catches: an event that is lost or that acts twice because the recording has it too, a lease that stays, a
// tick too many, a bench of other parameters that is taken for the recorded one.
TEST(Replay, ABenchRepeatsARecordingUpToATickAndGoesOn) {
  const Bytes recording = record(60);
  std::vector<Sample> recorded;  // of the axis without a controller
  McapReader reader(recording);
  for (McapMessage message; reader.next(message);) {
    const std::string_view topic = reader.channels().at(message.header.channel).topic;
    if (topic == sample_topic(bench_with_events(2).axes[1].name))
      recorded.push_back(*decode_sample(message.payload));
  }
  for (const Tick until : {1, 4, 7, 8, 9, 12, 50}) {
    const BenchConfig config = bench_with_events(2);
    Bench bench(config.setup);
    await_events(config, bench);
    Tick ticks = 0;
    repeat({recording}, bench, {.until = until, .before_tick = [&ticks] { ++ticks; }});
    EXPECT_EQ(bench.tick(), until);
    EXPECT_EQ(ticks, until);
    bench.release_leases();
    EXPECT_EQ(bench.owner(0), 0u);
    EXPECT_EQ(bench.sample(0).faults & kLatchedFaults, 0u);
    for (; bench.tick() < 20; bench.step()) {
      const Sample& then = recorded.at(static_cast<std::size_t>(bench.tick()));
      EXPECT_EQ(bench.sample(1).load_nm, then.load_nm);
      if (until > 4) {
        EXPECT_EQ(bench.sample(1).speed_rad_s, then.speed_rad_s) << "a client's inputs came by then";
      }
    }
  }
  BenchConfig other = bench_with_events(2);
  other.setup.seed += 1;
  Bench bench(other.setup);
  EXPECT_THROW(repeat({recording}, bench, {.until = 5, .before_tick = [] {}}), std::runtime_error);
  EXPECT_THROW(repeat({recording}, bench, {.until = 0, .before_tick = [] {}}), std::runtime_error);
  Bench at_start(bench_with_events(2).setup);
  repeat({recording}, at_start, {.until = 0, .before_tick = [] { ADD_FAILURE(); }});
  EXPECT_EQ(at_start.tick(), 0);
  Bench short_run(bench_with_events(2).setup);
  EXPECT_THROW(repeat({recording}, short_run, {.until = 100, .before_tick = [] {}}), std::runtime_error);
}

// Catches: a right recording of another build that is refused, or a wrong one whose report does not name the
// build.
TEST(Replay, REC_12_ARecordingOfAnotherBuildIsReported) {
  const Bytes recording = record(60);
  EXPECT_TRUE(replayed(recording).same_build);
  const ReplayReport other = replayed(rewritten(recording, [](Entry&) { return true; }));
  EXPECT_EQ(other.result, Result::kEqual);
  EXPECT_FALSE(other.same_build);
  EXPECT_EQ(other.recorded_by, "test");
  const ReplayReport changed =
      replayed(rewritten(recording, [](Entry& e) { return e.topic != kVerdictTopic; }));
  EXPECT_NE(changed.problem.find("recorded by test, this is " + recorder_name()), std::string::npos)
      << changed.problem;
}

// Catches: a comparison with a tolerance, of some signals only, or one that names the wrong place. Checksums
// are right here: only the physics can tell.
TEST(Replay, OneFlippedBitOfASampleIsFoundAndNamed) {
  const Bytes recording = record(60);
  std::mt19937 random(5);
  for (const Signal& signal : kSignals) {
    if (signal.name == "tick") continue;  // ASampleOfAnotherTickIsADifference
    const std::uint64_t tick = 1 + random() % 60;
    const std::size_t axis = random() % 2;
    const std::uint64_t bit = random() % (signal.type == SignalType::kReal ? 64 : 40);
    const Bytes changed = rewritten(recording, [&](Entry& entry) {
      if (entry.topic != sample_topic("axis" + std::to_string(axis))) return true;
      std::optional<Sample> sample = decode_sample(entry.payload);
      if (sample->tick != tick) return true;
      if (signal.as_real != nullptr) {
        double& value = (*sample).*signal.as_real;
        value = std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) ^ std::uint64_t{1} << bit);
      } else if (signal.as_signed != nullptr) {
        (*sample).*signal.as_signed ^= std::int64_t{1} << bit;
      } else {
        (*sample).*signal.as_unsigned ^= std::uint64_t{1} << bit;
      }
      entry.payload.resize(kMaxSampleBytes);
      entry.payload.resize(encode_sample(*sample, kAllSignals, entry.payload.data()));
      return true;
    });
    const ReplayReport report = replayed(changed);
    ASSERT_EQ(report.result, Result::kDifferent) << signal.name << " bit " << bit;
    ASSERT_TRUE(report.difference) << report.problem;
    EXPECT_EQ(report.difference->tick, tick);
    EXPECT_EQ(report.difference->signal, signal.name);
    EXPECT_EQ(report.difference->axis, "axis" + std::to_string(axis));
    EXPECT_NE(report.difference->recorded, report.difference->replayed);
    EXPECT_NE(report.problem.find(std::string(signal.name)), std::string::npos);
  }
}

// Catches: a byte of the file that no check covers.
TEST(Replay, REC_09_OneFlippedBitAnywhereIsNeverEqual) {
  const Bytes recording = record(12);
  ASSERT_EQ(replayed(recording).result, Result::kEqual);
  std::mt19937 random(6);
  Bytes damaged = recording;
  for (std::size_t at = 0; at < recording.size(); at += 1 + random() % (kSanitized ? 200 : 20)) {
    const auto mask = std::byte(1u << random() % 8);
    damaged[at] ^= mask;
    const ReplayReport report = replayed(damaged);
    EXPECT_NE(report.result, Result::kEqual) << "byte " << at << " of " << recording.size();
    EXPECT_FALSE(report.problem.empty());
    damaged[at] ^= mask;
  }
}

Bytes cut(const Bytes& recording, std::size_t size) {
  return {recording.begin(), recording.begin() + static_cast<std::ptrdiff_t>(size)};
}

// Catches: a recording that ends early and counts as equal as a whole, or as unusable although whole ticks
// are there.
TEST(Replay, REC_01_REC_09_ATruncatedRecordingIsEqualUpToItsLastWholeTick) {
  const Bytes recording = record(1700);  // two chunks of 100 ms and a rest
  std::mt19937 random(7);
  std::vector<std::uint64_t> last;
  std::vector<std::size_t> sizes;
  for (std::size_t size = 0; size < recording.size(); size += 1 + random() % 20'000)
    sizes.push_back(size);
  sizes.push_back(recording.size() - 1);
  for (const std::size_t size : sizes) {
    const ReplayReport report = replayed(cut(recording, size));
    EXPECT_FALSE(report.problem.empty());
    if (report.samples == 0) {
      EXPECT_EQ(report.result, Result::kUnusable) << size;
    } else {
      EXPECT_EQ(report.result, Result::kEqualWithoutEnd) << size << ": " << report.problem;
      EXPECT_EQ(report.samples, 2 * (report.ticks + 1));
      if (last.empty() || last.back() != report.ticks) last.push_back(report.ticks);
    }
  }
  EXPECT_EQ(last, (std::vector<std::uint64_t>{799, 1599, 1701}));
}

// Catches: a difference that the missing end of the recording hides; a tick that only some axes have that
// counts.
TEST(Replay, REC_01_WithoutAnEndEverySampleIsStillCompared) {
  const Bytes recording = record(20);
  const auto without_verdict = [](Entry& e) { return e.topic != kVerdictTopic; };
  const ReplayReport whole = replayed(rewritten(recording, without_verdict));
  EXPECT_EQ(whole.result, Result::kEqualWithoutEnd);
  EXPECT_EQ(whole.ticks, 21u);
  const ReplayReport half = replayed(rewritten(recording, [&](Entry& e) {
    return without_verdict(e) && (e.topic != "/axis1/sample" || decode_sample(e.payload)->tick < 21);
  }));
  EXPECT_EQ(half.result, Result::kEqualWithoutEnd);
  EXPECT_EQ(half.ticks, 20u) << "axis1 has no sample of tick 21";
  const ReplayReport changed = replayed(rewritten(recording, [&](Entry& e) {
    if (e.topic == "/axis1/sample" && decode_sample(e.payload)->tick == 21) {
      Sample sample = *decode_sample(e.payload);
      sample.i_a_a += 1e-3;
      e.payload.resize(kMaxSampleBytes);
      e.payload.resize(encode_sample(sample, kAllSignals, e.payload.data()));
    }
    return without_verdict(e);
  }));
  EXPECT_EQ(changed.result, Result::kDifferent);
}

// Catches: inputs that the replay does not apply; each is dropped in turn.
TEST(Replay, ADroppedInputIsADifference) {
  const Bytes recording = record(20);
  std::size_t inputs = 0;
  rewritten(recording, [&inputs](Entry& entry) {
    inputs += entry.topic == kInputTopic ? 1u : 0u;
    return true;
  });
  ASSERT_GT(inputs, 20u);
  for (std::size_t dropped = 0; dropped < inputs; ++dropped) {
    std::size_t n = 0;
    bool harmless = false;
    const ReplayReport report = replayed(rewritten(recording, [&](Entry& entry) {
      if (entry.topic != kInputTopic || n++ != dropped) return true;
      v1::Input input;
      EXPECT_TRUE(input.ParseFromArray(entry.payload.data(), static_cast<int>(entry.payload.size())));
      harmless = input.clear();  // clears faults, of which there are none; it also resets the control state
      return false;
    }));
    EXPECT_TRUE(harmless || report.result != Result::kEqual) << "input " << dropped;
  }
}

/// The recording with its n-th input changed.
Bytes with_input(const Bytes& recording, std::size_t n, const std::function<void(Entry&, v1::Input&)>& edit) {
  std::size_t seen = 0;
  return rewritten(recording, [&](Entry& entry) {
    if (entry.topic != kInputTopic || seen++ != n) return true;
    v1::Input input;
    EXPECT_TRUE(input.ParseFromArray(entry.payload.data(), static_cast<int>(entry.payload.size())));
    edit(entry, input);
    entry.payload.resize(input.ByteSizeLong());
    EXPECT_TRUE(input.SerializeToArray(entry.payload.data(), static_cast<int>(entry.payload.size())));
    return true;
  });
}

// Catches: a tick of an input that is written and never read, so that a recording says of a command that it
// acted at another tick than the one in which it did, and replays as equal.
TEST(Replay, REC_14_AnInputThatDoesNotFitItsPlaceIsDamage) {
  const Bytes recording = record(20);
  std::size_t changed = 0;
  for (std::size_t n = 0; n < 30; ++n) {
    std::uint64_t received = 0;
    bool may_wait = false;
    with_input(recording, n, [&](Entry&, v1::Input& input) {
      received = input.received_tick();
      may_wait = input.has_load() || input.has_parameter() || input.has_inject() || input.has_bump();
      EXPECT_TRUE(may_wait || input.tick() == received);
    });
    const auto refused = [&](const char* what, const std::function<void(Entry&, v1::Input&)>& edit) {
      const ReplayReport report = replayed(with_input(recording, n, edit));
      EXPECT_EQ(report.result, Result::kUnusable) << what << " of input " << n;
      EXPECT_NE(report.problem.find("tick"), std::string::npos) << report.problem;
      ++changed;
    };
    refused("its arrival", [](Entry&, v1::Input& i) { i.set_received_tick(i.received_tick() + 1); });
    refused("the time", [](Entry& e, v1::Input&) { e.header.log_time_ns += 1; });
    refused("its own tick", [](Entry&, v1::Input& i) { i.set_tick(~std::uint64_t{0}); });
    if (received > 0) {
      refused("its arrival", [](Entry&, v1::Input& i) { i.set_received_tick(i.received_tick() - 1); });
      refused("its own tick", [](Entry&, v1::Input& i) { i.set_tick(i.received_tick() - 1); });
    }
    if (!may_wait) refused("its own tick", [](Entry&, v1::Input& i) { i.set_tick(i.received_tick() + 1); });
  }
  EXPECT_GT(changed, 150u);
}

// Catches: samples of one axis that are missing, doubled or swapped and not counted.
TEST(Replay, AMissingOrDoubledSampleIsADifference) {
  const Bytes recording = record(20);
  for (const char* topic : {"/axis0/sample", "/axis1/sample"}) {
    for (const std::uint64_t tick : {0u, 7u, 20u}) {
      const ReplayReport report = replayed(rewritten(recording, [&](Entry& entry) {
        return entry.topic != topic || decode_sample(entry.payload)->tick != tick;
      }));
      EXPECT_NE(report.result, Result::kEqual) << topic << " without tick " << tick;
      EXPECT_FALSE(report.problem.empty());
    }
  }
  std::vector<std::string> topics;
  rewritten(recording, [&topics](Entry& entry) {
    topics.push_back(entry.topic);
    return true;
  });
  for (int n = 0; n < static_cast<int>(topics.size()); ++n) {
    if (topics[static_cast<std::size_t>(n)] == kInputTopic) continue;
    const ReplayReport report = replayed(rewritten(
        recording, [](Entry&) { return true; }, n));
    EXPECT_NE(report.result, Result::kEqual)
        << "message " << n << " twice: " << topics[static_cast<std::size_t>(n)];
  }
}

// Catches: samples that are counted but not compared: one of an axis stands in the place of another axis's.
TEST(Replay, ASampleInThePlaceOfAnotherAxisIsADifference) {
  Entry first;
  const ReplayReport report = replayed(rewritten(record(20, nullptr, 3), [&first](Entry& entry) {
    if (entry.topic == "/axis1/sample") first = entry;
    if (entry.topic == "/axis2/sample" && decode_sample(entry.payload)->tick == 7) entry = first;
    return true;
  }));
  EXPECT_EQ(report.result, Result::kDifferent);
  EXPECT_NE(report.problem.find("axis1 at tick 7"), std::string::npos) << report.problem;
}

// Catches: a tick number that is not checked.
TEST(Replay, ASampleOfAnotherTickIsADifference) {
  const Bytes recording = record(20);
  for (const std::uint64_t wrong :
       {std::uint64_t{0}, std::uint64_t{9}, std::uint64_t{11}, ~std::uint64_t{0}}) {
    const ReplayReport report = replayed(rewritten(recording, [&](Entry& entry) {
      if (entry.topic != "/axis0/sample") return true;
      Sample sample = *decode_sample(entry.payload);
      if (sample.tick == 10) sample.tick = wrong;
      entry.payload.resize(kMaxSampleBytes);
      entry.payload.resize(encode_sample(sample, kAllSignals, entry.payload.data()));
      return true;
    }));
    EXPECT_EQ(report.result, Result::kDifferent) << wrong;
  }
}

Bytes with_verdict(const Bytes& recording, const std::function<void(v1::Verdict&)>& edit) {
  return rewritten(recording, [&edit](Entry& entry) {
    if (entry.topic != kVerdictTopic) return true;
    v1::Verdict verdict;
    EXPECT_TRUE(verdict.ParseFromArray(entry.payload.data(), static_cast<int>(entry.payload.size())));
    edit(verdict);
    entry.payload.resize(verdict.ByteSizeLong());
    EXPECT_TRUE(verdict.SerializeToArray(entry.payload.data(), static_cast<int>(entry.payload.size())));
    return true;
  });
}

// Catches: a state hash, a number of ticks or a count of losses that is written and never read.
TEST(Replay, TheVerdictMustAgree) {
  const Bytes recording = record(20);
  EXPECT_EQ(
      replayed(with_verdict(recording, [](v1::Verdict& v) { v.set_state_hash(v.state_hash() ^ 1); })).result,
      Result::kDifferent);
  EXPECT_EQ(replayed(with_verdict(recording, [](v1::Verdict& v) { v.set_gaps(1); })).result,
            Result::kUnusable);
  EXPECT_NE(replayed(with_verdict(recording, [](v1::Verdict& v) { v.set_ticks(19); })).result,
            Result::kEqual);
}

// Catches: a file of another kind taken for a recording.
TEST(Replay, AFileThatIsNoRecordingIsUnusable) {
  EXPECT_EQ(replayed({}).result, Result::kUnusable);
  EXPECT_EQ(replayed(Bytes(1000, std::byte{0})).result, Result::kUnusable);
  Bytes out;
  McapWriter writer([&out](std::span<const std::byte> b) { out.insert(out.end(), b.begin(), b.end()); },
                    {.profile = "", .library = "another program"});
  writer.add_message({.channel = writer.add_channel("/talk", 0, "text")}, {});
  writer.finish();
  const ReplayReport report = replayed(out);
  EXPECT_EQ(report.result, Result::kUnusable);
  EXPECT_EQ(report.recorded_by, "another program");
}

}  // namespace
}  // namespace drivebench::replay_test
