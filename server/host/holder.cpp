#include "server/host/holder.hpp"

#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

namespace drivebench {
namespace {

namespace fs = std::filesystem;

/// The first process with a descriptor for which `is_it` is true. Only root sees the descriptors of other
/// users.
std::string process_with(const std::function<bool(const std::string& target)>& is_it) {
  std::error_code error;
  for (const fs::directory_entry& process : fs::directory_iterator("/proc", error)) {
    const std::string number = process.path().filename().string();
    if (number.find_first_not_of("0123456789") != std::string::npos) continue;
    std::error_code hidden;
    for (const fs::directory_entry& descriptor : fs::directory_iterator(process.path() / "fd", hidden)) {
      const fs::path target = fs::read_symlink(descriptor.path(), hidden);
      if (hidden || !is_it(target.string())) continue;
      std::string name;
      std::getline(std::ifstream(process.path() / "comm"), name);
      return " (process " + number + ", " + name + ")";
    }
  }
  return {};
}

/// The inode of the socket that listens on the port; empty if none does.
std::string listener_on(std::uint16_t port) {
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream in(table);
    std::string line;
    std::getline(in, line);  // headings
    while (std::getline(in, line)) {
      std::istringstream words(line);
      std::string number, local, remote, state, queues, timer, retransmits, user, timeout, inode;
      words >> number >> local >> remote >> state >> queues >> timer >> retransmits >> user >> timeout >>
          inode;
      const std::size_t colon = local.rfind(':');
      constexpr const char* kListens = "0A";
      if (state != kListens || colon == std::string::npos) continue;
      if (std::stoul(local.substr(colon + 1), nullptr, 16) == port) return inode;
    }
  }
  return {};
}

}  // namespace

std::string holder_of_port(std::uint16_t port) {
  const std::string inode = listener_on(port);
  if (inode.empty()) return {};
  return process_with(
      [wanted = "socket:[" + inode + "]"](const std::string& target) { return target == wanted; });
}

std::string holder_of_file(const std::string& path) {
  std::error_code error;
  const std::string wanted = fs::canonical(path, error).string();
  if (error) return {};
  return process_with([&wanted](const std::string& target) { return target == wanted; });
}

}  // namespace drivebench
