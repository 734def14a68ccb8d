#include "protocols/modbus/register_map.hpp"

#include <algorithm>

namespace drivebench::modbus {

std::uint64_t signal_bits(const Row& row, const Sample& sample) noexcept {
  const Signal& signal = kSignals[row.index];
  if (row.content == Content::kLowBits || (row.type != Type::kFloat32 && row.size() > 1)) {
    return signal.type == SignalType::kSigned ? static_cast<std::uint64_t>(sample.*signal.as_signed)
                                              : sample.*signal.as_unsigned;
  }
  const double value = value_of(signal, sample);
  return row.type == Type::kFloat32 ? float_bits(value) : counts_of(row.type, value, row.scale);
}

Sample read_sample(std::span<const std::uint16_t> words) noexcept {
  Sample sample;
  for (const Row& row : map_detail::kFixedRows) {
    if (row.content != Content::kSignal || row.address < kSampleStart) continue;
    const Signal& signal = kSignals[row.index];
    const std::size_t at = row.address - kSampleStart;
    if (at + row.size() > words.size()) break;
    const std::uint64_t bits = get(row.type, WordOrder::kAbcd, &words[at]);
    switch (signal.type) {
      case SignalType::kUnsigned:
        sample.*signal.as_unsigned = bits;
        break;
      case SignalType::kSigned:
        sample.*signal.as_signed = static_cast<std::int64_t>(bits);
        break;
      case SignalType::kReal:
        sample.*signal.as_real = number_of(row.type, bits);
        break;
    }
  }
  return sample;
}

RegisterMap::RegisterMap(std::span<const ParameterInfo> parameters, bool writable)
    : rows_(map_detail::kFixedRows.begin(), map_detail::kFixedRows.end()), writable_(writable) {
  std::uint16_t address = kParameterStart;
  for (const ParameterInfo& p : parameters) {
    rows_.push_back({.address = address,
                     .type = Type::kFloat32,
                     .content = Content::kParameter,
                     .index = static_cast<std::uint16_t>(&p - parameters.data()),
                     .writable = p.live,
                     .name = p.name,
                     .unit = p.unit,
                     .scale = 1.0,
                     .minimum = p.minimum,
                     .maximum = p.maximum,
                     .meaning = p.meaning});
    address = static_cast<std::uint16_t>(rows_.back().end());
  }
  using namespace map_detail;
  const auto block = [](std::uint16_t id, std::span<const Row> rows, std::string_view name) {
    return Block{.id = id, .start = rows.front().address, .length = length_of(rows), .name = name};
  };
  blocks_ = {
      block(1, kProcess, "process data"),
      block(2, kSample, "sample"),
      block(3, kCommand, "lease and command"),
      {.id = 4,
       .start = kParameterStart,
       .length = static_cast<std::uint16_t>(address - kParameterStart),
       .name = "parameters"},
      block(5, kMoreProcess, "process data of all terminals"),
      block(6, kMoreSample, "sample, continued"),
      block(7, kMoreCommand, "lease and command for all terminals"),
      block(8, kLegs, "legs of a command"),
      block(9, kRailSample, "terminals against the negative rail"),
      block(10, kComparators, "comparators of the terminals"),
      block(11, kConverters, "numbers of converters and timers"),
      block(12, kPosition, "absolute encoder and capture of Hall edges"),
  };
}

std::optional<RegisterMap::Range> RegisterMap::find(std::uint16_t address,
                                                    std::uint16_t count) const noexcept {
  const bool mirrored = address >= kMirrorOffset;
  const auto first = static_cast<std::uint16_t>(mirrored ? address - kMirrorOffset : address);
  const std::size_t end = std::size_t{first} + count;
  const auto from =
      std::partition_point(rows_.begin(), rows_.end(), [&](const Row& row) { return row.end() <= first; });
  const auto to = std::partition_point(from, rows_.end(), [&](const Row& row) { return row.address < end; });
  std::size_t reached = first;  // every register below belongs to one of the rows
  for (auto row = from; row != to && row->address <= reached; ++row)
    reached = row->end();
  if (count == 0 || reached < end) return std::nullopt;
  return Range{.rows = std::span(from, to),
               .order = mirrored ? WordOrder::kCdab : WordOrder::kAbcd,
               .first = first,
               .count = count};
}

bool RegisterMap::may_write(const Range& range) const noexcept {
  if (!writable_ || range.rows.front().address != range.first ||
      range.rows.back().end() != std::size_t{range.first} + range.count) {
    return false;
  }
  return std::all_of(range.rows.begin(), range.rows.end(), [](const Row& row) { return row.writable; });
}

bool values_fit(const RegisterMap::Range& range, std::span<const std::uint16_t> words) noexcept {
  return std::all_of(range.rows.begin(), range.rows.end(), [&](const Row& row) {
    const std::uint64_t bits = get(row.type, range.order, &words[std::size_t{row.address} - range.first]);
    const double number = number_of(row.type, bits);
    if (row.type != Type::kFloat32 && row.scale != 1.0) return true;  // every count is in range
    // Written so that NaN does not fit.
    return number >= row.minimum && number <= row.maximum;
  });
}

}  // namespace drivebench::modbus
