#include <fmt/core.h>

#include <bit>
#include <fstream>
#include <stdexcept>
#include <string_view>

#include "clients/command/recording/tables/sample_table.hpp"
#include "clients/command/recording/tables/table_words.hpp"
#include "protocols/abi/drivebench.h"

namespace drivebench::command {
namespace {

/// Little-endian bytes.
class Bytes {
 public:
  template <class Integer>
  Bytes& put(Integer value) {
    for (std::size_t k = 0; k < sizeof value; ++k)
      bytes_ += static_cast<char>(static_cast<std::uint64_t>(value) >> 8U * k & 0xffU);
    return *this;
  }
  Bytes& put_real(double value) { return put(std::bit_cast<std::uint64_t>(value)); }
  Bytes& put_text(std::string_view text, std::size_t size) {
    bytes_ += text;
    return zeros(size - text.size());
  }
  Bytes& zeros(std::size_t count) {
    bytes_.append(count, '\0');
    return *this;
  }
  const std::string& text() const noexcept { return bytes_; }

 private:
  std::string bytes_;
};

/// The blocks of a file, one behind the other; they name each other by their addresses.
class Blocks {
 public:
  Blocks() {
    text_ =
        Bytes().put_text("MDF     4.10    drvbench", 24).zeros(4).put(std::uint16_t{410}).zeros(34).text();
  }

  /// Adds a block without links to others yet, and returns its address.
  std::uint64_t add(std::string_view id, std::size_t links, const Bytes& data) {
    const std::uint64_t at = text_.size();
    text_ += block(id, links, data);
    return at;
  }
  std::uint64_t add_text(std::string_view text, std::string_view id = "##TX") {
    return add(id, 0, zero_ended(text));
  }
  static std::string text_block(std::string_view text) { return block("##TX", 0, zero_ended(text)); }

  void link(std::uint64_t from, std::size_t number, std::uint64_t to) {
    text_.replace(from + kHeadBytes + 8 * number, 8, Bytes().put(to).text());
  }
  const std::string& text() const noexcept { return text_; }

  static constexpr std::uint64_t kHeadBytes = 24;  ///< name, length and number of links

 private:
  static std::string block(std::string_view id, std::size_t links, const Bytes& data) {
    Bytes head;
    head.put_text(id, 8)
        .put(std::uint64_t{kHeadBytes + 8 * links + data.text().size()})
        .put(std::uint64_t{links})
        .zeros(8 * links);
    return head.text() + data.text();
  }
  /// Whole words, as all data of blocks are.
  static Bytes zero_ended(std::string_view text) {
    return Bytes().put_text(text, text.size() + 8 - text.size() % 8);
  }

  std::string text_;
};

struct ChannelRow {
  std::string name;
  std::string unit;
  std::string meaning;
  SignalType type;
  bool is_time;
};

class MdfTable final : public SampleTable {
 public:
  MdfTable(const std::string& file, const Signals& signals, const Epoch& epoch)
      : path_(file), signals_(signals), epoch_(epoch), out_(file, std::ios::binary | std::ios::trunc) {
    if (!out_) throw UsageError(fmt::format("cannot write {}", file));
    out_ << head();
  }

  void add(const Sample& sample, const RowTime& time) override {
    Bytes record;
    record.put_real(seconds(time.bench_ns)).put(sample.tick);
    if (epoch_) record.put(time.unix_ns);
    for (const Signal* signal : signals_)
      record.put(word_of(*signal, sample));
    out_ << record.text();
    ++rows_;
  }

  /// Only now the number of records is known.
  void finish(const std::string& axis) override {
    const std::uint64_t axis_at = data_at_ + Blocks::kHeadBytes + rows_ * record_bytes();
    out_ << Blocks::text_block(axis);
    put_at(axis_link_at_, axis_at);
    put_at(cycles_at_, rows_);
    put_at(data_at_ + 8, axis_at - data_at_);
    out_.close();
    if (!out_) throw std::runtime_error(fmt::format("cannot write {}", path_));
  }

 private:
  std::uint64_t record_bytes() const noexcept { return 8 * (signals_.size() + (epoch_ ? 3 : 2)); }

  std::vector<ChannelRow> channels() const {
    std::vector<ChannelRow> rows{{.name = "time_s",
                                  .unit = "s",
                                  .meaning = "time of the bench",
                                  .type = SignalType::kReal,
                                  .is_time = true},
                                 {.name = "tick",
                                  .unit = "1",
                                  .meaning = "sample period",
                                  .type = SignalType::kUnsigned,
                                  .is_time = false}};
    if (epoch_) {
      rows.push_back({.name = "unix_ns",
                      .unit = "ns",
                      .meaning = "UTC since 1970 at which the sample was due",
                      .type = SignalType::kSigned,
                      .is_time = false});
    }
    for (const Signal* signal : signals_) {
      rows.push_back({.name = std::string(signal->name),
                      .unit = std::string(signal->unit),
                      .meaning = std::string(signal->meaning),
                      .type = signal->type,
                      .is_time = false});
    }
    return rows;
  }

  /// Adds the channels and returns the first; each names the next one.
  static std::uint64_t add_channels(Blocks& blocks, const std::vector<ChannelRow>& rows) {
    std::uint64_t first = 0;
    std::uint64_t before = 0;
    for (std::size_t place = 0; place < rows.size(); ++place) {
      const ChannelRow& row = rows[place];
      const std::uint8_t type = row.type == SignalType::kReal ? 4 : row.type == SignalType::kSigned ? 2 : 0;
      const std::uint8_t master = row.is_time ? 2 : 0;
      const std::uint8_t synchronises = row.is_time ? 1 : 0;
      const std::uint64_t channel = blocks.add("##CN", 8,
                                               Bytes()
                                                   .put(master)
                                                   .put(synchronises)
                                                   .put(type)
                                                   .zeros(1)
                                                   .put(static_cast<std::uint32_t>(8 * place))
                                                   .put(std::uint32_t{64})
                                                   .zeros(12 + 6 * 8));
      blocks.link(channel, 2, blocks.add_text(row.name));
      blocks.link(channel, 6, blocks.add_text(row.unit));
      blocks.link(channel, 7, blocks.add_text(row.meaning));
      if (place == 0) first = channel;
      if (place > 0) blocks.link(before, 0, channel);
      before = channel;
    }
    return first;
  }

  /// Everything before the records.
  std::string head() {
    Blocks blocks;
    // Start time, time zone and daylight saving [min]; whether these two are known: then the time is UTC.
    const std::uint64_t header = blocks.add("##HD", 6,
                                            Bytes()
                                                .put(epoch_.value_or(0))
                                                .zeros(4)
                                                .put(std::uint8_t{epoch_ ? kZoneIsKnown : std::uint8_t{0}})
                                                .zeros(19));
    const std::uint64_t history = blocks.add("##FH", 2, Bytes().zeros(16));
    const std::uint64_t group = blocks.add("##DG", 4, Bytes().zeros(8));
    const std::uint64_t records =
        blocks.add("##CG", 6, Bytes().zeros(24).put(static_cast<std::uint32_t>(record_bytes())).zeros(4));
    blocks.link(header, 0, group);
    blocks.link(header, 1, history);
    blocks.link(
        history, 1,
        blocks.add_text(fmt::format("<FHcomment xmlns=\"http://www.asam.net/mdf/v4\"><TX>exported</TX>"
                                    "<tool_id>drivebench</tool_id><tool_vendor>drivebench</tool_vendor>"
                                    "<tool_version>{}</tool_version></FHcomment>",
                                    drivebench_version()),
                        "##MD"));
    blocks.link(group, 1, records);
    blocks.link(records, 1, add_channels(blocks, channels()));
    data_at_ = blocks.add("##DT", 0, Bytes());
    blocks.link(group, 2, data_at_);
    axis_link_at_ = records + Blocks::kHeadBytes + 2 * 8;
    cycles_at_ = records + Blocks::kHeadBytes + 6 * 8 + 8;
    return blocks.text();
  }

  void put_at(std::uint64_t place, std::uint64_t value) {
    out_.seekp(static_cast<std::streamoff>(place));
    out_ << Bytes().put(value).text();
  }

  static constexpr std::uint8_t kZoneIsKnown = 2;

  std::string path_;
  const Signals& signals_;
  Epoch epoch_;
  std::ofstream out_;
  std::uint64_t rows_ = 0;
  std::uint64_t axis_link_at_ = 0;
  std::uint64_t cycles_at_ = 0;  ///< the number of records
  std::uint64_t data_at_ = 0;    ///< the block of the records
};

}  // namespace

std::unique_ptr<SampleTable> mdf_table(const std::string& file, const Signals& signals, const Epoch& epoch) {
  return std::make_unique<MdfTable>(file, signals, epoch);
}

}  // namespace drivebench::command
