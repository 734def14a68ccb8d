#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/recording/recording_file.hpp"
#include "tests/adversity/simulator/world/random.hpp"

namespace drivebench::simulator {

/// A disk in memory that may fill, write only a part, and refuse, and on which other programs are at work.
class FakeDisk {
 public:
  struct Faults {
    std::uint64_t capacity = ~std::uint64_t{0};  ///< bytes of all files
    double short_write = 0.0;                    ///< chance of a call: only some of the bytes are written
    double write_error = 0.0;
    double sync_error = 0.0;
    double meddling = 0.0;  ///< chance of a call of meddle()
  };

  FakeDisk(Random random, const Faults& faults) : random_(random), faults_(faults) {}

  /// For RecordingOptions::create; the disk must outlive its files.
  CreateRecordingFile creator();
  /// Now and then another program moves, removes or empties the file that is being written.
  void meddle();
  /// Whether it has refused anything or lost a file.
  bool failed() const noexcept { return failed_ || lost_a_file_; }
  /// Whether another program has removed or emptied a file.
  bool lost_a_file() const noexcept { return lost_a_file_; }
  /// In the order of their creation, without those that were removed or emptied.
  std::vector<std::span<const std::byte>> files() const;

 private:
  class File;
  struct Content {
    std::vector<std::byte> bytes{};
    std::string path;
    FileFate fate{};           ///< that the writer has not seen yet
    bool is_given_up = false;  ///< closed, or refused: the writer looks at it no more
    bool is_lost = false;
  };

  Random random_;
  Faults faults_;
  std::uint64_t used_ = 0;
  bool failed_ = false;
  bool lost_a_file_ = false;
  std::vector<std::shared_ptr<Content>> files_;
};

}  // namespace drivebench::simulator
