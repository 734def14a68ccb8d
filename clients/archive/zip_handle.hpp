#pragma once

#include <zip.h>

#include <filesystem>
#include <memory>
#include <string_view>

#include "clients/archive/zip_writer.hpp"

/// An open ZIP file of libzip, for the reader and the writer.
namespace drivebench::archive {

struct Discard {
  void operator()(zip_t* zip) const noexcept { zip_discard(zip); }
};
using Zip = std::unique_ptr<zip_t, Discard>;

/// `task` is what an error says: "read" or "write". Throws ZipError.
inline Zip opened(const std::filesystem::path& file, int flags, std::string_view task) {
  int code = 0;
  Zip zip(zip_open(file.c_str(), flags, &code));
  if (zip != nullptr) return zip;
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const std::string why = zip_error_strerror(&error);
  zip_error_fini(&error);
  throw ZipError("cannot " + std::string(task) + " " + file.string() + ": " + why);
}

}  // namespace drivebench::archive
