#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "protocols/pages/completion.hpp"
#include "protocols/pages/help_text.hpp"
#include "protocols/pages/limits.hpp"
#include "protocols/pages/man_page.hpp"
#include "protocols/pages/write_pages.hpp"

namespace drivebench::pages::pages_test {
namespace {

/// A verb whose texts have every sign that troff or a shell takes for its own.
LineVerb hostile_line() {
  CLI::App app("tool: .so /etc/passwd");
  CLI::App& sub = *app.add_subcommand("run", "it's [one] of \\fB: $HOME `id` -- \"that's\"");
  std::string text;
  int number = 0;
  bool flag = false;
  sub.add_option("FILE", text, "what to read")->required()->type_name("FILE");
  sub.add_option("--mode", text, "the way]: it's")->check(CLI::IsMember({"fast", "slow"}));
  sub.add_option("--count", number, "so many")->check(CLI::Range(1, 127))->needs("--mode")->group("Numbers");
  sub.add_flag("--dry", flag, "only print");
  sub.footer("Example:\n  tool run .hidden\n\nA note.\nExit codes: 0 ok.");
  return describe_line(app, "tool");
}

const LineOption& option(const LineVerb& verb, std::size_t at) {
  return verb.options.at(at + 1);  // behind --help
}

// Catches: a flag that would wait for a value, a rule of CLI11 shown as the type of a value, a lost limit or
// need.
TEST(Pages, ALineIsDescribedAsCli11KnowsIt) {
  const LineVerb line = hostile_line();
  ASSERT_EQ(line.verbs.size(), 1U);
  const LineVerb& run = line.verbs.front();
  EXPECT_EQ(joined(run.path, " "), "tool run");
  EXPECT_TRUE(option(run, 0).positional);
  EXPECT_EQ(option(run, 0).value, "FILE");
  EXPECT_EQ(option(run, 1).words, (std::vector<std::string>{"fast", "slow"}));
  EXPECT_EQ(option(run, 2).range, "1 - 127");
  EXPECT_EQ(option(run, 2).needs, std::vector<std::string>{"--mode"});
  EXPECT_EQ(option(run, 3).value, "");
}

// Catches: a text that troff runs as a request or reads as an escape, and hyphens that cannot be copied into
// a shell.
TEST(Pages, TextsOfAManPageAreNoRequestsAndNoEscapes) {
  const LineVerb line = hostile_line();
  EXPECT_NE(man_page(line, {}).find("tool \\- \\&.so /etc/passwd\n"), std::string::npos)
      << man_page(line, {});
  const std::string page = man_page(line.verbs.front(), {.version = "tool 1", .date = "2026-01-31"});
  EXPECT_NE(page.find("it\\(aqs [one] of \\(rsfB: $HOME \\(gaid\\(ga \\-\\- \\(dqthat\\(aqs\\(dq\n"),
            std::string::npos)
      << page;
  EXPECT_NE(page.find(".TH TOOL\\-RUN 1 2026-01-31 \"tool 1\"\n"), std::string::npos);
  EXPECT_NE(page.find(".SS Numbers\n.TP\n\\fB\\-\\-count\\fR"), std::string::npos);
  EXPECT_NE(page.find("so many (1 to 127; needs \\-\\-mode)\n"), std::string::npos);
  EXPECT_NE(page.find(".SH EXAMPLES\n.nf\ntool run .hidden\n.fi\n.SH EXIT STATUS\nExit codes: 0 ok.\n"),
            std::string::npos);
}

// Catches: a text of --help that ends a string or a specification of the shell's.
TEST(Pages, TextsOfACompletionStayInTheirPlace) {
  const std::string script = zsh_completion(hostile_line(), {});
  EXPECT_NE(script.find("'run:it'\\''s [one] of \\\\fB: $HOME `id` -- \"that'\\''s\"'"), std::string::npos)
      << script;
  EXPECT_NE(script.find("'*--mode=[the way\\]: it'\\''s]:TEXT:(fast slow)'"), std::string::npos);
  EXPECT_EQ(bash_completion(hostile_line(), {}).find("it's"), std::string::npos);
}

// Catches: a limit against overflow told as if it were one of the motor's, a bound that is left out or told
// on the wrong side, and a colon in the name of a value taken for the start of a rule.
TEST(Pages, LimitsAreToldInWords) {
  CLI::App app("tool");
  double real = 0.0;
  int whole = 0;
  std::string text;
  app.add_option("--any", real)->type_name("NM")->check(finite_between(-1e15, 1e15));
  app.add_option("--positive", real)->type_name("OHM")->check(finite_between(1e-9, 1e9));
  app.add_option("--ratio", real)->type_name("SIGMA")->check(finite_between(1e-6, 0.5));
  app.add_option("--least", real)->type_name("SECONDS")->check(finite_between(0.25, 1e9));
  app.add_option("--port", whole)->type_name("PORT")->check(whole_between(0, 65535));
  app.add_option("--window", text)->type_name("FROM:TO");
  const LineVerb line = describe_line(app, "tool");
  std::vector<std::string> told;
  for (std::size_t i = 0; i < 6; ++i)
    told.push_back(option(line, i).value + remarks(option(line, i)));
  EXPECT_EQ(told, (std::vector<std::string>{"NM", "OHM (more than 0)", "SIGMA (more than 0, at most 0.5)",
                                            "SECONDS (0.25 or more)", "PORT (0 to 65535)", "FROM:TO"}));
}

// Catches: a line that a terminal of 80 columns breaks, an option outside its heading, a list shown as one
// value, a required option that the usage does not name, exit codes that a verb does not take from its
// program.
TEST(Pages, HelpHasHeadingsExamplesAndExitCodes) {
  CLI::App app("tool: works");
  add_pages(app, {.name = "tool", .groups = {{"Every day", {"run"}}}});
  app.footer("Example:\n  tool run --number 1\nExit codes: 0 ok.");
  CLI::App& sub = *app.add_subcommand("run", "do the work");
  std::vector<std::string> signals;
  int number = 0;
  sub.option_defaults()->group(kOutput);
  sub.add_option("--signals", signals, "what is shown")->type_name("SIGNAL")->delimiter(',');
  sub.option_defaults()->group(kConnection);
  sub.add_option("--number", number, "a number that is told in a sentence which is too long for one line")
      ->type_name("NUMBER")
      ->required();
  sub.footer("Example:\n  tool run --number 2");
  EXPECT_TRUE(
      app.help().starts_with("tool: works\n"
                             "\n"
                             "Usage: tool VERB [ARGUMENT ...]\n"
                             "\n"
                             "Every day:\n"
                             "  run                     do the work\n"
                             "\n"
                             "Help:\n"))
      << app.help();
  EXPECT_EQ(sub.help(),
            "tool run: do the work\n"
            "\n"
            "Usage: tool run --number NUMBER [OPTION ...]\n"
            "\n"
            "Connection:\n"
            "  --number NUMBER         a number that is told in a sentence which is too long\n"
            "                          for one line (must be given)\n"
            "\n"
            "Output:\n"
            "  --signals SIGNAL,...    what is shown\n"
            "\n"
            "Help:\n"
            "  -h, --help              print this help and end\n"
            "\n"
            "Example:\n"
            "  tool run --number 2\n"
            "\n"
            "Exit codes: 0 ok.\n");
}

// Catches: a message with CLI11's name for a type.
TEST(Pages, ErrorsSpeakInTheSameWords) {
  CLI::App app("tool");
  add_pages(app, {.name = "tool"});
  int number = 0;
  app.add_option("--number", number)->type_name("NUMBER")->check(whole_between(0, 3));
  std::ostringstream out;
  std::ostringstream problems;
  try {
    app.parse("--number");
  } catch (const CLI::ParseError& error) {
    app.exit(error, out, problems);
  }
  EXPECT_EQ(problems.str(), "--number: its value is missing\nRun with --help for more information.\n");
}

/// The first line that a program says about a command line that it refuses.
std::string first_problem(CLI::App& app, const std::string& line) {
  std::ostringstream out;
  std::ostringstream problems;
  try {
    app.parse(line);
  } catch (const CLI::ParseError& error) {
    app.exit(error, out, problems);
  }
  return problems.str().substr(0, problems.str().find('\n'));
}

/// What a tool with one option of each kind says about a line.
std::string refusal_of(const std::string& line) {
  CLI::App app("tool");
  add_pages(app, {.name = "tool"});
  double real = 0.0;
  std::uint64_t whole = 0;
  std::string text;
  app.add_option("--rate", real)->check(finite_between(1e-6, 1e15));
  app.add_option("--sigma", real)->check(finite_between(1e-6, 0.5));
  app.add_option("--wait", real)->check(finite_between(0.25, 1e9));
  app.add_option("--follow", real)->check(finite_between(0.001, 1000.0));
  app.add_option("--any", real)->check(finite_between(-1e15, 1e15));
  app.add_option("--port", whole)->check(whole_between(0, 65535));
  app.add_option("--from", whole)->check(not_negative());
  app.add_option("--format", text)->check(CLI::IsMember({"csv", "mat", "candump"}));
  app.add_option("--phases", whole)->check(CLI::IsMember({2, 3}));
  return first_problem(app, line);
}

// Catches: a limit against overflow told as if it were one of the motor's, a number that is not told as it
// was written, CLI11's words for a conversion and a choice, no suggestion for a misspelt word.
TEST(Pages, RefusalsHaveTheValueAsWrittenAndTheLimitThatMatters) {
  EXPECT_EQ(refusal_of("--rate 0"), "--rate: 0 is not a number above 0");
  EXPECT_EQ(refusal_of("--rate nan"), "--rate: nan is not a number above 0");
  EXPECT_EQ(refusal_of("--rate 1.50e16"), "--rate: 1.50e16 is not a number above 0 and at most 1e15");
  EXPECT_EQ(refusal_of("--rate 1e-7"), "--rate: 1e-7 is not a number of 1e-6 or more");
  EXPECT_EQ(refusal_of("--sigma 1e0"), "--sigma: 1e0 is not a number above 0 and at most 0.5");
  EXPECT_EQ(refusal_of("--wait 0.20"), "--wait: 0.20 is not a number of 0.25 or more");
  EXPECT_EQ(refusal_of("--follow 0"), "--follow: 0 is not a number from 0.001 to 1000");
  EXPECT_EQ(refusal_of("--any x"), "--any: x is not a number");
  EXPECT_EQ(refusal_of("--any 1e16"), "--any: 1e16 is not a number up to 1e15");
  EXPECT_EQ(refusal_of("--port 65536"), "--port: 65536 is not a whole number from 0 to 65535");
  EXPECT_EQ(refusal_of("--from 0.5"), "--from: 0.5 is not a whole number");
  EXPECT_EQ(refusal_of("--from x"), "--from: x is not a number");
  EXPECT_EQ(refusal_of("--format matt"),
            "--format: 'matt' is none of csv, mat, candump; did you mean \"mat\"?");
  EXPECT_EQ(refusal_of("--format qqqqq"), "--format: 'qqqqq' is none of csv, mat, candump");
  EXPECT_EQ(refusal_of("--phases 4"), "--phases: '4' is none of 2, 3");
}

/// What a tool with the verb `new`, and in it `motor` with the options --kv-rms and --poles, says about a
/// line.
std::string problem_with(const std::string& line) {
  CLI::App app;
  app.name("tool");
  add_pages(app, {.name = "tool"});
  CLI::App& motor = *app.add_subcommand("new")->add_subcommand("motor");
  double number = 0.0;
  motor.add_option("--kv-rms", number);
  motor.add_option("--poles", number);
  return first_problem(app, line);
}

// Catches: CLI11's list of what was left over, in reverse order; a value that is named in the place of its
// option; an option of another verb as the suggestion; a terminal that a strange word controls.
TEST(Pages, AnUnknownWordIsNamedWithItsVerb) {
  EXPECT_EQ(problem_with("new motor --poles 4 --kv 270"),
            "`tool new motor` has no option --kv; did you mean \"--kv-rms\"?");
  EXPECT_EQ(problem_with("new motor --pole=4"),
            "`tool new motor` has no option --pole; did you mean \"--poles\"?");
  EXPECT_EQ(problem_with("new motor --nothing-like-it 1 2"),
            "`tool new motor` has no option --nothing-like-it");
  EXPECT_EQ(problem_with("new motor -1 2"), "`tool new motor` takes no further word '-1'");
  EXPECT_EQ(problem_with("new moter"), "`tool new` takes no verb 'moter'; did you mean \"motor\"?");
  EXPECT_EQ(problem_with("new motor --\x1b[2J"), "`tool new motor` has no option --?[2J");
}

}  // namespace
}  // namespace drivebench::pages::pages_test
