#pragma once

#include <filesystem>
#include <vector>

#include "clients/archive/zip_writer.hpp"

namespace drivebench::fmu {

/// The files of a bench that needs no others: bench.toml, with its motor files in it, and the CSV files of
/// its curves, by names without folders. Throws ConfigError.
std::vector<archive::Entry> resources_of(const std::filesystem::path& bench_file);

}  // namespace drivebench::fmu
