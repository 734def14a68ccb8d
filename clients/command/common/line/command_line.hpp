#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "clients/command/common/session/link_choice.hpp"
#include "protocols/pages/limits.hpp"
#include "protocols/pages/line_description.hpp"

namespace drivebench::command {

/// The addresses that --link accepts, for its help.
inline constexpr const char* kStreamLinks = "tcp:HOST:PORT, tls:HOST:PORT?ca=FILE, unix:PATH or shm:PATH";

/// A subcommand and its options; both live as long as the command line.
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
    if constexpr (requires { options->json; }) {
      sub.add_flag("--json", json_, "print JSON instead of text")->group(pages::kOutput);
      when_named(sub, [this, options, action] {
        options->json = json_;
        return action(*options);
      });
    } else {
      when_named(sub, [options, action] { return action(*options); });
    }
    return {sub, *options};
  }
  template <class Options, class Run>
  Verb<Options> add(const std::string& name, const std::string& description, Run action) {
    return add<Options>(app_, name, description, action);
  }

  /// Sets the action that runs if the command line names this subcommand and is valid.
  void when_named(CLI::App& sub, std::function<int()> action);

  /// Parses the command line, runs the named subcommand and prints errors; returns the exit code.
  int run(int argc, char** argv);

 private:
  int parse_and_run(int argc, char** argv);
  int fail(int code, std::string_view kind, std::string_view message, std::string_view field = {}) const;

  CLI::App app_{"drivebench: a hardware-in-the-loop test bench for electric drives."};
  std::function<int()> action_;
  bool json_ = false;
};

/// Adds --link and --token, with the defaults DRIVEBENCH_LINK and DRIVEBENCH_TOKEN. `links` lists the
/// addresses that --link accepts.
void add_link(CLI::App& sub, LinkChoice& link, const std::string& links = kStreamLinks);
/// add_link() with another help text.
void add_link_with_help(CLI::App& sub, LinkChoice& link, const std::string& help);

/// The options that are added next stand under this heading in --help and on the man page.
inline void begin_group(CLI::App& sub, const char* heading) {
  sub.option_defaults()->group(heading);
}

// What the options of every room use.
using pages::finite_between;
using pages::kConnection;
using pages::kLimits;
using pages::kMost_s;
using pages::kOutput;
using pages::kWhat;
using pages::not_negative;
using pages::whole_between;

/// The upper limit of options without a limit of their own.
inline constexpr double kMost = 1e15;

}  // namespace drivebench::command
