#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <iterator>

#include "clients/archive/zip_reader.hpp"

namespace drivebench::archive::zip_test {
namespace {

namespace fs = std::filesystem;

class ZipFile : public testing::Test {
 protected:
  ZipFile() { fs::create_directories(folder_); }
  ~ZipFile() override { fs::remove_all(folder_); }

  static std::string bytes_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void put(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }

  /// What reading the file says; empty: it reads.
  std::string refusal(const ZipLimits& limits = {}) const {
    try {
      read_zip(file_, limits);
      return {};
    } catch (const ZipError& error) {
      return error.what();
    }
  }

  fs::path folder_ = fs::temp_directory_path() / ("drivebench-zip-" + std::to_string(getpid()));
  fs::path file_ = folder_ / "it.zip";
};

/// Catches: a byte that the way through the file changes, another order, bytes that depend on the clock.
TEST_F(ZipFile, GivesBackWhatWasPutIn) {
  const std::vector<Entry> entries = {
      {"b/run.bin", std::string(100'000, '\0')}, {"a.txt", "text"}, {"c", ""}};
  write_zip(file_, entries);
  const std::string once = bytes_of(file_);
  const std::vector<Entry> read = read_zip(file_);
  ASSERT_EQ(read.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read[i].name, entries[i].name);
    EXPECT_EQ(read[i].bytes, entries[i].bytes);
  }
  write_zip(file_, entries);
  EXPECT_EQ(bytes_of(file_), once);
}

/// Catches: a name that leads out of the folder where the entries are unpacked.
TEST_F(ZipFile, RefusesNamesThatLeaveTheirFolder) {
  for (const char* name : {"../x", "a/../../x", "/etc/x", "a/", "./x", "a\\x", "c:x", "a\nx"}) {
    write_zip(file_, {{name, "x"}});
    EXPECT_NE(refusal().find("entry \""), std::string::npos) << name;
    EXPECT_NE(refusal().find("a name "), std::string::npos) << name << ": " << refusal();
  }
}

/// Catches: a small file that unpacks to more than the machine has.
TEST_F(ZipFile, RefusesMoreThanItsLimits) {
  write_zip(file_, {{"a", std::string(60'000, 'x')}, {"b", std::string(60'000, 'x')}});
  EXPECT_EQ(refusal({.entries = 2, .bytes = 120'000}), "");
  EXPECT_NE(refusal({.entries = 2, .bytes = 119'999}).find("entry \"b\": makes more than 119999 bytes"),
            std::string::npos);
  EXPECT_NE(refusal({.entries = 1, .bytes = 120'000}).find("has 2 entries but may have at most 1"),
            std::string::npos);
}

/// Catches: a damaged file whose bytes are taken all the same, a crash on one that is no ZIP file.
TEST_F(ZipFile, RefusesWhatIsNotWhole) {
  write_zip(file_, {{"a.txt", "the text of this entry"}});
  const std::string whole = bytes_of(file_);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    put(whole.substr(0, size));
    EXPECT_NE(refusal(), "") << size;
  }
  std::string changed = whole;
  changed[whole.find("a.txt") + 7] ^= 1;
  put(changed);
  EXPECT_NE(refusal(), "");
  put("no ZIP file at all");
  EXPECT_NE(refusal().find("it.zip"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::archive::zip_test
