// A bench file is refused with places and rules, or it means the same after it was written down.
#include "server/config/config.hpp"

#include <string_view>

#include "tests/fuzz/fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  const auto bytes = fuzz::as_bytes_of(data, size);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  BenchConfig config;
  try {
    // This folder does not exist, so that no file of this machine is read.
    config = parse_config(text, "fuzz.toml", "/nonexistent-folder");
  } catch (const ConfigError& error) {
    fuzz::require(!error.problems().empty(), "a refusal has reasons");
    for (const ConfigProblem& problem : error.problems())
      fuzz::require(!problem.rule.empty() && problem.line >= 0, "a reason is a sentence with a place");
    return 0;
  }
  const std::string written = to_toml(config);
  try {
    const BenchConfig again = parse_config(written, "written.toml", {});  // as in a recording
    fuzz::require(configuration_hash(again) == configuration_hash(config),
                  "the samples have the same meaning");
    fuzz::require(to_toml(again) == written, "it reads back equal");
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n%s\n", error.what(), written.c_str());
    fuzz::require(false, "the product reads its own text");
  }
  return 0;
}
