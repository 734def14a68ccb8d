#include "protocols/modbus/map_text.hpp"
#include "protocols/text.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <vector>

namespace drivebench::modbus {
namespace {

/// One line of the table, in the order of kColumns.
using Line = std::vector<std::string>;

constexpr auto kColumns =
    std::to_array<std::string_view>({"register", "hex", "3xxxx", "4xxxx", "CDAB", "name", "description",
                                     "type", "access", "unit", "scaling", "range"});

std::string hex(std::size_t value) {
  std::array<char, 8> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, 16).ptr;
  const std::string digits(buffer.data(), end);
  return "0x" + std::string(4 - digits.size(), '0') + digits;
}

/// The traditional notation: a digit for the kind, then at least four digits that count from 1.
std::string notation(char kind, std::size_t address) {
  const std::string digits = std::to_string(address + 1);
  return kind + std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0') + digits;
}

std::string_view name_of(Type type) noexcept {
  switch (type) {
    case Type::kUnsigned16:
      return "uint16";
    case Type::kSigned16:
      return "int16";
    case Type::kUnsigned32:
      return "uint32";
    case Type::kSigned32:
      return "int32";
    case Type::kFloat32:
      return "float32";
    case Type::kUnsigned64:
      return "uint64";
    case Type::kSigned64:
      break;
  }
  return "int64";
}

std::string range_of(const Row& row) {
  if (row.content == Content::kLowBits) return "wraps";
  if (row.writable || row.content == Content::kSignal || row.content == Content::kParameter) {
    return shortest(row.minimum) + " .. " + shortest(row.maximum);
  }
  return "";
}

Line line_of(const Row& row, bool writable) {
  return {std::to_string(row.address),
          hex(row.address),
          notation('3', row.address),
          notation('4', row.address),
          std::to_string(row.address + kMirrorOffset),
          std::string(row.name),
          std::string(row.meaning),
          std::string(name_of(row.type)),
          row.writable && writable ? "rw" : "r",
          std::string(row.unit),
          shortest(row.scale),
          range_of(row)};
}

Line line_of(char kind, std::size_t address, const Bit& bit, bool writable) {
  const std::string place = notation(kind, address);
  return {std::to_string(address),
          hex(address),
          place,
          "",
          "",
          std::string(bit.name),
          std::string(bit.meaning),
          "bit",
          writable ? "rw" : "r",
          "1",
          "1",
          "0 .. 1"};
}

std::vector<Line> coil_lines(const RegisterMap& map) {
  std::vector<Line> lines;
  for (std::size_t i = 0; i < kCoils.size(); ++i)
    lines.push_back(line_of('0', i, kCoils[i], map.writable()));
  return lines;
}

std::vector<Line> input_lines(std::span<const FaultInput> faults) {
  std::vector<Line> lines;
  for (const FaultInput& fault : faults)
    if (fault.address < kFaultInputs) lines.push_back(line_of('1', fault.address, fault.bit, false));
  for (std::size_t i = 0; i < kOtherInputs.size(); ++i)
    lines.push_back(line_of('1', kFaultInputs + i, kOtherInputs[i], false));
  for (const FaultInput& fault : faults) {
    if (fault.address >= kFirstInjectedInput && fault.address < kDiscreteInputs)
      lines.push_back(line_of('1', fault.address, fault.bit, false));
  }
  return lines;
}

bool have_the_same_parameters(std::span<const RegisterMap> maps) {
  return std::all_of(maps.begin(), maps.end(), [&](const RegisterMap& map) {
    return std::equal(map.rows().begin(), map.rows().end(), maps[0].rows().begin(), maps[0].rows().end(),
                      [](const Row& a, const Row& b) { return a.name == b.name; });
  });
}

/// `table` distinguishes rows of the same address.
void add_csv(std::string& out, std::string_view table, const Line& line) {
  out += table;
  for (std::size_t i = 0; i < line.size(); ++i) {
    out += ',';
    if (line[i].find_first_of(",\"") == std::string::npos) {
      out += line[i];
      continue;
    }
    out += '"';
    for (const char c : line[i])
      out += c == '"' ? std::string("\"\"") : std::string(1, c);
    out += '"';
  }
  out += "\n";
}

void add_row(std::string& out, const Line& line) {
  out += "|";
  for (const std::string& cell : line) {
    out += ' ';
    for (const char c : cell)
      out += c == '|' ? std::string("\\|") : std::string(1, c);
    out += " |";
  }
  out += "\n";
}

void add_table(std::string& out, std::string_view title, std::span<const Line> lines) {
  out += "\n## " + std::string(title) + "\n\n";
  add_row(out, Line(kColumns.begin(), kColumns.end()));
  out += "|";
  for (std::size_t i = 0; i < kColumns.size(); ++i)
    out += "---|";
  out += "\n";
  for (const Line& line : lines)
    add_row(out, line);
}

std::vector<Line> lines_between(const RegisterMap& map, std::size_t begin, std::size_t end) {
  std::vector<Line> lines;
  for (const Row& row : map.rows())
    if (row.address >= begin && row.address < end) lines.push_back(line_of(row, map.writable()));
  return lines;
}

constexpr std::string_view kRules = R"(
Functions 1, 2, 3, 4, 5, 6, 15, 16, 22, 23, 43/14 (device identification) and 8/0 (echo). Functions 3 and 4 read the same registers.
Addresses count from 0; the columns 3xxxx and 4xxxx are the traditional notation, which counts from 1. A value of more than one register has
its most significant word first (ABCD); at the address in column CDAB it has the words in reverse order. One request sees one tick.
The sample has two blocks without a gap: one request may read the 125 registers from 200 on, which hold every sensor but the terminals against the
negative rail, the comparators, the numbers of converters and timers, and the absolute encoder and the capture of the Hall lines. These have blocks of
their own, with the tick before them.

A value is a register, or registers, times its scaling. Scaled 16-bit values saturate at +-32767 (unsigned: 65534); -32768 (65535) stands for
"no number". float32 rounds the double precision of the bench, in both directions.

**Taking the axis.** Write a number of your choice to `lease_key`. If the lease is free, this connection takes it and may write. After the
connection has ended, a connection that writes the same key takes the lease over, until the lease time of the bench has passed. A connection that
holds the lease loses it when it sends nothing for `idle_timeout_ms`; in real time also when it sends no command for the lease time. Writing 0 or
the request 2 gives the lease back.

**Commands.** A command is one write of `command_mode` to `command_b`. The write of `command_counter` triggers it, so write the other registers
together with it or before. With function 23 the answer waits for the tick and reads the sample after it: one transaction for each tick in
lockstep. The registers from `more_lease_key` on repeat the block and add phase c and field, so that one write commands a machine with these;
`terminals` lists the terminals of the machine, and set-points of other terminals are ignored. A duty is a part of the bus voltage, -1 to 1, across a
winding between two legs and across the field. A leg of a star has in mode 5 its part of the bus voltage against the negative rail, 0 to 1; mode 3 counts
it from the middle of the link, so that -1 is the negative rail and 1 the positive one. The common part of duties reaches the terminals. `legs_off`
holds until the next write or the end of the lease. Function 16 is answered as soon as the bench has accepted the command. A write of the process data is a command as well, for the
newest tick at its arrival; in real time it waits for the next tick if this one is answered already, so that no command is lost.

| exception | meaning |
|---|---|
| 1 | function or sub-function not served |
| 2 | no such register, half a value written, or a register that is read-only (all are, unless the configuration allows writes) |
| 3 | wrong quantity or byte count; a value that is not finite, out of range or breaks a rule between parameters; contradictory requests in one write |
| 4 | a latched fault must be cleared first, the drive takes no currents, or the command answers a sample that is too old, answered already or not taken yet; in a free run: no leases |
| 6 | this connection does not hold the lease, or too many requests; for process data in lockstep also: this tick has its command already |
| 11 | no axis at this unit id |

A request that an exception answers writes nothing. `last_refusal` holds the reason of the last refused write.
)";

}  // namespace

std::string map_csv(std::span<const RegisterMap> maps, std::span<const FaultInput> faults) {
  std::string out;
  add_csv(out, "table", Line(kColumns.begin(), kColumns.end()));
  const bool same = have_the_same_parameters(maps);
  for (std::size_t i = 0; i < (same ? 1 : maps.size()); ++i) {
    for (const Row& row : maps[i].rows()) {
      const bool is_parameter = row.content == Content::kParameter;
      if (i > 0 && !is_parameter) continue;
      add_csv(out, same || !is_parameter ? "register" : "register of unit " + std::to_string(i + 1),
              line_of(row, maps[i].writable()));
    }
  }
  for (const Line& line : coil_lines(maps[0]))
    add_csv(out, "coil", line);
  for (const Line& line : input_lines(faults))
    add_csv(out, "discrete input", line);
  return out;
}

std::string map_markdown(std::span<const RegisterMap> maps, std::span<const FaultInput> faults,
                         std::span<const std::string_view> axes) {
  std::string out = "# Modbus register map, version " + std::to_string(kMapVersion) + "\n\n";
  for (std::size_t i = 0; i < axes.size(); ++i) {
    out += "* unit id " + std::to_string(i + 1) + (i == 0 ? " (also 0 and 255)" : "") + ": axis " +
           std::to_string(i) + ", " + std::string(axes[i]) + "\n";
  }
  out += kRules;
  const auto lines_of = [](const RegisterMap& map, const Block& block) {
    return lines_between(map, block.start, std::size_t{block.start} + block.length);
  };
  add_table(out, "Header and test registers", lines_between(maps[0], 0, kProcessStart));
  std::vector<Block> blocks(maps[0].blocks().begin(), maps[0].blocks().end());
  std::sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.start < b.start; });
  const bool same = have_the_same_parameters(maps);
  for (const Block& block : blocks) {
    if (block.start == kParameterStart && !same) continue;
    add_table(
        out, std::string(1, static_cast<char>(block.name[0] - 'a' + 'A')) + std::string(block.name.substr(1)),
        lines_of(maps[0], block));
  }
  for (std::size_t i = 0; i < (same ? 0 : maps.size()); ++i) {
    add_table(out, "Parameters of unit id " + std::to_string(i + 1),
              lines_between(maps[i], kParameterStart, kMirrorOffset));
  }
  add_table(out, "Coils", coil_lines(maps[0]));
  add_table(out, "Discrete inputs", input_lines(faults));
  return out;
}

}  // namespace drivebench::modbus
