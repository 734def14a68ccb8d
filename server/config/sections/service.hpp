#pragma once

#include <filesystem>

#include "server/config/config.hpp"
#include "server/config/strict_table.hpp"

/// Reads the sections about access to the server and its logs.
namespace drivebench {

void read_tcp(StrictTable table, const std::filesystem::path& folder, TcpConfig& tcp);
void read_tls(StrictTable table, const std::filesystem::path& folder, TlsConfig& tls);
void read_audit(StrictTable table, const std::filesystem::path& folder, AuditConfig& audit);
LogLevel read_log_level(StrictTable table);

}  // namespace drivebench
