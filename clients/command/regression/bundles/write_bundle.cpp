#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>

#include "clients/archive/zip_writer.hpp"
#include "clients/command/regression/bundles/bundle.hpp"
#include "clients/regression/results/fingerprints.hpp"
#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/suite/compose.hpp"
#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"

namespace drivebench::command {
namespace {

namespace fs = std::filesystem;
using regression::Case;

/// Longer names of cases are cut, so that their files have names that every file system takes.
constexpr std::size_t kLongestName = 180;

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return bytes;
}

/// Entries by their names, which is their order in the bundle.
using Entries = std::map<std::string, std::string>;

/// Puts every file that the table names into the entries, and its new name into the table.
void take_files(ConfigNode& node, const fs::path& folder, const std::string& room, std::size_t& count,
                Entries& entries, std::string_view prefix) {
  auto* const text =
      node.kind == ConfigNode::Kind::kScalar ? std::get_if<std::string>(&node.scalar) : nullptr;
  if (text != nullptr && text->ends_with(".csv")) {
    const std::string name = fmt::format("{}{}.csv", room, ++count);
    entries[std::string(prefix) + name] = bytes_of(folder / *text);
    *text = name;
  }
  for (ConfigNode& child : node.children)
    take_files(child, folder, room, count, entries, prefix);
}

void add_bench(const BundleContent& content, Entries& entries) {
  ProblemList problems;
  const std::string text = bytes_of(content.bench_file);
  std::optional<ConfigNode> bench = parse_document(text, content.bench_file.string(), problems);
  problems.throw_if_any();
  regression::remove_places(*bench);
  std::size_t curves = 0;
  take_files(*bench, content.bench_file.parent_path(), "curves/", curves, entries, "");
  entries["bench.toml"] = regression::toml_text(*bench);
}

/// A bundle holds no secrets: it names the tokens file by its absolute path.
void locate_tokens(ConfigNode& node, const fs::path& folder) {
  auto* const text = std::get_if<std::string>(&node.scalar);
  if (node.key == "tokens_file" && text != nullptr) *text = fs::absolute(folder / *text).lexically_normal();
  for (ConfigNode& child : node.children)
    locate_tokens(child, folder);
}

/// The case, and of the words of its command those that are files in its folder.
void add_case(const Case& c, Entries& entries) {
  const fs::path folder = fs::path(c.file).parent_path();
  ConfigNode table = regression::table_of(c);
  std::size_t goldens = 0;
  for (ConfigNode& child : table.children) {
    if (child.key == "dut") locate_tokens(child, folder);
    if (child.key == "check") take_files(child, folder, "golden-", goldens, entries, "case/");
  }
  entries["case/case.toml"] = regression::toml_text(table);
  for (const std::string& word : c.device.command) {
    const fs::path inside = fs::path(word).lexically_normal();
    std::error_code error;
    if (inside.is_absolute() || inside.empty() || *inside.begin() == "..") continue;
    if (fs::is_regular_file(folder / inside, error))
      entries["case/" + inside.generic_string()] = bytes_of(folder / inside);
  }
}

std::string facts_text(const BundleContent& content) {
  ConfigNode table;
  const auto add = [&table](const char* key, auto value) {
    table.children.push_back(
        {.key = key, .line = 0, .kind = ConfigNode::Kind::kScalar, .scalar = value, .children = {}});
  };
  add("format", std::int64_t{1});
  add("program", content.program);
  add("name", content.what.name);
  add("verdict", std::string(word_of(content.result.verdict)));
  add("hash", fmt::format("{:016x}", content.result.hash));
  return regression::toml_text(table);
}

}  // namespace

fs::path bundle_of(const fs::path& folder, const std::string& name) {
  std::string file = name;
  std::ranges::replace(file, '/', '_');
  if (file.size() > kLongestName)
    file = fmt::format("{}-{:016x}", file.substr(0, kLongestName), regression::text_hash(name));
  return folder / (file + ".zip");
}

void write_bundle(const fs::path& file, const BundleContent& content) {
  Entries entries;
  add_bench(content, entries);
  add_case(content.what, entries);
  entries["bundle.toml"] = facts_text(content);
  entries["output.txt"] = content.result.output;
  if (!content.result.messages.empty())
    entries["messages.txt"] = fmt::format("{}\n", fmt::join(content.result.messages, "\n"));
  std::error_code none;
  if (fs::exists(content.recording, none)) entries["run.mcap"] = bytes_of(content.recording);
  std::vector<archive::Entry> list;
  list.reserve(entries.size());
  for (auto& [name, bytes] : entries)
    list.push_back({name, std::move(bytes)});
  fs::create_directories(file.parent_path());
  archive::write_zip(file, list);
}

}  // namespace drivebench::command
