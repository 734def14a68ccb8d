#pragma once

#include <filesystem>
#include <string>

#include "clients/regression/suite/case.hpp"
#include "clients/regression/verdicts/result.hpp"

/// A bundle: a ZIP file with everything that a case needs to run again.
///
///     bundle.toml        format, the program that wrote it, the name of the case, its verdict and the hash
///     bench.toml         the composed bench without the bus of its case; curves/ has its CSV files
///     case/case.toml     the case with the values of its matrix and draws; beside it the files of its device
///                        under test and its golden runs
///     run.mcap           the recording: inputs, commands and samples
///     output.txt         what the device under test printed, its end
///     messages.txt       what it was told, if anything
namespace drivebench::command {

/// The file of the case in a folder of bundles.
std::filesystem::path bundle_of(const std::filesystem::path& folder, const std::string& name);

/// What goes into a bundle.
struct BundleContent {
  const regression::Case& what;
  const regression::CaseResult& result;
  std::filesystem::path bench_file;  ///< composed
  std::filesystem::path recording;   ///< none if the file is not there
  std::string program;               ///< version and build
};

/// Throws std::runtime_error and what archive::write_zip() throws.
void write_bundle(const std::filesystem::path& file, const BundleContent& content);

/// A bundle in a folder.
struct Unpacked {
  regression::Case what;
  std::filesystem::path bench_file;  ///< composed, without the bus of the case
  std::filesystem::path recording;
  std::string program;  ///< that wrote it
};

/// Unpacks a bundle, which may come from anywhere, into an empty folder, and nowhere else. Throws UsageError
/// with file, entry and rule, or ConfigError.
Unpacked unpack_bundle(const std::filesystem::path& file, const std::filesystem::path& folder);

}  // namespace drivebench::command
