#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "protocols/mcap/mcap.hpp"

/// Part of mcap_reader.cpp: takes fields out of untrusted bytes.
namespace drivebench::mcap {

inline std::string_view as_text(std::span<const std::byte> bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Takes fields off the front of a record's content. Past the end it returns zeros and empty views, and ok()
/// becomes false: a reader takes all fields of a record and checks ok() once.
class Fields {
 public:
  explicit Fields(std::span<const std::byte> bytes) noexcept : left_(bytes) {}

  template <std::unsigned_integral T>
  T integer() noexcept {
    const auto taken = bytes(sizeof(T));
    return taken.empty() ? T{0} : mcap::load<T>(taken.data());
  }

  std::span<const std::byte> bytes(std::uint64_t size) noexcept {
    if (size > left_.size()) {
      is_ok_ = false;
      left_ = {};
      return {};
    }
    const auto taken = left_.first(size);
    left_ = left_.subspan(size);
    return taken;
  }

  std::string_view string() noexcept { return as_text(bytes(integer<std::uint32_t>())); }

  McapMapView map() {
    Fields entries(bytes(integer<std::uint32_t>()));
    McapMapView result;
    while (!entries.left_.empty() && entries.is_ok_) {
      const std::string_view key = entries.string();
      const std::string_view value = entries.string();
      if (entries.is_ok_ && !result.emplace(key, value).second) entries.is_ok_ = false;  // the key came twice
    }
    if (!entries.is_ok_) is_ok_ = false;
    return result;
  }

  bool ok() const noexcept { return is_ok_; }
  std::span<const std::byte> left() const noexcept { return left_; }

 private:
  std::span<const std::byte> left_;
  bool is_ok_ = true;
};

}  // namespace drivebench::mcap
