#include "tests/book/results/results.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <sstream>

namespace drivebench {
namespace {

constexpr std::string_view kHead =
    "# The control and identification experiments of the book\n"
    "\n"
    "Made by `drivebench-results > tests/book/RESULTS.md` from runs of the presets of `clients/control` on "
    "the benches of\n"
    "`configs/benches`, in process; the test `Results.TheTableEqualsTheResultsOfTheExperiments` runs them "
    "again and "
    "compares.\n"
    "Numbers are those of the acceptance list of the book. \"Derived\" and \"simulated\" mark results "
    "that "
    "the book does not\n"
    "print: closed forms of its equations, and separate programs with the same settings. A count is a "
    "step of the\n"
    "encoder.\n";

std::string text_of(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), std::abs(value) < 1e4 ? "%.4g" : "%.0f", value);
  return text.data();
}

std::string before(const Measured& m) {
  return m.what.empty() ? "" : m.what + " ";
}

std::string after(const Measured& m) {
  return m.unit.empty() ? "" : " " + m.unit;
}

std::string cell_of(const std::vector<Measured>& measured) {
  std::string cell;
  for (const Measured& m : measured)
    cell += (cell.empty() ? "" : "; ") + before(m) + text_of(m.value) + after(m);
  return cell;
}

std::string row_of(const Result& r) {
  return "| " + r.number + " | " + r.experiment + " | " + r.book + " | " + cell_of(r.measured) + " | " +
         r.why + " |";
}

std::vector<std::string> split(const std::string& text, const std::string& separator) {
  std::vector<std::string> parts;
  std::size_t start = 0;
  for (std::size_t end = 0; (end = text.find(separator, start)) != std::string::npos;
       start = end + separator.size())
    parts.push_back(text.substr(start, end - start));
  parts.push_back(text.substr(start));
  return parts;
}

/// Whether a part of a cell is this number, within its tolerance.
bool agrees(const std::string& part, const Measured& m) {
  if (!part.starts_with(before(m)) || !part.ends_with(after(m))) return false;
  const std::string digits = part.substr(before(m).size(), part.size() - before(m).size() - after(m).size());
  char* end = nullptr;
  const double value = std::strtod(digits.c_str(), &end);
  return end != digits.c_str() && *end == '\0' &&
         std::abs(value - m.value) <= m.tolerance + 6e-4 * std::abs(m.value);
}

std::string difference(const std::string& line, const Result& r) {
  const std::vector<std::string> cells = split(line, " | ");
  if (cells.size() != 5) return "no row of five cells: " + line;
  if (cells[0] != "| " + r.number || cells[1] != r.experiment || cells[2] != r.book ||
      cells[4] != r.why + " |") {
    return r.number + ": the text is not that of the program: " + line;
  }
  const std::vector<std::string> parts = split(cells[3], "; ");
  bool same = parts.size() == r.measured.size();
  for (std::size_t i = 0; same && i < parts.size(); ++i)
    same = agrees(parts[i], r.measured[i]);
  return same ? ""
              : r.number + ": " + r.experiment + ": the table has " + cells[3] + ", the run " +
                    cell_of(r.measured);
}

}  // namespace

std::vector<ResultSection> all_results() {
  return {field_oriented_results(), high_speed_results(),        optimum_torque_results(),
          flux_observer_results(),  transformer_results(),       pm_results(),
          stepper_results(),        other_synchronous_results(), dc_results(),
          wound_dc_results(),       steady_state_results(),      identification_results(),
          classical_results()};
}

std::string markdown_of(const std::vector<ResultSection>& sections) {
  std::string text(kHead);
  for (const ResultSection& section : sections) {
    text += "\n## " + section.title +
            "\n\n| case | experiment | the book | drivebench | why they differ |\n" +
            "|---|---|---|---|---|\n";
    for (const Result& r : section.results)
      text += row_of(r) + "\n";
  }
  return text;
}

std::vector<std::string> differences(const std::string& text, const std::vector<ResultSection>& sections) {
  std::vector<std::string> found;
  std::istringstream lines(text);
  std::istringstream expected(markdown_of(sections));
  std::vector<const Result*> rows;
  for (const ResultSection& section : sections) {
    for (const Result& r : section.results)
      rows.push_back(&r);
  }
  std::size_t row = 0;
  std::string line;
  for (std::string wanted; std::getline(expected, wanted);) {
    if (!std::getline(lines, line)) {
      found.push_back("the table ends before: " + wanted);
      return found;
    }
    const bool is_row = row < rows.size() && wanted == row_of(*rows[row]);
    const std::string problem = is_row           ? difference(line, *rows[row++])
                                : line == wanted ? ""
                                                 : "not '" + wanted + "': " + line;
    if (!problem.empty()) found.push_back(problem);
  }
  if (std::getline(lines, line)) found.push_back("the table goes on: " + line);
  return found;
}

}  // namespace drivebench
