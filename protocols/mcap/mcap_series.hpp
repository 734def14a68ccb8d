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

/// Recordings in several files: FILE.mcap, then FILE.2.mcap, FILE.3.mcap ... Each is an MCAP file of its own
/// with the same channels; from the second on a metadata record says which one it is.
namespace drivebench {

inline constexpr std::string_view kSegmentMetadata = "drivebench.segment";
inline constexpr std::string_view kSegmentNumber = "number";  ///< a key of it

/// The name of the n-th file of a series, from 1 on.
std::string segment_path(const std::string& first, std::size_t number);

/// Reads the files of a series as if they were one. A file that ends early does not hide those behind it, but
/// is told.
class McapSeries {
 public:
  explicit McapSeries(std::vector<std::span<const std::byte>> segments);

  bool next(McapMessage& message);

  /// Of the file that the last message came from, or in which reading stopped.
  const McapReader& reader() const noexcept { return *reader_; }
  /// Which file of its series the first one is: 1, if nothing is missing in front.
  std::size_t first_number() const noexcept { return first_number_; }
  /// The first one that was met.
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
  bool is_checked_ = true;  ///< that the present file is the one that its place in the series says
};

/// A file and all that follow it, mapped.
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
