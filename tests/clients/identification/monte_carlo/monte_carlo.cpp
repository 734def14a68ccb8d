#include "tests/clients/identification/monte_carlo/monte_carlo.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <future>
#include <numbers>
#include <sstream>

namespace drivebench::identification {
namespace {

/// The part of a line that another run must give again.
enum class Check { kAll, kNumbers, kTwoCells };

struct Line {
  std::string text;
  Check check = Check::kAll;
};

constexpr std::string_view kHead =
    R"(# Identification of random motors

Made by `drivebench-identification > tests/book/IDENTIFICATION.md`: {} motors of each kind, each
identified {} times with other noise, in process, on the product's bench. Their parameters are drawn
around a motor of the book, evenly in the logarithm. The test
`MonteCarlo.TheTableEqualsTheResultsOfTheExperiments` runs the first {} motors of each kind again and compares.

Sensors: a floor encoder; converters of 12 bits for currents and voltages, both with white noise of one
step rms. Errors of gain and offset are not among them: a gain error goes into the parameters as it is,
and no index knows of it.

Two estimates stand side by side: that of the book's least squares, and the refined one that the identification
states.

* **error**: of an estimate, without its sign, in percent of the truth; worst with the number of the motor.
* **in the index**: how often the truth lies within the parametric error index of the equations. The index tells
  how far a parameter can go until their squared error is twice (induction: 1.25 times) as large. It is no
  standard deviation.
* **in the interval**: how often the truth lies within the 95 % interval of the refined estimate; **interval** is
  the median of its half, **over the error** how many times the median error that is. Behind it stands what exact
  intervals would give: the same widths, and errors that are normal with 1/1.96 of them. It is 2.91 where all
  motors are known equally well, and more where some are known much better than others. Narrower intervals would
  hold in fewer than 95 % of the cases.
* **not stated**: estimates that the verdict took back. They do not count in the other columns.
)";

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size()))) - 1];
}

std::string percent(double part) {
  if (!std::isfinite(part)) return "-";
  const double value = 100.0 * part;
  const double size = std::abs(value);
  return fmt::format("{:.{}f} %", value, size < 1.0 ? 3 : size < 10.0 ? 2 : size < 100.0 ? 1 : 0);
}

std::string range_text(const Range& range) {
  if (range.high == 0.0) return "-";
  return fmt::format("{:g} to {:g}{}{}", range.low, range.high, range.unit.empty() ? "" : " ", range.unit);
}

constexpr double kDeviations = 1.96;  ///< in half of a 95 % interval

/// The median size of errors that are normal, each with the standard deviation of its interval.
double exact_median_error(const std::vector<double>& intervals) {
  if (intervals.empty()) return std::nan("");
  const auto share_below = [&](double error) {
    double sum = 0.0;
    for (const double interval : intervals)
      sum += std::erf(error * kDeviations / (interval * std::numbers::sqrt2));
    return sum / static_cast<double>(intervals.size());
  };
  double low = 0.0;
  double high = *std::max_element(intervals.begin(), intervals.end());  // 95 % are below it
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = 0.5 * (low + high);
    (share_below(middle) < 0.5 ? low : high) = middle;
  }
  return high;
}

/// The errors of one parameter in all trials of a kind.
struct Summary {
  std::vector<double> by_equations{};  ///< errors
  std::vector<double> errors{};
  std::vector<double> intervals{};  ///< over the truth
  double worst = 0.0;
  int worst_motor = 0;
  int in_index = 0;
  int in_interval = 0;
  int unstated = 0;
};

Summary summary_of(const Trials& trials, std::size_t parameter) {
  Summary s;
  for (std::size_t trial = 0; trial < trials.findings.size(); ++trial) {
    const Finding& f = trials.findings[trial][parameter];
    if (!f.stated) {
      ++s.unstated;
      continue;
    }
    if (std::isfinite(f.by_equations)) {  // a curve is none of the equations
      s.by_equations.push_back(std::abs(f.error_by_equations()));
      s.in_index += f.covered_by_index() ? 1 : 0;
    }
    s.errors.push_back(std::abs(f.error()));
    s.intervals.push_back(f.interval / f.truth);
    s.in_interval += f.covered() ? 1 : 0;
    if (s.errors.back() < s.worst) continue;
    s.worst = s.errors.back();
    s.worst_motor = static_cast<int>(trial) / trials.noises + 1;
  }
  return s;
}

std::string summary_line(const Trials& trials, std::size_t parameter) {
  const Range range = trials.draw->rows()[parameter];
  const Summary s = summary_of(trials, parameter);
  const auto of = [](int part, std::size_t all) {
    return percent(all == 0 ? std::nan("") : part / static_cast<double>(all));
  };
  const double interval = percentile(s.intervals, 0.5);
  return fmt::format(
      "| {} | {} | {} | {} | {} | {} | {} | {} (no. {}) | {} | {} | {:.2f} ({:.2f}) | {} |", range.name,
      range_text(range), percent(percentile(s.by_equations, 0.5)), percent(percentile(s.by_equations, 0.95)),
      of(s.in_index, s.by_equations.size()), percent(percentile(s.errors, 0.5)),
      percent(percentile(s.errors, 0.95)), percent(s.errors.empty() ? std::nan("") : s.worst), s.worst_motor,
      of(s.in_interval, s.errors.size()), percent(interval), interval / percentile(s.errors, 0.5),
      interval / exact_median_error(s.intervals), s.unstated);
}

std::string motor_line(const Trials& trials, int number) {
  const auto noises = static_cast<std::size_t>(trials.noises);
  std::string line = fmt::format("| {} |", number);
  for (const Finding& f : trials.findings[static_cast<std::size_t>(number - 1) * noises]) {
    line += fmt::format(" {:g}:", f.truth);
    line += f.stated ? fmt::format(" {} ( {} )", percent(f.error()), percent(f.interval / f.truth))
                     : " not stated";
    line += " |";
  }
  return line;
}

void add_kind(std::vector<Line>& lines, const Trials& trials) {
  const MotorDraw& draw = *trials.draw;
  lines.push_back({});
  lines.push_back({fmt::format("## {}", draw.name)});
  lines.push_back({});
  std::string others;
  for (const Range& range : draw.others)
    others +=
        fmt::format("{} {} {}", others.empty() ? " Drawn as well:" : ",", range.name, range_text(range));
  lines.push_back(
      {fmt::format("Bench `{}`. {}{}", draw.bench, draw.experiment, others.empty() ? "" : others + ".")});
  lines.push_back({});
  lines.push_back(
      {"| parameter | drawn from | equations: median error | 95 % below | in the index | refined: median "
       "error | "
       "95 % below | worst | in the interval | interval | over the error | not stated |"});
  lines.push_back({"|---|---|---|---|---|---|---|---|---|---|---|---|"});
  for (std::size_t k = 0; k < draw.rows().size(); ++k)
    lines.push_back({summary_line(trials, k), Check::kTwoCells});
  lines.push_back({});
  lines.push_back({fmt::format(
      "The first {} motors with the first noise: truth, error (half of the interval).", kShownMotors)});
  lines.push_back({});
  std::string names = "| no. |";
  std::string rule = "|---|";
  for (const Range& range : draw.rows()) {
    names += fmt::format(" {}{}{} |", range.name, range.unit.empty() ? "" : " in ", range.unit);
    rule += "---|";
  }
  lines.push_back({names});
  lines.push_back({rule});
  for (int number = 1; number <= kShownMotors; ++number)
    lines.push_back({motor_line(trials, number), Check::kNumbers});
}

constexpr std::string_view kVerdictHead =
    R"(
## Verdicts

{} motors of each kind, the first noise: the experiments above; a part of each record, 3 to 50 % long, that begins
anywhere; and pole pairs that are not the motor's.

* **certified**: every parameter is stated, `drivebench identify` ends with 0 and writes a motor file.
* **false**: a stated parameter lies more than 5 % and more than twice its interval off the truth.
* **needless**: the motor is refused although every estimate lies within 5 % of the truth, friction and load within
  30 %. A part that shows most parameters and not all of them counts here too.

| motors | look | records | certified | false | needless |
|---|---|---|---|---|---|)";

void add_text(std::vector<Line>& lines, const std::string& text) {
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);)
    lines.push_back({line});
}

void add_verdicts(std::vector<Line>& lines, const std::vector<VerdictTrials>& verdicts) {
  add_text(lines, fmt::format(fmt::runtime(kVerdictHead), kVerdictMotors));
  for (const VerdictTrials& trial : verdicts) {
    int records = 0;
    int certified = 0;
    int wrong = 0;
    int needless = 0;
    for (const VerdictFinding& f : trial.findings) {
      records += f.applies ? 1 : 0;
      certified += f.certified ? 1 : 0;
      wrong += f.wrong ? 1 : 0;
      needless += f.right && !f.certified ? 1 : 0;
    }
    if (records == 0) continue;
    lines.push_back(
        {fmt::format("| {} | {} | {} | {} | {} | {} |", trial.draw->name,
                     kLooks[static_cast<std::size_t>(trial.look)], records, certified, wrong, needless),
         Check::kTwoCells});
  }
}

std::vector<Line> lines_of(const std::vector<Trials>& trials, const std::vector<VerdictTrials>& verdicts) {
  std::vector<Line> lines;
  add_text(lines, fmt::format(fmt::runtime(kHead), kAllMotors, kAllNoises, kShownMotors));
  for (const Trials& each : trials)
    add_kind(lines, each);
  add_verdicts(lines, verdicts);
  return lines;
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;)
    words.push_back(word);
  return words;
}

/// Two words that are the same, or two numbers that nearly are.
bool agree(const std::string& word, const std::string& wanted) {
  if (word == wanted) return true;
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (end == word.c_str() || *end != '\0') return false;
  const double expected = std::strtod(wanted.c_str(), &end);
  if (end == wanted.c_str() || *end != '\0') return false;
  return std::abs(value - expected) <= 0.002 + 0.02 * std::abs(expected);
}

bool agrees(const std::string& line, const Line& wanted) {
  if (wanted.check == Check::kTwoCells) {
    std::size_t end = 0;
    for (int bar = 0; bar < 3; ++bar)
      end = wanted.text.find('|', end) + 1;
    const auto bars = [](const std::string& text) { return std::count(text.begin(), text.end(), '|'); };
    return line.starts_with(wanted.text.substr(0, end)) && bars(line) == bars(wanted.text);
  }
  if (wanted.check == Check::kAll) return line == wanted.text;
  const std::vector<std::string> words = words_of(line);
  const std::vector<std::string> expected = words_of(wanted.text);
  return std::equal(words.begin(), words.end(), expected.begin(), expected.end(), agree);
}

}  // namespace

std::vector<Trials> run_trials(std::span<const MotorDraw> draws, const MonteCarloPlan& plan) {
  std::vector<Trials> trials;
  const auto per_kind = static_cast<std::size_t>(plan.motors) * static_cast<std::size_t>(plan.noises);
  for (const MotorDraw& draw : draws)
    trials.push_back(
        {.draw = &draw, .noises = plan.noises, .findings = std::vector<std::vector<Finding>>(per_kind)});
  const auto run_part = [&](std::size_t thread) {
    for (std::size_t k = thread; k < per_kind * draws.size(); k += static_cast<std::size_t>(plan.threads)) {
      Trials& kind = trials[k / per_kind];
      const int trial = static_cast<int>(k % per_kind);
      kind.findings[k % per_kind] =
          identify_motor(*kind.draw, trial / plan.noises + 1, trial % plan.noises + 1);
    }
  };
  std::vector<std::future<void>> parts;
  for (std::size_t thread = 0; thread < static_cast<std::size_t>(plan.threads); ++thread)
    parts.push_back(std::async(std::launch::async, run_part, thread));
  for (std::future<void>& part : parts)
    part.get();
  return trials;
}

std::vector<Trials> run_table(const MonteCarloPlan& plan) {
  std::vector<Trials> trials = run_trials(motor_draws(), plan);
  MonteCarloPlan once = plan;
  once.noises = 1;
  trials.push_back(std::move(run_trials({&saturated_draw(), 1}, once).front()));
  return trials;
}

std::string markdown_of(const std::vector<Trials>& trials, const std::vector<VerdictTrials>& verdicts) {
  std::string text;
  for (const Line& line : lines_of(trials, verdicts))
    text += line.text + "\n";
  return text;
}

std::vector<std::string> differences(const std::string& text, const std::vector<Trials>& trials,
                                     const std::vector<VerdictTrials>& verdicts) {
  std::vector<std::string> found;
  std::istringstream lines(text);
  std::string line;
  for (const Line& wanted : lines_of(trials, verdicts)) {
    if (!std::getline(lines, line)) {
      found.push_back("the text ends before: " + wanted.text);
      return found;
    }
    if (!agrees(line, wanted)) found.push_back("not '" + wanted.text + "': " + line);
  }
  if (std::getline(lines, line)) found.push_back("the text goes on: " + line);
  return found;
}

}  // namespace drivebench::identification
