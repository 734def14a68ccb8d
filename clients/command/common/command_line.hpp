#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "clients/command/common/link_choice.hpp"

namespace drivebench::command {

/// What --link takes, for its help.
inline constexpr const char* kStreamLinks = "tcp:HOST:PORT, tls:HOST:PORT?ca=FILE or unix:PATH";

/// A subcommand and the options that its command line fills; both last as long as the command line.
template <class Options>
struct Verb {
  CLI::App& app;
  Options& options;
};

/// The command line of `drivebench`. Each room adds its verbs: a verb is a struct of options and a function
/// that takes them and gives the exit code.
class CommandLine {
 public:
  CommandLine();

  CLI::App& app() noexcept { return app_; }

  /// A subcommand of `parent`. Where Options has a member `json` the subcommand has the flag --json.
  template <class Options, class Run>
  Verb<Options> add(CLI::App& parent, const std::string& name, const std::string& description, Run action) {
    CLI::App& sub = *parent.add_subcommand(name, description);
    const auto options = std::make_shared<Options>();
    if constexpr (requires { options->json; }) sub.add_flag("--json", json_, "print JSON");
    when_named(sub, [this, options, action] {
      if constexpr (requires { options->json; }) options->json = json_;
      return action(*options);
    });
    return {sub, *options};
  }
  template <class Options, class Run>
  Verb<Options> add(const std::string& name, const std::string& description, Run action) {
    return add<Options>(app_, name, description, action);
  }

  /// What runs when the command line has named this subcommand and all of it is good.
  void when_named(CLI::App& sub, std::function<int()> action);

  /// Parses, runs the subcommand that is named and prints what went wrong; gives the exit code.
  int run(int argc, char** argv);

 private:
  int parse_and_run(int argc, char** argv);
  int fail(int code, std::string_view kind, std::string_view message, std::string_view field = {}) const;

  CLI::App app_{"drivebench: a hardware-in-the-loop test bench for electric drives."};
  std::function<int()> action_;
  bool json_ = false;
};

/// --link and --token, whose defaults are DRIVEBENCH_LINK and DRIVEBENCH_TOKEN. `links` says what --link
/// takes.
void add_link(CLI::App& sub, LinkChoice& link, const std::string& links = kStreamLinks);
/// The same with a help text of its own.
void add_link_with_help(CLI::App& sub, LinkChoice& link, const std::string& help);

// ---- what values must be ----

/// For unsigned options: without it -1 is 2^64 - 1.
CLI::Validator not_negative();

/// For real options. CLI11's own ranges let NaN pass, with which no comparison is true.
CLI::Validator finite_between(double low, double high);

/// The high of an option for which its own meaning has none.
inline constexpr double kMost = 1e15;
/// The same of one in seconds: they fit into nanoseconds of 64 bits.
inline constexpr double kMost_s = 1e9;

}  // namespace drivebench::command
