// A case of a suite is refused with places and rules, or every combination of its matrix is a case.
#include <algorithm>
#include <string>

#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/suite/matrix.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

constexpr std::size_t kMostCases = 20;

void read_cases(const drivebench::ConfigNode& root) {
  using namespace drivebench;
  using namespace drivebench::regression;
  // This folder does not exist, so that no file of this machine is read.
  const std::string file = "/nonexistent-folder/case.toml";
  ProblemList problems;
  const Matrix matrix(root, file, problems);
  problems.throw_if_any();
  for (std::size_t i = 0; i < std::min(matrix.size(), kMostCases); ++i) {
    const ConfigNode table = matrix.at(i, root, file, problems);
    problems.throw_if_any();
    const Case c = case_in(table, file, "case");
    for (const CheckSpec& check : c.checks) {
      fuzz::require(check.kind != nullptr && !check.name.empty(), "a check has a kind and a name");
      if (!check.formula) continue;
      Sample sample;
      const std::vector<std::size_t> places(check.formula->axes().size(), 0);
      check.formula->value(std::span(&sample, 1), 0, places);
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  const std::string text(reinterpret_cast<const char*>(data), size);
  if (text.find("golden") != std::string::npos) return 0;  // names a file of this machine
  ProblemList problems;
  const auto root = parse_document(text, "case.toml", problems);
  try {
    if (root) read_cases(*root);
  } catch (const ConfigError& error) {
    fuzz::require(!error.problems().empty(), "a refusal has reasons");
    for (const ConfigProblem& problem : error.problems())
      fuzz::require(!problem.rule.empty() && problem.line >= 0, "a reason is a sentence with a place");
  }
  return 0;
}
