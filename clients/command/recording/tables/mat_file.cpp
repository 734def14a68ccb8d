#include "clients/command/recording/tables/mat_file.hpp"

#include <H5Epublic.h>
#include <matio.h>

#include <array>
#include <utility>

namespace drivebench::command {
namespace {

struct CloseMat {
  void operator()(mat_t* file) const noexcept { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const noexcept { Mat_VarFree(variable); }
};
using Variable = std::unique_ptr<matvar_t, FreeVariable>;

std::pair<matio_classes, matio_types> kind_of(SignalType type) noexcept {
  switch (type) {
    case SignalType::kUnsigned:
      return {MAT_C_UINT64, MAT_T_UINT64};
    case SignalType::kSigned:
      return {MAT_C_INT64, MAT_T_INT64};
    case SignalType::kReal:
      break;
  }
  return {MAT_C_DOUBLE, MAT_T_DOUBLE};
}

class MatioFile final : public MatFile {
 public:
  explicit MatioFile(const char* file)
      : file_(Mat_CreateVer(file, "MATLAB 7.3 MAT-file, written by drivebench", MAT_FT_MAT73)) {}
  bool is_open() const noexcept { return file_ != nullptr; }

  bool write_units(std::span<const Column> columns) override {
    std::vector<const char*> names;
    names.reserve(columns.size());
    for (const Column& column : columns)
      names.push_back(column.name.c_str());
    std::array<std::size_t, 2> one{1, 1};
    const Variable units(
        Mat_VarCreateStruct("units", 2, one.data(), names.data(), static_cast<unsigned>(names.size())));
    if (units == nullptr) return false;
    for (const Column& column : columns) {
      std::array<std::size_t, 2> size{1, column.unit.size()};
      std::string text = column.unit;
      Mat_VarSetStructFieldByName(
          units.get(), column.name.c_str(), 0,
          Mat_VarCreate(nullptr, MAT_C_CHAR, MAT_T_UTF8, 2, size.data(), text.data(), 0));
    }
    return Mat_VarWrite(file_.get(), units.get(), MAT_COMPRESSION_NONE) == 0;
  }

  bool append(std::span<Column> columns) override {
    for (Column& column : columns) {
      std::array<std::size_t, 2> size{column.words.size(), 1};
      const auto [kind, type] = kind_of(column.type);
      const Variable rows(Mat_VarCreate(column.name.c_str(), kind, type, 2, size.data(), column.words.data(),
                                        MAT_F_DONT_COPY_DATA));
      if (rows == nullptr || Mat_VarWriteAppend(file_.get(), rows.get(), MAT_COMPRESSION_NONE, 1) != 0)
        return false;
      column.words.clear();
    }
    return true;
  }

  bool close() override { return Mat_Close(file_.release()) == 0; }

 private:
  std::unique_ptr<mat_t, CloseMat> file_;
};

}  // namespace
}  // namespace drivebench::command

extern "C" [[gnu::visibility("default")]] drivebench::command::MatFile* drivebench_open_mat(
    const char* file) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // else HDF5 prints its own pages
  auto opened = std::make_unique<drivebench::command::MatioFile>(file);
  return opened->is_open() ? opened.release() : nullptr;
}
