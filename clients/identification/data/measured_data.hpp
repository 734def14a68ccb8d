#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "clients/identification/math/series.hpp"

namespace drivebench::identification {

/// One measured signal.
struct Column {
  std::string name;  ///< from the signal catalogue: i_a_a, u_a_v, encoder_count, ...
  std::string unit;  ///< SI; empty if unknown
  Series values;
};

/// A measurement: equidistant samples, all columns of one length.
struct MeasuredData {
  double period_s = 0.0;
  std::vector<Column> columns;

  std::size_t samples() const noexcept { return columns.empty() ? 0 : columns[0].values.size(); }
  /// The column of this name, or null.
  const Column* find(std::string_view name) const noexcept;
  /// The column of this name; otherwise throws IdentificationError with the names of all columns.
  SeriesView at(std::string_view name) const;
};

/// A column of a foreign file.
struct ColumnMap {
  std::string name;     ///< the signal's name in the catalogue
  std::string header;   ///< the column's header in the file, with or without its "[unit]"
  double factor = 1.0;  ///< SI value = factor x number in the file + offset
  double offset = 0.0;
};

struct CsvOptions {
  /// Columns to take; empty: all, under their own names.
  std::vector<ColumnMap> columns{};
  /// The time between two rows. 0: from the column of the name or header `time`, whose steps must be equal to
  /// 1 %.
  double period_s = 0.0;
  std::string time = "time_s";
  double time_factor = 1.0;  ///< seconds per unit of the time column
};

/// Reads comma- or semicolon-separated numbers under a header line; "name [unit]" is split. The text comes
/// from `drivebench export` or a real motor. Throws IdentificationError, "source:line: column: rule", at the
/// first wrong line; `source` names the text in messages.
MeasuredData parse_csv(std::string_view text, const std::string& source, const CsvOptions& options = {});

/// Reads such a file of at most 2 GiB.
MeasuredData read_csv(const std::filesystem::path& file, const CsvOptions& options = {});

}  // namespace drivebench::identification
