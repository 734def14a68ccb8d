#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "clients/regression/suite/case.hpp"

namespace drivebench::regression {

/// Tells whether a result is still that of its case: equal fingerprints mean the same drivebench, case file,
/// bench with its motors and curves, golden runs, and files of the device under test in the folder of the
/// case. What lies elsewhere, an interpreter for example, is not looked at.
class Fingerprints {
 public:
  /// `program`: name, version and build of what runs the cases.
  explicit Fingerprints(std::string program) : program_(std::move(program)) {}

  /// Sixteen hexadecimal digits. `bench_file`: the one that the case names.
  std::string of(const Case& c, const std::filesystem::path& bench_file);

 private:
  std::uint64_t bench(const std::filesystem::path& file);
  std::uint64_t content(const std::filesystem::path& file);

  std::string program_;
  std::map<std::filesystem::path, std::uint64_t> benches_{};
  std::map<std::filesystem::path, std::uint64_t> contents_{};
};

/// A hash of a text that is the same on every machine (FNV-1a).
std::uint64_t text_hash(std::string_view text) noexcept;

}  // namespace drivebench::regression
