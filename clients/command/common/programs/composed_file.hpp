#pragma once

#include <filesystem>
#include <string>

/// The file of a bench that was composed from others, which the user never sees.
namespace drivebench::command {

/// Throws std::runtime_error.
void write_file(const std::filesystem::path& file, const std::string& bytes);

/// A sentence of the bench, with "the composed bench" in the place of the file.
std::string about_the_bench(std::string sentence, const std::filesystem::path& composed);

}  // namespace drivebench::command
