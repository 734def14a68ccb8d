#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "clients/identification/data/measured_data.hpp"

/// Maps the columns of any CSV file to signals of the catalogue.
namespace drivebench::command {

struct IdentifyOptions;

/// `HEADER=SIGNAL`, `HEADER=SIGNAL*FACTOR`, `HEADER=SIGNAL*FACTOR+OFFSET`. Throws UsageError with the rule.
identification::ColumnMap parse_column(std::string_view text);

/// A column-map file: `time`, `time_factor` or `period_s`, and [columns] with SIGNAL = "HEADER" or
/// SIGNAL = { header = "HEADER", factor = 1e-3, offset = 0.0 }. Throws ConfigError with all problems.
identification::CsvOptions parse_column_map(std::string_view text, const std::string& file);

/// The CSV options of the command line. Each --map is a column, or the name of a column-map file. Throws
/// UsageError.
identification::CsvOptions csv_options(const IdentifyOptions& options);

}  // namespace drivebench::command
