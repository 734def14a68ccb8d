#include "clients/archive/zip_reader.hpp"

#include <set>

#include "clients/archive/zip_handle.hpp"
#include "protocols/text.hpp"

namespace drivebench::archive {
namespace {

constexpr std::size_t kLongestName = 1000;

struct Close {
  void operator()(zip_file_t* entry) const noexcept { zip_fclose(entry); }
};
using OpenEntry = std::unique_ptr<zip_file_t, Close>;

/// The rule that the name breaks; empty: none.
std::string name_problem(const std::string& name) {
  if (name.empty() || name.size() > kLongestName) return "a name has 1 to 1000 bytes";
  for (const char c : name) {
    if (static_cast<unsigned char>(c) < 0x20 || c == '\\' || c == ':' || c == 0x7f)
      return "a name has no control character, no \\ and no :";
  }
  for (const std::filesystem::path& part : std::filesystem::path(name)) {
    if (part == "/" || part == ".." || part == "." || part.empty())
      return "a name is the relative path of a file, without . and .. in it";
  }
  return {};
}

/// Reads one file and adds up what it unpacks.
class Reader {
 public:
  Reader(const std::filesystem::path& file, const ZipLimits& limits)
      : file_(file), limits_(limits), zip_(opened(file, ZIP_RDONLY | ZIP_CHECKCONS, "read")) {}

  std::vector<Entry> entries() {
    const auto count = static_cast<std::uint64_t>(zip_get_num_entries(zip_.get(), 0));
    if (count > limits_.entries) {
      throw ZipError(file_.string() + ": has " + std::to_string(count) + " entries but may have at most " +
                     std::to_string(limits_.entries));
    }
    std::vector<Entry> entries;
    entries.reserve(count);
    for (std::uint64_t index = 0; index < count; ++index)
      entries.push_back(read(index));
    return entries;
  }

 private:
  [[noreturn]] void refuse(const std::string& name, const std::string& rule) const {
    throw ZipError(file_.string() + ": entry \"" + printable(name) + "\": " + rule);
  }

  Entry read(std::uint64_t index) {
    zip_stat_t facts;
    if (zip_stat_index(zip_.get(), index, ZIP_FL_ENC_GUESS, &facts) != 0) {
      refuse(std::to_string(index), zip_strerror(zip_.get()));
    }
    Entry entry{.name = facts.name, .bytes = {}};
    if (const std::string problem = name_problem(entry.name); !problem.empty()) refuse(entry.name, problem);
    if (!names_.insert(entry.name).second) refuse(entry.name, "stands in the file twice");
    // The size is what the file says: it bounds the buffer, and the stream must end there.
    if (facts.size > limits_.bytes - bytes_) {
      refuse(entry.name, "makes more than " + std::to_string(limits_.bytes) + " bytes of the file, unpacked");
    }
    bytes_ += facts.size;
    entry.bytes.resize(facts.size);
    const OpenEntry stream(zip_fopen_index(zip_.get(), index, 0));
    if (stream == nullptr) refuse(entry.name, zip_strerror(zip_.get()));
    fill(entry, stream.get());
    return entry;
  }

  void fill(Entry& entry, zip_file_t* stream) const {
    for (std::size_t at = 0; at < entry.bytes.size();) {
      const zip_int64_t count = zip_fread(stream, entry.bytes.data() + at, entry.bytes.size() - at);
      if (count < 0) refuse(entry.name, zip_file_strerror(stream));
      if (count == 0) refuse(entry.name, "ends before its size");
      at += static_cast<std::size_t>(count);
    }
    char beyond = 0;  // reading the end checks the sum
    const zip_int64_t count = zip_fread(stream, &beyond, 1);
    if (count < 0) refuse(entry.name, zip_file_strerror(stream));
    if (count > 0) refuse(entry.name, "goes on beyond its size");
  }

  const std::filesystem::path& file_;
  ZipLimits limits_;
  Zip zip_;
  std::set<std::string> names_{};
  std::uint64_t bytes_ = 0;
};

}  // namespace

std::vector<Entry> read_zip(const std::filesystem::path& file, const ZipLimits& limits) {
  return Reader(file, limits).entries();
}

}  // namespace drivebench::archive
