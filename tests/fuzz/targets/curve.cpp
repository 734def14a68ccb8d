// A file of points is refused with the number of the wrong line, or it is a curve that reads back bit for
// bit.
#include <cstring>
#include <string_view>

#include "server/config/sections/curves.hpp"
#include "tests/fuzz/fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace drivebench;
  if (size == 0) return 0;
  const bool rising = (data[0] & 1) != 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  ProblemList problems;
  const auto points = parse_curve_csv(text, "curve.csv", rising, problems);
  bool refused = false;
  try {
    problems.throw_if_any();
  } catch (const ConfigError& error) {
    refused = true;
    fuzz::require(error.problems().size() == 1 && !error.problems()[0].rule.empty(),
                  "a refusal has one reason");
  }
  fuzz::require(refused != points.has_value(), "a file is a curve or refused");
  if (!points) return 0;
  fuzz::require(problem_with_points(*points, rising).empty(), "a curve that is taken keeps the rules");
  const std::string written = "c = " + curve_text(Curve(*points));
  const auto document = parse_document(written, "written.toml", problems, kMaxRecordedConfigBytes);
  fuzz::require(document.has_value(), "the product reads its own text");
  const ConfigNode& array = document->children.at(0);
  fuzz::require(array.children.size() == points->size(), "no point is lost");
  for (std::size_t i = 0; i < points->size(); ++i) {
    const CurvePoint back{std::get<double>(array.children[i].children.at(0).scalar),
                          std::get<double>(array.children[i].children.at(1).scalar)};
    fuzz::require(std::memcmp(&back, &(*points)[i], sizeof(back)) == 0, "a point keeps its bits");
  }
  return 0;
}
