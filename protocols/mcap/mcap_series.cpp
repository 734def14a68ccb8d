#include "protocols/mcap/mcap_series.hpp"

#include <charconv>
#include <filesystem>
#include <utility>

namespace drivebench {
namespace {

/// The number of this file in its series, from its metadata; 1 without such metadata.
std::size_t number_of(const McapReader& reader) {
  for (const McapMetadata& metadata : reader.metadata()) {
    const auto number = metadata.entries.find(kSegmentNumber);
    if (metadata.name != kSegmentMetadata || number == metadata.entries.end()) continue;
    std::size_t value = 0;
    std::from_chars(number->second.data(), number->second.data() + number->second.size(), value);
    return value;
  }
  return 1;
}

}  // namespace

std::string segment_path(const std::string& first, std::size_t number) {
  if (number <= 1) return first;
  const std::filesystem::path path(first);
  std::filesystem::path name = path.stem();
  name += "." + std::to_string(number);
  name += path.extension();
  return (path.parent_path() / name).string();
}

McapSeries::McapSeries(std::vector<std::span<const std::byte>> segments) : segments_(std::move(segments)) {
  if (segments_.empty()) segments_.emplace_back();
  open(0);
}

void McapSeries::open(std::size_t index) {
  index_ = index;
  reader_ = std::make_unique<McapReader>(segments_[index]);
  is_checked_ = false;
  if (index == 0 && reader_->problem()) note(reader_->problem());
}

void McapSeries::note(const std::optional<McapProblem>& problem) {
  if (!problem_) problem_ = problem;
}

bool McapSeries::check() {
  is_checked_ = true;
  const std::size_t number = number_of(*reader_);
  if (index_ == 0) first_number_ = number;
  const std::size_t expected = first_number_ + index_;
  if (number == expected) return true;
  note(McapProblem{.kind = McapProblem::Kind::kDamaged,
                   .offset = 0,
                   .what = "where file " + std::to_string(expected) +
                           " of the recording should be is one that " + "says it is number " +
                           std::to_string(number)});
  return false;
}

bool McapSeries::next(McapMessage& message) {
  for (;;) {
    const bool got = reader_->next(message);
    if (!is_checked_ && (got || !reader_->problem()) && !check()) {
      index_ = segments_.size();
      reader_ = std::make_unique<McapReader>(std::span<const std::byte>());
      return false;
    }
    if (got) return true;
    note(reader_->problem());
    if (index_ + 1 >= segments_.size()) return false;
    open(index_ + 1);
  }
}

MappedSeries::MappedSeries(const std::string& first) {
  for (std::size_t number = 1; number == 1 || std::filesystem::exists(segment_path(first, number));
       ++number) {
    files_.push_back(std::make_unique<MappedFile>(segment_path(first, number)));
    segments_.push_back(files_.back()->bytes());
  }
}

std::uint64_t MappedSeries::size() const noexcept {
  std::uint64_t size = 0;
  for (const std::span<const std::byte> segment : segments_)
    size += segment.size();
  return size;
}

}  // namespace drivebench
