#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <string>

#include "protocols/pages/completion.hpp"
#include "protocols/pages/man_page.hpp"

namespace drivebench::pages {
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

}  // namespace
}  // namespace drivebench::pages
