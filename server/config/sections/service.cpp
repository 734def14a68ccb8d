#include "server/config/sections/service.hpp"

#include <system_error>

#include "server/config/words.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxUnixPath = 107;  // sockaddr_un
constexpr std::size_t kMaxPath = 800;

/// Reads the name of a file, relative to the folder; without a folder a name is a problem.
std::filesystem::path read_path(StrictTable& table, std::string_view key,
                                const std::filesystem::path& folder) {
  const auto name = table.text(key, kMaxPath);
  if (!name) return {};
  if (!folder.empty()) return (folder / *name).lexically_normal();
  table.report(key, std::string(kNoOtherFiles));
  return {};
}

std::vector<Grant> read_grants(StrictTable& tcp, const std::filesystem::path& folder) {
  const std::filesystem::path file = read_path(tcp, "tokens_file", folder);
  if (file.empty()) return {};
  try {
    return load_grants(file);
  } catch (const ConfigError& error) {
    for (const ConfigProblem& problem : error.problems()) {
      const std::string line = problem.line == 0 ? "" : " in line " + std::to_string(problem.line);
      tcp.report("tokens_file", "names " + file.string() + ", where" + line + " " +
                                    (problem.key.empty() ? "the file" : problem.key) + " " + problem.rule);
    }
  }
  return {};
}

}  // namespace

void read_tcp(StrictTable table, const std::filesystem::path& folder, TcpConfig& tcp) {
  tcp.address = table.address("address").value_or(tcp.address);
  tcp.asks_for_token = table.has("tokens_file");
  if (!is_loopback(tcp.address) && !tcp.asks_for_token) {
    table.report("address", "is " + tcp.address + ", which other computers can reach: name a tokens_file");
  }
  tcp.port = static_cast<std::uint16_t>(table.integer("port", 0, 65535).value_or(tcp.port));
  tcp.unix_path = table.text("unix_path", kMaxUnixPath).value_or("");
  tcp.grants = read_grants(table, folder);
  tcp.max_sessions =
      static_cast<std::uint32_t>(table.integer("max_sessions", 1, 10'000).value_or(tcp.max_sessions));
  if (const auto most = table.integer("max_sessions_of_address", 1, 10'000)) {
    tcp.max_sessions_of_address = static_cast<std::uint32_t>(*most);
  }
  table.finish();
}

void read_tls(StrictTable table, const std::filesystem::path& folder, TlsConfig& tls) {
  if (table.exists()) {
    table.require("certificate");
    table.require("key");
  }
  tls.certificate = read_path(table, "certificate", folder);
  tls.key = read_path(table, "key", folder);
  tls.client_ca = read_path(table, "client_ca", folder);
  tls.client_crl = read_path(table, "client_crl", folder);
  if (!tls.key.empty()) {
    std::error_code error;
    const auto permissions = std::filesystem::status(tls.key, error).permissions();
    constexpr auto kOthers = std::filesystem::perms::group_all | std::filesystem::perms::others_all;
    if (error) {
      table.report("key", "names " + tls.key.string() + ", which cannot be used: " + error.message());
    } else if ((permissions & kOthers) != std::filesystem::perms::none) {
      table.report("key", "names " + tls.key.string() + ", which others may read: chmod 600 it");
    }
  }
  if (!tls.client_crl.empty() && tls.client_ca.empty()) {
    table.report("client_crl", "cannot stand without client_ca");
  }
  table.finish();
}

void read_audit(StrictTable table, const std::filesystem::path& folder, AuditConfig& audit) {
  if (table.exists()) table.require("file");
  audit.file = read_path(table, "file", folder);
  const auto on_failure = table.choice("on_failure", kAuditFailureWords);
  audit.on_failure =
      static_cast<AuditFailure>(on_failure.value_or(static_cast<std::size_t>(audit.on_failure)));
  table.finish();
}

LogLevel read_log_level(StrictTable table) {
  const auto level = table.choice("level", kLogLevelWords);
  table.finish();
  return static_cast<LogLevel>(level.value_or(static_cast<std::size_t>(LogLevel::kInfo)));
}

}  // namespace drivebench
