#pragma once

#include <filesystem>
#include <optional>

#include "clients/regression/checks/check_kinds.hpp"
#include "clients/regression/tables/key_table.hpp"

namespace drivebench::regression {

/// Reads a `[[check]]`; nothing if it has a problem, which is then in the list of the table. Files are
/// relative to `folder`.
std::optional<CheckSpec> read_check(KeyTable& table, const std::filesystem::path& folder);

/// Reads a condition; a wrong one is a problem of the key.
std::optional<CaseCondition> read_condition(KeyTable& table, std::string_view key);

}  // namespace drivebench::regression
