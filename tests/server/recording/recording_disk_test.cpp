// The contents of a recording after its disk failed, lost its power or stalled.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "protocols/mcap/mcap_series.hpp"
#include "protocols/sample_codec.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/recording_writer.hpp"
#include "tests/repetitions.hpp"
#include "tests/server/recording/disks.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::recording_disk_test {
namespace {

using Bytes = std::vector<std::byte>;
using Clock = RecordingWriter::Clock;

constexpr std::uint64_t kTicksOf100Ms = 800;  // at 8 kHz

RecordedEntry sample_at(std::uint64_t tick) {
  return TickedSample(0, {.tick = tick, .i_a_a = 1.0 / static_cast<double>(tick + 1)});
}

/// The ticks whose samples can be read, and whether the file is whole.
struct Found {
  explicit Found(const std::vector<Bytes>& files) {
    std::vector<std::span<const std::byte>> segments(files.begin(), files.end());
    McapSeries series(segments);
    for (McapMessage message; series.next(message);) {
      const std::string_view topic = series.reader().channels().at(message.header.channel).topic;
      has_verdict = topic == kVerdictTopic;
      if (const auto sample = decode_sample(message.payload); topic == "/axis0/sample" && sample)
        ticks.push_back(sample->tick);
    }
    is_whole = !series.problem();
  }
  bool begins_with(std::uint64_t count) const {
    if (ticks.size() < count) return false;
    for (std::uint64_t n = 0; n < count; ++n)
      if (ticks[n] != n) return false;
    return true;
  }
  std::vector<std::uint64_t> ticks;
  bool is_whole = false;
  bool has_verdict = false;
};

std::vector<Bytes> contents_of(const MemoryDisk& disk) {
  std::vector<Bytes> contents;
  for (const std::string& name : disk.names)
    contents.push_back(disk.files.at(name).content);
  return contents;
}

/// Writes samples as the recorder's thread does in real time, on a clock of the test; returns the number of
/// lost ones.
std::uint64_t record(RecordingWriter& writer, std::uint64_t from, std::uint64_t to) {
  const Clock::time_point start = Clock::now();  // the writer was made less than a test's duration earlier
  std::uint64_t lost = 0;
  for (std::uint64_t tick = from; tick < to; ++tick) {
    writer.write(sample_at(tick));
    if (tick % 8 == 0) writer.sync_if_due(start + std::chrono::microseconds(125) * tick);
    lost += writer.take_lost();
  }
  return lost;
}

// ---- power cuts ----

constexpr std::uint64_t kSector = 512;

/// The disk's contents after a power cut behind `cut` calls: everything up to the last sync, and of the later
/// writes each sector by chance and in any order; a sector that was not written reads as zeros, or as old
/// data.
Bytes image_after_cut(const std::vector<DiskEntry>& log, std::size_t cut, std::mt19937& random) {
  std::size_t synced = 0;
  for (std::size_t n = 0; n < cut; ++n)
    if (log[n].call == DiskCall::kSync) synced = n + 1;
  Bytes image;
  const auto put = [&image](std::uint64_t at, std::span<const std::byte> bytes) {
    if (image.size() < at + bytes.size()) image.resize(at + bytes.size());
    std::copy(bytes.begin(), bytes.end(), image.begin() + static_cast<std::ptrdiff_t>(at));
  };
  for (std::size_t n = 0; n < synced; ++n)
    if (log[n].call == DiskCall::kWrite) put(log[n].at, log[n].bytes);
  struct Sector {
    std::uint64_t at;
    std::span<const std::byte> bytes;
  };
  std::vector<Sector> pending;
  std::uint64_t longest = image.size();
  for (std::size_t n = synced; n < cut; ++n) {
    const std::span<const std::byte> all(log[n].bytes);
    for (std::uint64_t done = 0; done < all.size();) {
      const std::uint64_t at = log[n].at + done;
      const std::uint64_t size = std::min(kSector - at % kSector, all.size() - done);
      pending.push_back({at, all.subspan(done, size)});
      done += size;
      longest = std::max(longest, at + size);
    }
  }
  std::shuffle(pending.begin(), pending.end(), random);
  const auto share = random() % 5;  // of 4 that reach the disk
  for (const Sector& sector : pending) {
    if (random() % 4 >= share) continue;
    put(sector.at, sector.bytes);
    if (random() % 64 == 0)
      image[sector.at + random() % sector.bytes.size()] ^= std::byte(1u << random() % 8);
  }
  // The disk writes the size of a file apart from its contents.
  if (random() % 3 == 0 && longest > image.size())
    image.resize(image.size() + random() % (longest - image.size()));
  if (random() % 5 == 0) image.resize(image.size() + random() % 4096, std::byte(random() % 256));
  return image;
}

// Catches: a sync that does not cover the writes before it; a chunk that needs a later one to be read;
// a reader that believes half a sector. Five seconds of a real recording, the power cut at random calls.
TEST(RecordingDisk, REC_02_SyncedDataSurviveAPowerCut) {
  const TestFolder folder;
  MemoryDisk disk;
  constexpr std::uint64_t kTicks = 50 * kTicksOf100Ms;
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {}, {.create = disk.creator()});
  ASSERT_EQ(record(writer, 0, kTicks), 0u);
  writer.finish({.ticks = kTicks});
  const DiskLog& log = disk.files.at("run.mcap");
  // The number of samples that are safe after each call: those in the chunks before the last sync.
  std::vector<std::uint64_t> safe(log.entries.size() + 1);
  std::uint64_t written_bytes = 0;
  for (std::size_t n = 0; n < log.entries.size(); ++n) {
    safe[n + 1] = safe[n];
    if (log.entries[n].call == DiskCall::kWrite) written_bytes += log.entries[n].bytes.size();
    if (log.entries[n].call == DiskCall::kSync) {
      const Bytes written(log.content.begin(),
                          log.content.begin() + static_cast<std::ptrdiff_t>(written_bytes));
      safe[n + 1] = Found(std::vector<Bytes>{written}).ticks.size();
    }
  }
  ASSERT_EQ(safe.back(), kTicks);
  std::mt19937 random(2);
  std::set<std::uint64_t> seen;
  for (int n = 0; n < repetitions(600); ++n) {
    const std::size_t cut = 1 + random() % log.entries.size();
    const Bytes image = image_after_cut(log.entries, cut, random);
    const Found found(std::vector<Bytes>{image});
    ASSERT_TRUE(found.begins_with(safe[cut])) << "image " << n << ", cut after call " << cut;
    for (std::uint64_t tick = 0; tick < found.ticks.size(); ++tick)
      ASSERT_EQ(found.ticks[tick], tick) << "image " << n << ": only written samples are read";
    EXPECT_TRUE(!found.has_verdict || !found.is_whole || found.ticks.size() == kTicks);
    seen.insert(safe[cut]);
  }
  EXPECT_GE(seen.size(), 5u) << "the cuts lie behind every sync";
}

// ---- errors ----

// Catches: a sync that is repeated until it succeeds, though the system has forgotten the data that it could
// not write; a recording that ends there, or goes on in the bad file; losses that are not counted.
TEST(RecordingDisk, REC_05_AfterAFailedSyncANewFileBegins) {
  const TestFolder folder;
  MemoryDisk disk;
  const auto third_sync = [](DiskCall call, std::size_t n) {
    return call == DiskCall::kSync && n == 3 ? EIO : 0;
  };
  constexpr std::uint64_t kTicks = 50 * kTicksOf100Ms;
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {},
                         {.continues_after_errors = true, .create = disk.creator(third_sync)});
  std::uint64_t lost = record(writer, 0, kTicks);
  // At the third second: the data of the second before it, and those on their way.
  EXPECT_GE(lost, 10 * kTicksOf100Ms);
  EXPECT_LE(lost, 12 * kTicksOf100Ms);
  writer.finish({.ticks = kTicks, .gaps = lost});
  EXPECT_EQ(writer.take_lost(), 0u);
  ASSERT_EQ(disk.names, (std::vector<std::string>{"run.mcap", "run.2.mcap"}));
  const std::vector<Bytes> files = contents_of(disk);
  EXPECT_FALSE(Found(std::vector<Bytes>{files[0]}).is_whole) << "it must not look whole";
  const Found all(files);
  EXPECT_FALSE(all.is_whole);
  EXPECT_TRUE(all.has_verdict);
  EXPECT_EQ(all.ticks.back(), kTicks - 1);
  const std::uint64_t first_of_second = 1 + 3 * 10 * kTicksOf100Ms;
  EXPECT_NE(std::find(all.ticks.begin(), all.ticks.end(), first_of_second), all.ticks.end());
  EXPECT_GE(all.ticks.size() + lost, kTicks) << "nothing is lost that was not counted";
}

// Catches: a failed write that ends the run's recording though the disk has room, or that is counted wrongly.
TEST(RecordingDisk, REC_03_REC_05_AfterAFailedWriteANewFileBegins) {
  for (std::size_t run = 0; run < 40; ++run) {
    const int error = run % 2 == 0 ? EIO : ENOSPC;
    const std::size_t bad = 1 + run / 2;
    const TestFolder folder;
    MemoryDisk disk;
    const auto some_write = [error, bad](DiskCall call, std::size_t n) {
      return call == DiskCall::kWrite && n == bad ? error : 0;
    };
    constexpr std::uint64_t kTicks = 25 * kTicksOf100Ms;
    RecordingWriter writer(folder / "run.mcap", servo_bench(), {},
                           {.continues_after_errors = true, .create = disk.creator(some_write)});
    std::uint64_t lost = record(writer, 0, kTicks);
    writer.finish({.ticks = kTicks});
    lost += writer.take_lost();
    const Found found(contents_of(disk));
    EXPECT_EQ(disk.names.size(), error == EIO ? 2u : 1u) << "a full disk has no room for a new file either";
    EXPECT_EQ(writer.is_over(), error == ENOSPC);
    // A file that lost only its beginning or its end counts as one lost entry.
    const std::uint64_t missing = kTicks + 1 - found.ticks.size() - (found.has_verdict ? 1 : 0);
    EXPECT_EQ(lost, std::max<std::uint64_t>(missing, 1)) << std::strerror(error) << " of write " << bad;
    EXPECT_FALSE(found.is_whole);
  }
}

// Catches: an error of the last sync or of close that is not reported; a dead disk on which file after file
// begins.
TEST(RecordingDisk, REC_05_ErrorsAtTheEndAreReportedAndADeadDiskIsGivenUp) {
  for (const DiskCall bad : {DiskCall::kSync, DiskCall::kClose}) {
    const TestFolder folder;
    MemoryDisk disk;
    const auto fault = [bad](DiskCall call, std::size_t) { return call == bad ? EIO : 0; };
    RecordingWriter writer(folder / "run.mcap", servo_bench(), {},
                           {.continues_after_errors = true, .create = disk.creator(fault)});
    record(writer, 0, 100);
    writer.finish({.ticks = 100});
    EXPECT_GE(writer.take_lost(), 1u);
    EXPECT_EQ(disk.names.size(), 1u) << "no entry is left for another file";
  }
  const TestFolder folder;
  MemoryDisk disk;
  const auto never_synced = [](DiskCall call, std::size_t) { return call == DiskCall::kSync ? EIO : 0; };
  constexpr std::uint64_t kTicks = 100 * kTicksOf100Ms;
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {},
                         {.continues_after_errors = true, .create = disk.creator(never_synced)});
  EXPECT_EQ(record(writer, 0, kTicks), kTicks);
  EXPECT_TRUE(writer.is_over());
  EXPECT_EQ(disk.names.size(), 2u);
}

// Catches: a recording that takes the last of the disk from the system and the audit log, and ends torn; a
// recording that begins without room.
TEST(RecordingDisk, REC_03_ARecordingEndsWholeBeforeTheDiskIsFull) {
  const TestFolder folder;
  MemoryDisk disk;
  const RecordingOptions options{
      .continues_after_errors = true, .reserve_bytes = 8 << 20, .create = disk.creator()};
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {}, options);
  constexpr std::uint64_t kTicks = 20 * kTicksOf100Ms;
  EXPECT_EQ(record(writer, 0, kTicks), 0u);
  disk.free_bytes = (8 << 20) - 1;
  const std::uint64_t lost = record(writer, kTicks, 2 * kTicks);
  EXPECT_TRUE(writer.is_over());
  writer.finish({.ticks = 2 * kTicks});
  const Found found(contents_of(disk));
  EXPECT_TRUE(found.is_whole);
  EXPECT_FALSE(found.has_verdict);
  EXPECT_EQ(found.ticks.size() + lost, 2 * kTicks);
  EXPECT_EQ(disk.names.size(), 1u);
  try {
    const RecordingWriter another(folder / "other.mcap", servo_bench(), {}, options);
    FAIL() << "it began";
  } catch (const std::system_error& refused) {
    EXPECT_NE(std::string(refused.what()).find("less than 8 MiB are free"), std::string::npos);
  }
}

// Catches: a run that fills the disk between two looks at the clock; bytes counted anew with each file.
TEST(RecordingDisk, REC_03_AFreeRunEndsWholeTooInOneFileOrMany) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  for (const std::uint64_t file_bytes : {0u, 5u << 20}) {
    const TestFolder folder;
    MemoryDisk disk;
    disk.free_bytes = 40 << 20;
    RecordingWriter writer(folder / "run.mcap", config, {},
                           {.file_bytes = file_bytes, .reserve_bytes = 32 << 20, .create = disk.creator()});
    for (std::uint64_t tick = 0; !writer.is_over(); ++tick)
      writer.write(sample_at(tick));
    EXPECT_EQ(writer.take_lost(), 0u);
    EXPECT_TRUE(Found(contents_of(disk)).is_whole);
    EXPECT_GT(disk.free_bytes, (32u - 16u - 2u) << 20) << "16 MiB, a chunk and an index after the last look";
  }
}

// Catches: a recording that ends for want of room and begins another file because its end was refused.
TEST(RecordingDisk, REC_03_ARecordingThatEndsForWantOfRoomDoesNotBeginAgain) {
  for (const DiskCall bad : {DiskCall::kSync, DiskCall::kClose}) {
    const TestFolder folder;
    MemoryDisk disk;
    const auto at_the_end = [bad](DiskCall call, std::size_t n) {
      return call == bad && (call == DiskCall::kClose || n > 1) ? EIO : 0;
    };
    const RecordingOptions options{
        .continues_after_errors = true, .reserve_bytes = 8 << 20, .create = disk.creator(at_the_end)};
    RecordingWriter writer(folder / "run.mcap", servo_bench(), {}, options);
    disk.free_bytes = (8 << 20) - 1;
    constexpr std::uint64_t kTicks = 20 * kTicksOf100Ms;
    const std::uint64_t lost = record(writer, 0, kTicks);
    EXPECT_TRUE(writer.is_over() && disk.names.size() == 1);
    EXPECT_GT(Found(contents_of(disk)).ticks.size() + lost, kTicks) << "and the end that it has not";
  }
}

// ---- limits ----

// Catches: entries that stay in memory longer than 100 ms of plant time, or that are written one by one.
TEST(RecordingDisk, LIMIT_09_EntriesAreWrittenWithin100Milliseconds) {
  const TestFolder folder;
  MemoryDisk disk;
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {}, {.create = disk.creator()});
  const auto readable = [&disk] { return Found(contents_of(disk)).ticks.size(); };
  for (std::uint64_t tick = 0; tick < kTicksOf100Ms; ++tick)
    writer.write(sample_at(tick));
  const std::size_t in_front = disk.files.at("run.mcap").entries.size();
  EXPECT_LE(readable(), 1u) << "the sample of tick 0 may stand alone";
  writer.write(sample_at(kTicksOf100Ms));
  EXPECT_EQ(disk.files.at("run.mcap").entries.size(), in_front + 1) << "one write";
  EXPECT_EQ(readable(), kTicksOf100Ms);
}

// Catches: a disk that is never asked to sync, or with each write.
TEST(RecordingDisk, LIMIT_09_TheFileIsSyncedEverySecond) {
  const TestFolder folder;
  MemoryDisk disk;
  const Clock::time_point start = Clock::now();
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {}, {.create = disk.creator()});
  const auto syncs = [&disk] {
    const auto& entries = disk.files.at("run.mcap").entries;
    return std::count_if(entries.begin(), entries.end(),
                         [](const DiskEntry& e) { return e.call == DiskCall::kSync; });
  };
  writer.sync_if_due(start + std::chrono::milliseconds(999));
  EXPECT_EQ(syncs(), 0);
  const Clock::time_point second = start + std::chrono::milliseconds(2000);  // it began after `start`
  writer.sync_if_due(second);
  EXPECT_EQ(syncs(), 1);
  writer.sync_if_due(second + std::chrono::milliseconds(999));
  EXPECT_EQ(syncs(), 1);
  writer.sync_if_due(second + std::chrono::milliseconds(1000));
  EXPECT_EQ(syncs(), 2);
}

/// Feeds ticks with a command and a sample each.
void feed(Recorder& recorder, std::uint64_t from, std::uint64_t to) {
  for (std::uint64_t tick = from; tick < to; ++tick) {
    recorder.on_input(static_cast<Tick>(tick), {.tick = static_cast<Tick>(tick),
                                                .axis = 0,
                                                .owner = 1,
                                                .action = voltage(static_cast<Tick>(tick), 1.0, 1.0)});
    recorder.on_sample(0, {.tick = tick});
  }
}

// Catches: a queue that holds less than two seconds of a bench under command; a plant that waits for the
// disk; entries lost in silence. The disk stands still for five seconds of plant time.
TEST(RecordingDisk, REC_06_LIMIT_10_TwoSecondsOfAStallCostNothingAndTheRestIsCounted) {
  constexpr std::uint64_t kSecond = 8000;
  for (const std::uint64_t seconds : {2u, 5u}) {
    const TestFolder folder;
    StallingDisk disk;
    Recorder recorder(folder / "run.mcap", servo_bench(), {}, {.create = disk.creator()});
    disk.stall(true);
    feed(recorder, 0, kTicksOf100Ms + 1);  // so that it begins to write
    disk.wait_until_it_holds_a_writer();
    const std::uint64_t end = seconds * kSecond;
    feed(recorder, kTicksOf100Ms + 1, end);  // does not wait, or this test would not end
    const std::uint64_t gaps = recorder.gaps();
    if (seconds == 2) {
      EXPECT_EQ(gaps, 0u);
    } else {
      EXPECT_GT(gaps, 2 * 2 * kSecond);
      EXPECT_LE(gaps, 2 * 3 * kSecond);
    }
    disk.stall(false);
    recorder.finish({.ticks = end});
    EXPECT_EQ(recorder.gaps(), gaps) << "entries that came in time are in the file";
    const Found found(std::vector<Bytes>{content_of(folder / "run.mcap")});
    EXPECT_TRUE(found.is_whole);
    EXPECT_TRUE(seconds != 2 || found.begins_with(end));
    EXPECT_GE(2 * found.ticks.size() + gaps + 2 * 2048, 2 * end) << "commands and samples are lost alike";
  }
}

// Catches: a bench that is too fast, or has too many axes, for a queue of fixed size.
TEST(RecordingDisk, LIMIT_10_TheQueueHoldsTwoSecondsOfEveryBench) {
  for (const auto& entry : std::filesystem::directory_iterator(DRIVEBENCH_BENCHES)) {
    const BenchConfig config = load_config(entry.path().string());
    const double ticks = 2e9 / static_cast<double>(config.setup.period_ns);
    EXPECT_GE(static_cast<double>(recorder_queue_entries(config)),
              ticks * 2.0 * static_cast<double>(config.axes.size()))
        << entry.path();
  }
  BenchConfig large = servo_bench(64);
  large.setup.period_ns = 1000;
  EXPECT_LE(recorder_queue_entries(large) * sizeof(RecordedEntry), std::size_t{256} << 20);
}

}  // namespace
}  // namespace drivebench::recording_disk_test
