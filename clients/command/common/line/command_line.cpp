#include "clients/command/common/line/command_line.hpp"

#include <fmt/core.h>

#include <cstdio>
#include <cstdlib>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/common/line/pages.hpp"
#include "clients/command/common/line/version.hpp"
#include "clients/link/tcp/tcp_link.hpp"
#include "protocols/json.hpp"
#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {

CommandLine::CommandLine() {
  app_.require_subcommand(1);
  pages::add_pages(app_, program_of_pages());
  app_.set_version_flag("--version", version_line(), "print version and build and end")->group(pages::kHelp);
  app_.footer(
      "Example:\n"
      "  drivebench demo                     # a servo move, in lockstep and in real time\n"
      "  drivebench serve                    # a bench; in another terminal:\n"
      "  drivebench control                  # the reference controller moves its motor\n"
      "VERB --help tells the options of a verb.\n"
      "Exit codes: 0 ok, 1 the run failed, 2 usage or configuration, 3 cannot connect.");
}

void CommandLine::when_named(CLI::App& sub, std::function<int()> action) {
  sub.callback([this, action = std::move(action)] { action_ = action; });
}

int CommandLine::run(int argc, char** argv) {
  try {
    return parse_and_run(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app_.exit(error) == 0 ? kExitOk : kExitUsage;
  } catch (const UsageError& error) {
    return fail(kExitUsage, "usage", error.what());
  } catch (const link::AddressError& error) {
    return fail(kExitUsage, "usage", error.what());
  } catch (const link::ConnectError& error) {
    return fail(kExitNoConnect, "connect", error.what());
  } catch (const link::RefusalError& refused) {
    return fail(kExitFailed, "refused", refused.what(), refused.field());
  } catch (const std::exception& error) {
    return fail(kExitFailed, "failed", error.what());
  }
}

int CommandLine::parse_and_run(int argc, char** argv) {
  if (argc > 1 && argv[1][0] != '-') {
    const auto is_named = [&](const CLI::App* sub) { return sub->get_name() == argv[1]; };
    if (app_.get_subcommands(is_named).empty()) {
      std::vector<std::string> verbs;
      for (const CLI::App* sub : app_.get_subcommands(nullptr))
        verbs.push_back(sub->get_name());
      throw UsageError(
          fmt::format("no verb '{}'{}; --help lists them", printable(argv[1]), did_you_mean(argv[1], verbs)));
    }
  }
  app_.parse(argc, argv);
  return action_();
}

int CommandLine::fail(int code, std::string_view kind, std::string_view message,
                      std::string_view field) const {
  std::fflush(stdout);
  if (json_) {
    const Json error = {{"error", {{"kind", kind}, {"message", message}, {"field", field}}}};
    fmt::print("{}\n", json_text(error));
  }
  fmt::print(stderr, "drivebench: {}\n", message);
  return code;
}

void add_link(CLI::App& sub, LinkChoice& link, const std::string& links) {
  add_link_with_help(sub, link, "address of the bench: " + links + "; else from DRIVEBENCH_LINK");
  sub.get_option("--link")->default_str(
      LinkChoice{}.address);  // of man pages, too, wherever they are written
}

void add_link_with_help(CLI::App& sub, LinkChoice& link, const std::string& help) {
  // Not CLI11's envname(): it lets the options of subcommands that were not named overwrite ours.
  if (const char* address = std::getenv("DRIVEBENCH_LINK"); address != nullptr) link.address = address;
  if (const char* token = std::getenv("DRIVEBENCH_TOKEN"); token != nullptr) link.token = token;
  sub.add_option("--link", link.address, help)->type_name("ADDRESS")->group(pages::kConnection);
  sub.add_option("--token", link.token, "the secret that the server asks for; else from DRIVEBENCH_TOKEN")
      ->type_name("TOKEN")
      ->group(pages::kConnection);
}

}  // namespace drivebench::command
