#include "clients/archive/zip_writer.hpp"

#include "clients/archive/zip_handle.hpp"

namespace drivebench::archive {
namespace {

constexpr std::uint16_t kFirstDate = (1U << 5U) | 1U;  // 1 January 1980
constexpr std::uint16_t kMidnight = 0;

}  // namespace

void write_zip(const std::filesystem::path& file, const std::vector<Entry>& entries) {
  Zip zip = opened(file, ZIP_CREATE | ZIP_TRUNCATE, "write");
  for (const Entry& entry : entries) {
    zip_source_t* const source = zip_source_buffer(zip.get(), entry.bytes.data(), entry.bytes.size(), 0);
    const zip_int64_t index =
        source == nullptr ? -1 : zip_file_add(zip.get(), entry.name.c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      const std::string why = zip_strerror(zip.get());
      zip_source_free(source);
      throw ZipError("cannot put " + entry.name + " into " + file.string() + ": " + why);
    }
    zip_file_set_dostime(zip.get(), static_cast<zip_uint64_t>(index), kMidnight, kFirstDate, 0);
  }
  if (zip_close(zip.get()) != 0) {
    throw ZipError("cannot write " + file.string() + ": " + zip_strerror(zip.get()));
  }
  zip.release();
}

}  // namespace drivebench::archive
