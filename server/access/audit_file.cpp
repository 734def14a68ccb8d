#include "server/access/audit_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace drivebench {
namespace {

/// Opens without blocking, so that a pipe without a reader is an error and does not hold the server up.
int open_at(const std::filesystem::path& path) {
  constexpr int kFlags = O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  const int file = ::open(path.c_str(), kFlags, S_IRUSR | S_IWUSR);
  const auto refuse = [&](const std::string& why) {
    if (file >= 0) ::close(file);
    throw std::runtime_error("the audit log " + path.string() + " cannot be used: " + why);
  };
  if (file < 0) refuse(std::generic_category().message(errno));
  struct stat status = {};
  if (::fstat(file, &status) != 0) refuse(std::generic_category().message(errno));
  if (!S_ISREG(status.st_mode)) refuse("it is not a regular file");
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) refuse("others may read or write it: chmod 600 it");
  return file;
}

}  // namespace

AuditFile::AuditFile(std::filesystem::path path) : path_(std::move(path)), file_(open_at(path_)) {}

AuditFile::~AuditFile() {
  ::close(file_);
}

bool AuditFile::append(std::string line) noexcept {
  line += '\n';
  const std::string_view text = line;
  if (torn_ && ::write(file_, "\n", 1) == 1) torn_ = false;
  if (torn_) return false;
  // A second call follows only a partial one: it writes the rest, or sets errno.
  for (std::string_view rest = text; !rest.empty();) {
    const ssize_t written = ::write(file_, rest.data(), rest.size());
    if (written <= 0) return false;
    rest.remove_prefix(static_cast<std::size_t>(written));
    torn_ = !rest.empty();
  }
  return true;
}

bool AuditFile::reopen() noexcept {
  try {
    const int file = open_at(path_);
    ::close(std::exchange(file_, file));
    torn_ = false;
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace drivebench
