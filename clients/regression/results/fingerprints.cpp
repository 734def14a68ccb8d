#include "clients/regression/results/fingerprints.hpp"

#include <fmt/core.h>

#include <fstream>
#include <iterator>

#include "clients/regression/suite/compose.hpp"

namespace drivebench::regression {

namespace fs = std::filesystem;

std::uint64_t text_hash(std::string_view text) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text)
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return hash;
}

std::string Fingerprints::of(const Case& c, const fs::path& bench_file) {
  std::string text = fmt::format("{}\n{}\n{:x}\n{:x}", program_, c.name, content(c.file), bench(bench_file));
  for (const CheckSpec& check : c.checks) {
    if (!check.golden_file.empty()) text += fmt::format("\n{:x}", content(check.golden_file));
  }
  for (const std::string& word : c.device.command)
    text += fmt::format("\n{:x}", content(fs::path(c.file).parent_path() / word));
  return fmt::format("{:016x}", text_hash(text));
}

std::uint64_t Fingerprints::bench(const fs::path& file) {
  const auto [place, is_new] = benches_.try_emplace(file);
  if (!is_new) return place->second;
  const Case blank{.name = {}, .file = {}, .bench = file.string()};
  const std::string text = composed_bench(blank, file);
  // Curves stay in files of their own, which the text names by their absolute paths.
  constexpr std::string_view kEnd = ".csv\"";
  std::string curves;
  for (std::size_t end = text.find(kEnd); end != std::string::npos; end = text.find(kEnd, end + 1)) {
    const std::size_t start = text.rfind('"', end) + 1;
    curves += fmt::format("\n{:x}", content(text.substr(start, end + 4 - start)));
  }
  place->second = text_hash(text + curves);
  return place->second;
}

std::uint64_t Fingerprints::content(const fs::path& file) {
  const auto [place, is_new] = contents_.try_emplace(file, 0);
  std::error_code ignored;
  if (!is_new || !fs::is_regular_file(file, ignored)) return place->second;
  std::ifstream in(file, std::ios::binary);
  place->second = text_hash(std::string(std::istreambuf_iterator<char>(in), {}));
  return place->second;
}

}  // namespace drivebench::regression
