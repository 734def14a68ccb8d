#include <fmt/format.h>

#include <iterator>

#include "clients/command/common/basics/signals.hpp"
#include "clients/command/recording/tables/sample_table.hpp"

namespace drivebench::command {
namespace {

class CsvTable final : public SampleTable {
 public:
  CsvTable(Output& out, const Signals& signals, bool has_epoch)
      : out_(out), signals_(signals), has_epoch_(has_epoch) {}

  void add(const Sample& sample, const RowTime& time) override {
    if (!has_rows_) text_ += csv_header(signals_, has_epoch_ ? ",unix_ns" : "");
    has_rows_ = true;
    append_row(sample, time);
    if (text_.size() > kPiece) write();
  }

  void finish(const std::string&) override {
    write();
    out_.flush();
  }

 private:
  static constexpr std::size_t kPiece = 1U << 16U;

  void append_row(const Sample& sample, const RowTime& time) {
    append_time(text_, sample.tick, time.bench_ns);
    auto out = std::back_inserter(text_);
    if (has_epoch_) fmt::format_to(out, ",{}", time.unix_ns);
    for (const Signal* signal : signals_) {
      switch (signal->type) {
        case SignalType::kUnsigned:
          fmt::format_to(out, ",{}", sample.*signal->as_unsigned);
          break;
        case SignalType::kSigned:
          fmt::format_to(out, ",{}", sample.*signal->as_signed);
          break;
        case SignalType::kReal:
          fmt::format_to(out, ",{}", sample.*signal->as_real);  // the shortest text that reads back equal
          break;
      }
    }
    text_ += '\n';
  }

  void write() {
    out_.write(text_);
    text_.clear();
  }

  Output& out_;
  const Signals& signals_;
  bool has_epoch_;
  std::string text_;
  bool has_rows_ = false;
};

}  // namespace

std::unique_ptr<SampleTable> csv_table(Output& out, const Signals& signals, const Epoch& epoch) {
  return std::make_unique<CsvTable>(out, signals, epoch.has_value());
}

}  // namespace drivebench::command
