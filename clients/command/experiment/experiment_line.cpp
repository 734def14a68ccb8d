#include "clients/command/experiment/experiment_line.hpp"

#include <cstdlib>
#include <string>

#include "clients/command/common/line_values.hpp"

namespace drivebench::command {
namespace {

using Run = int (*)(const ExperimentOptions&);

void add_file_options(CLI::App& sub, ExperimentOptions& options) {
  sub.add_option("--out", options.out_file, "CSV, or the recording if it ends with .mcap");
  sub.add_option("--patience", options.patience_s, "seconds that a broken link may stay broken")
      ->check(finite_between(0.0, kMost_s))
      ->capture_default_str();
}

void add_id(CLI::App& sub, ExperimentOptions& options) {
  sub.add_option("ID", options.id, "its number")->required()->check(not_negative());
}

}  // namespace

void add_experiment_commands(CLI::App& app, LinkChoice& link, bool& json, ExperimentOptions& options,
                             const std::function<void(int (*)(const ExperimentOptions&))>& choose) {
  if (const char* owner = std::getenv("DRIVEBENCH_OWNER"); owner != nullptr) options.owner = owner;
  if (const char* user = std::getenv("USER"); user != nullptr) options.user = user;
  CLI::App* const parent = app.add_subcommand("experiment", "what the server runs on a bench of its own");
  parent->require_subcommand(1);
  const auto add = [&, choose](const std::string& name, const std::string& description, Run run) {
    CLI::App* const sub = parent->add_subcommand(name, description);
    sub->add_flag("--json", json, "print JSON");
    sub->add_option("--link", link.address, std::string(kStreamLinks) + "; else from DRIVEBENCH_LINK")
        ->capture_default_str();
    sub->add_option("--token", link.token, "what the server asks for; else from DRIVEBENCH_TOKEN");
    sub->add_option("--owner", options.owner,
                    "the secret that opens the data; else from DRIVEBENCH_OWNER, else this user's own");
    sub->callback([&link, &json, &options, choose, run] {
      options.json = json;
      options.link = link;
      choose(run);
    });
    return sub;
  };
  CLI::App* sub = add("run", "queue an experiment and fetch its data", run_experiment_run);
  sub->add_option("FILE", options.file, "what to do, in TOML")->required();
  sub->add_option("--user", options.user, "a name that everybody sees; default: USER");
  sub->add_flag("--detach", options.detach, "do not wait for its end");
  add_file_options(*sub, options);
  add("list", "what waits, runs and is kept", run_experiment_list);
  sub = add("fetch", "the data of an experiment, to standard output without --out", run_experiment_fetch);
  add_id(*sub, options);
  add_file_options(*sub, options);
  sub = add("cancel", "end an experiment", run_experiment_cancel);
  add_id(*sub, options);
}

}  // namespace drivebench::command
