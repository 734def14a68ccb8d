#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {

/// A MATLAB 7.3 file on its way to the disk. It is written by a module of its own, loaded when it is asked
/// for: the libraries behind it would double the time that every command takes to start.
class MatFile {
 public:
  /// A column vector.
  struct Column {
    std::string name;
    std::string unit;
    SignalType type;
    std::vector<std::uint64_t> words{};  ///< of rows that are not written yet
  };

  MatFile() = default;
  MatFile(const MatFile&) = delete;
  MatFile& operator=(const MatFile&) = delete;
  virtual ~MatFile() = default;

  // Each is false if the disk or the library refuses.

  /// The struct `units`: a text for each column.
  virtual bool write_units(std::span<const Column> columns) = 0;
  /// Appends the rows, and forgets them.
  virtual bool append(std::span<Column> columns) = 0;
  virtual bool close() = 0;
};

inline constexpr const char* kMatModule = "drivebench-mat.so";
inline constexpr const char* kMatSymbol = "drivebench_open_mat";
/// What the module has under that name: null if the file cannot be created.
using OpenMat = MatFile* (*)(const char* file);

}  // namespace drivebench::command
