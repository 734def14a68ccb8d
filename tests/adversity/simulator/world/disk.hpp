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

/// A disk in memory that may fill, write only a part, and refuse.
class FakeDisk {
 public:
  struct Faults {
    std::uint64_t capacity = ~std::uint64_t{0};  ///< bytes of all files
    double short_write = 0.0;                    ///< chance of a call: only some of the bytes are written
    double write_error = 0.0;
    double sync_error = 0.0;
  };

  FakeDisk(Random random, const Faults& faults) : random_(random), faults_(faults) {}

  /// For RecordingOptions::create; the disk must outlive its files.
  CreateRecordingFile creator();
  /// Whether it has refused anything.
  bool failed() const noexcept { return failed_; }
  /// In the order of their creation.
  std::vector<std::span<const std::byte>> files() const;

 private:
  class File;
  using Bytes = std::vector<std::byte>;

  Random random_;
  Faults faults_;
  std::uint64_t used_ = 0;
  bool failed_ = false;
  std::vector<std::shared_ptr<Bytes>> files_;
};

}  // namespace drivebench::simulator
