#include "clients/command/experiment/experiment_data.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <stdexcept>

#include "clients/command/common/basics/signals.hpp"

namespace drivebench::command {
namespace {

constexpr std::size_t kPiece = std::size_t{1} << 16;

double little_endian(const char* bytes) {
  std::uint64_t word = 0;
  for (int i = 7; i >= 0; --i)
    word = word << 8 | static_cast<unsigned char>(bytes[i]);
  return std::bit_cast<double>(word);
}

}  // namespace

bool ExperimentRows::describe(const v1::ExperimentInfo& info) {
  if (!signals_.empty()) return false;
  for (const std::string& name : info.signals()) {
    const Signal* const signal = find_signal(name);
    if (signal == nullptr) throw std::runtime_error("the server sends an unknown signal, " + name);
    signals_.push_back(signal);
  }
  if (signals_.empty() || info.decimation() == 0 || !(info.period_s() > 0.0)) {
    throw std::runtime_error("the server does not say what it sends");
  }
  decimation_ = info.decimation();
  period_ns_ = static_cast<std::uint64_t>(std::llround(info.period_s() * 1e9));
  values_.resize(signals_.size());
  return true;
}

void ExperimentRows::take(const v1::ExperimentData& data, const OnRow& on_row) {
  const std::size_t width = 8 * signals_.size();
  if (width == 0 || data.data().size() % width != 0 || data.first() % decimation_ != 0) {
    throw std::runtime_error("the server sent a piece of a row");
  }
  const std::uint64_t first = data.first() / decimation_;
  const std::uint64_t end = first + data.data().size() / width;
  if (first > rows_) throw std::runtime_error(fmt::format("the server left out rows from {} on", rows_));
  for (; rows_ < end; ++rows_) {
    if (!on_row) continue;
    const char* const row = data.data().data() + (rows_ - first) * width;
    for (std::size_t i = 0; i < values_.size(); ++i)
      values_[i] = little_endian(row + 8 * i);
    on_row(next_tick(), values_);
  }
}

void DataWriter::describe(const v1::ExperimentInfo& info) {
  if (!rows_.describe(info)) return;
  if (is_wanted_) out_.emplace(file_);
  text_ = csv_header(rows_.signals());
}

void DataWriter::take(const v1::ExperimentData& data) {
  if (!out_) return rows_.take(data, {});
  rows_.take(data,
             [this](std::uint64_t tick, const std::vector<double>& values) { write_row(tick, values); });
  if (text_.size() > kPiece) flush();
}

void DataWriter::write_row(std::uint64_t tick, const std::vector<double>& values) {
  append_time(text_, tick, tick * rows_.tick_ns());
  auto out = std::back_inserter(text_);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (rows_.signals()[i]->type == SignalType::kReal) {
      fmt::format_to(out, ",{}", values[i]);  // the shortest text that reads back equal
    } else {
      fmt::format_to(out, ",{:.0f}", values[i]);
    }
  }
  text_ += '\n';
}

void DataWriter::flush() {
  if (!out_) return;
  out_->write(text_);
  text_.clear();
  out_->flush();
}

void RecordingDownload::take(const v1::ExperimentData& data) {
  if (data.first() > bytes_) throw std::runtime_error("the server left out a piece of the recording");
  const std::uint64_t known = bytes_ - data.first();
  if (known >= data.data().size()) return;
  out_->write(std::string_view(data.data()).substr(known));
  bytes_ = data.first() + data.data().size();
}

}  // namespace drivebench::command
