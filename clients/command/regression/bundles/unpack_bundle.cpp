#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "clients/archive/zip_reader.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/suite/compose.hpp"
#include "clients/regression/tables/key_table.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using regression::KeyTable;

constexpr auto kParts =
    std::to_array<std::string_view>({"bundle.toml", "bench.toml", "run.mcap", "output.txt", "messages.txt"});
constexpr auto kNeeded = std::to_array<std::string_view>({"bundle.toml", "bench.toml", "case/case.toml"});

[[noreturn]] void refuse(const fs::path& file, std::string_view entry, const std::string& rule) {
  throw UsageError(fmt::format("{}: entry \"{}\": {}", file.string(), entry, rule));
}

std::vector<archive::Entry> entries_of(const fs::path& file) {
  try {
    return archive::read_zip(file);
  } catch (const archive::ZipError& error) {
    throw UsageError(error.what());
  }
}

/// Every entry is a part of a bundle, and none is missing.
void check_parts(const fs::path& file, const std::vector<archive::Entry>& entries) {
  for (const archive::Entry& entry : entries) {
    if (std::ranges::find(kParts, entry.name) != kParts.end()) continue;
    if (!entry.name.starts_with("case/") && !entry.name.starts_with("curves/"))
      refuse(file, entry.name, "is no part of a bundle");
  }
  for (const std::string_view name : kNeeded) {
    if (std::ranges::find(entries, name, &archive::Entry::name) == entries.end())
      refuse(file, name, "is missing: this is no bundle of drivebench test");
  }
}

void write(const fs::path& file, const std::vector<archive::Entry>& entries, const fs::path& folder) {
  for (const archive::Entry& entry : entries) {
    const fs::path target = folder / entry.name;
    std::error_code error;
    fs::create_directories(target.parent_path(), error);
    if (error || fs::exists(target)) refuse(file, entry.name, "is a file and a folder at once");
    write_file(target, entry.bytes);
    // A device under test may be a program.
    if (entry.name.starts_with("case/")) fs::permissions(target, fs::perms::owner_all);
  }
}

ConfigNode table_in(const fs::path& path) {
  ProblemList problems;
  const FileText text = read_file(path, kMaxConfigBytes);
  if (!text.why_not.empty()) problems.add(path.string(), 0, "", text.why_not);
  problems.throw_if_any();
  std::optional<ConfigNode> table = parse_document(text.text, path.string(), problems);
  problems.throw_if_any();
  return std::move(*table);
}

/// A composed bench opens no door and writes no file.
void check_bench(const fs::path& file, const fs::path& bench) {
  const ConfigNode table = table_in(bench);
  for (const std::string_view key : regression::kTablesOfAPlace) {
    if (regression::find_child(table, key) != nullptr)
      refuse(file, "bench.toml",
             fmt::format("has {}, which belongs to a place: a composed bench has none", key));
  }
}

struct Facts {
  std::string name;
  std::string program;
};

Facts read_facts(const fs::path& path) {
  ProblemList problems;
  const ConfigNode node = table_in(path);
  const std::string name = path.string();
  KeyTable table(node, "", 1, name, problems);
  for (const char* key : {"format", "program", "name"})
    table.require(key);
  table.integer("format", 1, 1);
  problems.throw_if_any();  // the keys of another format are not judged
  Facts facts{.name = table.text("name").value_or(""), .program = table.text("program").value_or("")};
  table.text("verdict");
  table.text("hash");
  table.finish();
  problems.throw_if_any();
  return facts;
}

Unpacked read(const fs::path& file, const fs::path& folder) {
  Facts facts = read_facts(folder / "bundle.toml");
  check_bench(file, folder / "bench.toml");
  std::vector<regression::Case> cases = regression::read_suite(folder / "case/case.toml");
  if (cases.size() != 1)
    refuse(file, "case/case.toml", fmt::format("makes {} cases but a bundle has one", cases.size()));
  cases.front().name = facts.name;
  return {.what = std::move(cases.front()),
          .bench_file = folder / "bench.toml",
          .recording = folder / "run.mcap",
          .program = std::move(facts.program)};
}

/// The sentence of a problem in an unpacked file, as one of the bundle's entry.
std::string about_the_bundle(std::string text, const fs::path& file, const fs::path& folder) {
  const std::string place = folder.string() + "/";
  for (std::size_t at = text.find(place); at != std::string::npos; at = text.find(place, at))
    text.replace(at, place.size(), file.string() + ": ");
  return text;
}

}  // namespace

Unpacked unpack_bundle(const fs::path& file, const fs::path& folder) {
  const std::vector<archive::Entry> entries = entries_of(file);
  check_parts(file, entries);
  write(file, entries, folder);
  try {
    return read(file, folder);
  } catch (const ConfigError& error) {
    throw UsageError(about_the_bundle(error.what(), file, folder));
  }
}

}  // namespace drivebench::command
