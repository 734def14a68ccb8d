#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/mcap/mapped_file.hpp"
#include "protocols/mcap/mcap.hpp"

/// Recordings in several files: FILE.mcap, then FILE.2.mcap, FILE.3.mcap ... Each is a complete MCAP file
/// with the same channels; from the second on a metadata record holds the number of the file.
namespace drivebench {

inline constexpr std::string_view kSegmentMetadata = "drivebench.segment";
inline constexpr std::string_view kSegmentNumber = "number";  ///< a key of it

/// The name of the n-th file of a series, from 1 on.
std::string segment_path(const std::string& first, std::size_t number);

/// Reads the files of a series as one recording. After a file that ends early it goes on with the next file,
/// and problem() reports the first such place.
class McapSeries {
 public:
  explicit McapSeries(std::vector<std::span<const std::byte>> segments);

  bool next(McapMessage& message);

  /// The reader of the file that the last message came from, or in which reading stopped.
  const McapReader& reader() const noexcept { return *reader_; }
  /// The number of the first file in its series: 1 unless files before it are missing.
  std::size_t first_number() const noexcept { return first_number_; }
  /// The first problem found.
  const std::optional<McapProblem>& problem() const noexcept { return problem_; }

 private:
  void open(std::size_t index);
  bool check();
  void note(const std::optional<McapProblem>& problem);

  std::vector<std::span<const std::byte>> segments_;
  std::size_t index_ = 0;
  std::size_t first_number_ = 1;
  std::unique_ptr<McapReader> reader_;
  std::optional<McapProblem> problem_;
  bool is_checked_ = true;  ///< the number of the current file agrees with its place in the series
};

/// A file and all later files of its series, mapped.
class MappedSeries {
 public:
  /// Throws std::system_error that names the path.
  explicit MappedSeries(const std::string& first);

  const std::vector<std::span<const std::byte>>& segments() const noexcept { return segments_; }
  std::uint64_t size() const noexcept;

 private:
  std::vector<std::unique_ptr<MappedFile>> files_;
  std::vector<std::span<const std::byte>> segments_;
};

}  // namespace drivebench
