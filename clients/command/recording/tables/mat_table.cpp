#include <dlfcn.h>
#include <fmt/core.h>

#include <bit>
#include <memory>
#include <stdexcept>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/recording/tables/mat_file.hpp"
#include "clients/command/recording/tables/sample_table.hpp"
#include "clients/command/recording/tables/table_words.hpp"

namespace drivebench::command {
namespace {

constexpr std::size_t kRowsAtOnce = 8192;

/// The module stays loaded: its code must outlive every file.
OpenMat load_module() {
  void* const module = ::dlopen(kMatModule, RTLD_NOW | RTLD_LOCAL);
  void* const open = module != nullptr ? ::dlsym(module, kMatSymbol) : nullptr;
  if (open == nullptr) {
    throw std::runtime_error(
        fmt::format("MATLAB files need {}, which comes with drivebench: {}", kMatModule, ::dlerror()));
  }
  return reinterpret_cast<OpenMat>(open);
}

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
    file_.reset(load_module()(file.c_str()));
    if (!file_) throw UsageError(fmt::format("cannot write {}", file));
    check(file_->write_units(columns_));
  }

  void add(const Sample& sample, const RowTime& time) override {
    auto column = columns_.begin();
    (column++)->words.push_back(sample.tick);
    (column++)->words.push_back(std::bit_cast<std::uint64_t>(seconds(time.bench_ns)));
    if (has_epoch_) (column++)->words.push_back(static_cast<std::uint64_t>(time.unix_ns));
    for (const Signal* signal : signals_)
      (column++)->words.push_back(word_of(*signal, sample));
    if (columns_[0].words.size() == kRowsAtOnce) check(file_->append(columns_));
  }

  void finish(const std::string&) override {
    if (!columns_[0].words.empty()) check(file_->append(columns_));
    check(file_->close());
  }

 private:
  void check(bool written) const {
    if (!written) throw std::runtime_error(fmt::format("cannot write {}", path_));
  }

  std::string path_;
  const Signals& signals_;
  bool has_epoch_;
  std::vector<MatFile::Column> columns_;
  std::unique_ptr<MatFile> file_;
};

}  // namespace

std::unique_ptr<SampleTable> mat_table(const std::string& file, const Signals& signals, const Epoch& epoch) {
  return std::make_unique<MatTable>(file, signals, epoch.has_value());
}

}  // namespace drivebench::command
