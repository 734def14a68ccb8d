// Other programs change the files of a recording while it is written.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cerrno>
#include <fstream>
#include <functional>
#include <memory>

#include "protocols/mcap/mcap_series.hpp"
#include "protocols/sample_codec.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/recording_writer.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::recording_file_test {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kTicksPerSecond = 8000;

/// Ten seconds of a recording with a sample for each tick. After each of the steps the other program acts.
class WatchedRecording {
 public:
  explicit WatchedRecording(const std::function<void(const fs::path&)>& act, std::uint64_t act_at_tick) {
    RecordingWriter writer(file(), servo_bench(), {}, {.continues_after_errors = true});
    const auto start = RecordingWriter::Clock::now();
    for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
      if (tick == act_at_tick) act(file());
      writer.write(TickedSample(0, {.tick = tick}));
      if (tick % 8 == 0) writer.sync_if_due(start + std::chrono::microseconds(125) * tick);
    }
    if (act_at_tick >= kTicks) act(file());
    writer.finish({.ticks = kTicks});
    lost = writer.take_lost();
    name = writer.file();
    remarks = writer.remarks();
  }

  fs::path file() const { return folder_ / "run.mcap"; }
  fs::path beside(const char* other) const { return folder_ / other; }
  /// The samples that can be read in the file; nothing if it is not whole.
  static std::uint64_t samples_in(const fs::path& file) {
    const std::vector<std::byte> bytes = content_of(file);
    McapReader reader(bytes);
    std::uint64_t samples = 0;
    for (McapMessage message; reader.next(message);)
      samples += decode_sample(message.payload) ? 1u : 0u;
    return reader.problem() ? 0 : samples;
  }

  static constexpr std::uint64_t kTicks = 10 * kTicksPerSecond;
  std::uint64_t lost = 0;
  std::string name;
  std::string remarks;

 private:
  TestFolder folder_;
};

bool says(const std::string& text, const std::string& fact) {
  return text.find(fact) != std::string::npos;
}

// Catches: a recording that is gone and counts as written; its rest that is lost as well; losses that are not
// counted to the entry.
TEST(RecordingFiles, REC_13_ARemovedFileIsLostAndTheRestGoesIntoTheNextOne) {
  const WatchedRecording run([](const fs::path& file) { fs::remove(file); }, 3 * kTicksPerSecond);
  EXPECT_FALSE(fs::exists(run.file()));
  EXPECT_EQ(run.name, run.beside("run.2.mcap"));
  EXPECT_TRUE(says(run.remarks, "run.mcap: another program removed it, it goes on in a new file"))
      << run.remarks;
  const std::uint64_t kept = WatchedRecording::samples_in(run.beside("run.2.mcap"));
  EXPECT_EQ(run.lost + kept, WatchedRecording::kTicks);
  EXPECT_GE(run.lost, 3 * kTicksPerSecond);
  EXPECT_LE(run.lost, 4 * kTicksPerSecond + 8) << "noticed within a second";
}

// Catches: an emptied file that grows again behind a hole, and counts as whole; a file with foreign bytes.
TEST(RecordingFiles, REC_13_AnEmptiedOrLengthenedFileIsLost) {
  const std::function<void(const fs::path&)> acts[] = {
      [](const fs::path& file) { fs::resize_file(file, 0); },
      [](const fs::path& file) { fs::resize_file(file, fs::file_size(file) - 1); },
      [](const fs::path& file) { std::ofstream(file, std::ios::app) << "x"; }};
  for (const auto& act : acts) {
    const WatchedRecording run(act, 3 * kTicksPerSecond);
    EXPECT_EQ(run.name, run.beside("run.2.mcap"));
    EXPECT_TRUE(says(run.remarks, "run.mcap: another program emptied or changed it")) << run.remarks;
    EXPECT_EQ(run.lost + WatchedRecording::samples_in(run.beside("run.2.mcap")), WatchedRecording::kTicks);
  }
}

// Catches: a check that is made once a second only, and not at the end.
TEST(RecordingFiles, REC_13_AFileThatIsRemovedAtTheVeryEndIsLost) {
  const WatchedRecording run([](const fs::path& file) { fs::remove(file); }, WatchedRecording::kTicks);
  EXPECT_EQ(run.lost, WatchedRecording::kTicks + 1) << "with the verdict";
  EXPECT_EQ(run.name, "");
  EXPECT_TRUE(says(run.remarks, "another program removed it, it ends here")) << run.remarks;
}

/// A real file whose writes fail as soon as it has no name.
class BrittleFile final : public RecordingFile {
 public:
  explicit BrittleFile(const fs::path& path) : path_(path), file_(create_recording_file(path)) {}
  ssize_t write(std::span<const std::byte> bytes) noexcept override {
    if (fs::exists(path_)) return file_->write(bytes);
    errno = EIO;
    return -1;
  }
  int truncate(std::uint64_t size) noexcept override { return file_->truncate(size); }
  int sync() noexcept override { return file_->sync(); }
  int close() noexcept override { return file_->close(); }
  FileFate fate(const std::string& path, std::uint64_t size) override { return file_->fate(path, size); }

 private:
  fs::path path_;
  std::unique_ptr<RecordingFile> file_;
};

// Catches: a removed file that the disk refuses before anybody looks at it, of which only the refused bytes
// count as lost.
TEST(RecordingFiles, REC_13_ARemovedFileThatCannotBeWrittenIsLostWhole) {
  const TestFolder folder;
  const CreateRecordingFile brittle = [](const fs::path& path) {
    return std::make_unique<BrittleFile>(path);
  };
  RecordingWriter writer(folder / "run.mcap", servo_bench(), {},
                         {.continues_after_errors = true, .create = brittle});
  const auto start = RecordingWriter::Clock::now();
  constexpr std::uint64_t kTicks = 4 * kTicksPerSecond;
  constexpr std::uint64_t kRemoved = 3 * kTicksPerSecond + 400;  // long before the next look
  for (std::uint64_t tick = 0; tick < kTicks; ++tick) {
    if (tick == kRemoved) fs::remove(folder / "run.mcap");
    writer.write(TickedSample(0, {.tick = tick}));
    if (tick % 8 == 0) writer.sync_if_due(start + std::chrono::microseconds(125) * tick);
  }
  writer.finish({.ticks = kTicks});
  EXPECT_EQ(writer.take_lost() + WatchedRecording::samples_in(folder / "run.2.mcap"), kTicks);
}

// Catches: a file that is taken for the recording because it has its name.
TEST(RecordingFiles, REC_13_AFileThatAnotherOneReplacesIsLost) {
  const auto replace = [](const fs::path& file) {
    const fs::path other = file.parent_path() / "other";
    fs::copy_file(file, other);
    fs::rename(other, file);
  };
  const WatchedRecording run(replace, 3 * kTicksPerSecond);
  EXPECT_EQ(run.name, run.beside("run.2.mcap"));
  EXPECT_GE(run.lost, 3 * kTicksPerSecond);
}

// Catches: a moved file that counts as lost, that is reported under its old name, or that is reported each
// second.
TEST(RecordingFiles, REC_13_AMovedFileIsReportedUnderItsNewName) {
  const auto move = [](const fs::path& file) { fs::rename(file, file.parent_path() / "kept.mcap"); };
  for (const std::uint64_t at : {3 * kTicksPerSecond, WatchedRecording::kTicks}) {
    const WatchedRecording run(move, at);
    EXPECT_EQ(run.lost, 0u);
    EXPECT_EQ(run.name, run.beside("kept.mcap"));
    EXPECT_EQ(WatchedRecording::samples_in(run.beside("kept.mcap")), WatchedRecording::kTicks);
    EXPECT_EQ(run.remarks,
              run.file().string() + ": another program moved it to " + run.beside("kept.mcap").string());
  }
}

// Catches: a recording that other users of the computer can read.
TEST(RecordingFiles, SEC_10_OnlyTheServersUserReadsARecording) {
  const TestFolder folder;
  const mode_t before = ::umask(0);
  const Recorder recorder(folder / "run.mcap", servo_bench());
  ::umask(before);
  EXPECT_EQ(fs::status(folder / "run.mcap").permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

// Catches: a file that lost one of two names, and is looked for under it each second.
TEST(RecordingFiles, REC_13_AFileUnderAnUnknownNameIsKept) {
  const auto relink = [](const fs::path& file) {
    fs::create_hard_link(file, file.parent_path() / "second.mcap");
    fs::remove(file);
  };
  const WatchedRecording run(relink, 3 * kTicksPerSecond);
  EXPECT_EQ(run.lost, 0u);
  EXPECT_EQ(run.remarks, run.file().string() + ": another program moved it");
  EXPECT_EQ(WatchedRecording::samples_in(run.beside("second.mcap")), WatchedRecording::kTicks);
}

// Catches: a recorder that never ends because the folder is gone too.
TEST(RecordingFiles, REC_13_AFolderThatIsRemovedEndsTheRecording) {
  const WatchedRecording run([](const fs::path& file) { fs::remove_all(file.parent_path()); },
                             3 * kTicksPerSecond);
  EXPECT_EQ(run.lost, WatchedRecording::kTicks + 1);
  EXPECT_EQ(run.name, "");
  EXPECT_TRUE(says(run.remarks, "run.2.mcap: open: No such file or directory, it ends here")) << run.remarks;
}

}  // namespace
}  // namespace drivebench::recording_file_test
