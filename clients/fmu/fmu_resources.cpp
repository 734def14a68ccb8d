#include "clients/fmu/fmu_resources.hpp"

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "clients/regression/suite/compose.hpp"
#include "clients/regression/tables/toml_text.hpp"
#include "protocols/document.hpp"

namespace drivebench::fmu {
namespace fs = std::filesystem;
namespace {

/// Moves the CSV files that a bench names beside it.
class Curves {
 public:
  explicit Curves(ProblemList& problems) : problems_(problems) {}

  void collect(ConfigNode& node) {
    auto* const text =
        node.kind == ConfigNode::Kind::kScalar ? std::get_if<std::string>(&node.scalar) : nullptr;
    if (text != nullptr && text->ends_with(".csv")) *text = moved(*text);
    for (ConfigNode& child : node.children)
      collect(child);
  }
  std::vector<archive::Entry> take() { return std::move(entries_); }

 private:
  std::string moved(const fs::path& file) {
    FileText content = read_file(file, kMaxRecordedConfigBytes);
    if (!content.why_not.empty()) problems_.add(file.string(), 0, "", content.why_not);
    std::string name = std::to_string(entries_.size() + 1) + "-" + file.filename().string();
    entries_.push_back({.name = name, .bytes = std::move(content.text)});
    return name;
  }

  ProblemList& problems_;
  std::vector<archive::Entry> entries_;
};

}  // namespace

std::vector<archive::Entry> resources_of(const fs::path& bench_file) {
  const std::string whole = regression::composed_bench(regression::Case{}, bench_file);
  ProblemList problems;
  std::optional<ConfigNode> bench = parse_document(whole, bench_file.string(), problems);
  problems.throw_if_any();
  Curves curves(problems);
  curves.collect(*bench);
  problems.throw_if_any();
  std::vector<archive::Entry> files = curves.take();
  files.insert(files.begin(), {.name = "bench.toml", .bytes = regression::toml_text(*bench)});
  return files;
}

}  // namespace drivebench::fmu
