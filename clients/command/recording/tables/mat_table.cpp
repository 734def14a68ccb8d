#include <H5Epublic.h>
#include <fmt/core.h>
#include <matio.h>

#include <array>
#include <bit>
#include <memory>
#include <stdexcept>

#include "clients/command/recording/tables/sample_table.hpp"
#include "clients/command/recording/tables/table_words.hpp"

namespace drivebench::command {
namespace {

constexpr std::size_t kRowsAtOnce = 8192;

struct CloseMat {
  void operator()(mat_t* file) const noexcept { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const noexcept { Mat_VarFree(variable); }
};
using Variable = std::unique_ptr<matvar_t, FreeVariable>;

struct Column {
  std::string name;
  std::string unit;
  SignalType type;
  std::vector<std::uint64_t> words{};
};

class MatTable final : public SampleTable {
 public:
  MatTable(const std::string& file, const Signals& signals, bool has_epoch)
      : path_(file), signals_(signals), has_epoch_(has_epoch) {
    columns_.push_back({.name = "tick", .unit = "1", .type = SignalType::kUnsigned});
    columns_.push_back({.name = "time_s", .unit = "s", .type = SignalType::kReal});
    if (has_epoch_) columns_.push_back({.name = "unix_ns", .unit = "ns", .type = SignalType::kSigned});
    for (const Signal* signal : signals) {
      columns_.push_back(
          {.name = std::string(signal->name), .unit = std::string(signal->unit), .type = signal->type});
    }
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // else HDF5 prints its own pages
    file_.reset(Mat_CreateVer(file.c_str(), "MATLAB 7.3 MAT-file, written by drivebench", MAT_FT_MAT73));
    if (!file_) throw UsageError(fmt::format("cannot write {}", file));
    write_units();
  }

  void add(const Sample& sample, const RowTime& time) override {
    auto column = columns_.begin();
    (column++)->words.push_back(sample.tick);
    (column++)->words.push_back(std::bit_cast<std::uint64_t>(seconds(time.bench_ns)));
    if (has_epoch_) (column++)->words.push_back(static_cast<std::uint64_t>(time.unix_ns));
    for (const Signal* signal : signals_)
      (column++)->words.push_back(word_of(*signal, sample));
    if (columns_[0].words.size() == kRowsAtOnce) write();
  }

  void finish(const std::string&) override {
    if (!columns_[0].words.empty()) write();
    check(Mat_Close(file_.release()) == 0);
  }

 private:
  void check(bool written) const {
    if (!written) throw std::runtime_error(fmt::format("cannot write {}", path_));
  }

  void write_units() {
    std::vector<const char*> names;
    for (const Column& column : columns_)
      names.push_back(column.name.c_str());
    std::array<std::size_t, 2> one{1, 1};
    const Variable units(
        Mat_VarCreateStruct("units", 2, one.data(), names.data(), static_cast<unsigned>(names.size())));
    check(units != nullptr);
    for (const Column& column : columns_) {
      std::array<std::size_t, 2> size{1, column.unit.size()};
      std::string text = column.unit;
      Mat_VarSetStructFieldByName(
          units.get(), column.name.c_str(), 0,
          Mat_VarCreate(nullptr, MAT_C_CHAR, MAT_T_UTF8, 2, size.data(), text.data(), 0));
    }
    check(Mat_VarWrite(file_.get(), units.get(), MAT_COMPRESSION_NONE) == 0);
  }

  void write() {
    for (Column& column : columns_) {
      std::array<std::size_t, 2> size{column.words.size(), 1};
      const auto [kind, type] = column.type == SignalType::kUnsigned ? std::pair(MAT_C_UINT64, MAT_T_UINT64)
                                : column.type == SignalType::kSigned ? std::pair(MAT_C_INT64, MAT_T_INT64)
                                                                     : std::pair(MAT_C_DOUBLE, MAT_T_DOUBLE);
      const Variable rows(Mat_VarCreate(column.name.c_str(), kind, type, 2, size.data(), column.words.data(),
                                        MAT_F_DONT_COPY_DATA));
      check(rows != nullptr && Mat_VarWriteAppend(file_.get(), rows.get(), MAT_COMPRESSION_NONE, 1) == 0);
      column.words.clear();
    }
  }

  std::string path_;
  const Signals& signals_;
  bool has_epoch_;
  std::vector<Column> columns_;
  std::unique_ptr<mat_t, CloseMat> file_;
};

}  // namespace

std::unique_ptr<SampleTable> mat_table(const std::string& file, const Signals& signals, const Epoch& epoch) {
  return std::make_unique<MatTable>(file, signals, epoch.has_value());
}

}  // namespace drivebench::command
