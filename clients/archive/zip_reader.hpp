#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "clients/archive/zip_writer.hpp"

namespace drivebench::archive {

/// How much a ZIP file may hold.
struct ZipLimits {
  std::size_t entries = 1000;
  std::uint64_t bytes = std::uint64_t{1} << 30U;  ///< of all entries, unpacked
};

/// The entries of a ZIP file in their order. The file may come from anywhere: every name is a relative path
/// that stays below its folder and stands there once, and no more is unpacked than the limits allow. Throws
/// ZipError with file, entry and rule.
std::vector<Entry> read_zip(const std::filesystem::path& file, const ZipLimits& limits = {});

}  // namespace drivebench::archive
