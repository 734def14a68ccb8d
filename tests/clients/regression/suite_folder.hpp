#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "clients/regression/suite/case_file.hpp"

namespace drivebench::regression {

/// A folder with files, removed at the end.
class Suite : public testing::Test {
 protected:
  Suite() { std::filesystem::create_directories(folder_); }
  ~Suite() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path file(const std::string& name, const std::string& text) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string problems_with(const std::string& text) {
    file("case.toml", text);
    try {
      read_suite(folder_);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "none";
  }
  Case the_case(const std::string& text) { return read_suite(file("case.toml", text)).front(); }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("drivebench-suite-" + std::to_string(::getpid()));
};

}  // namespace drivebench::regression
