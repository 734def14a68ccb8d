#include "clients/command/experiment/experiment_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/experiment/experiment.hpp"

namespace drivebench::command {
namespace {

void add_file_options(CLI::App& sub, ExperimentOptions& o) {
  sub.add_option("--out", o.out_file, "CSV, or the recording if it ends with .mcap")->type_name("FILE");
  sub.add_option("--patience", o.server.patience_s, "seconds that a broken link may stay broken")
      ->check(finite_between(0.0, kMost_s))
      ->capture_default_str();
}

void add_id(CLI::App& sub, ExperimentOptions& o) {
  sub.add_option("ID", o.id, "its number")->required()->check(not_negative());
}

Verb<ExperimentOptions> add(CommandLine& line, CLI::App& parent, const std::string& name,
                            const std::string& description, int (*run)(const ExperimentOptions&)) {
  const auto verb = line.add<ExperimentOptions>(parent, name, description, run);
  ExperimentServer& server = verb.options.server;
  server = server_of_environment();
  add_link(verb.app, server.link);
  verb.app.add_option("--owner", server.owner,
                      "the secret that opens the data; else from DRIVEBENCH_OWNER, else this user's own");
  return verb;
}

}  // namespace

void add_experiment_commands(CommandLine& line) {
  CLI::App& parent = *line.app().add_subcommand("experiment", "what the server runs on a bench of its own");
  parent.require_subcommand(1);
  const auto [run, o] =
      add(line, parent, "run", "queue an experiment and fetch its data", run_experiment_run);
  run.add_option("FILE", o.file, "what to do, in TOML")->type_name("EXPERIMENT")->required();
  run.add_option("--user", o.server.user, "a name that every client sees; default: USER");
  run.add_flag("--detach", o.detach, "do not wait for its end");
  add_file_options(run, o);
  add(line, parent, "list", "the experiments that wait, run or are kept", run_experiment_list);
  const auto fetch = add(line, parent, "fetch", "the data of an experiment, to standard output without --out",
                         run_experiment_fetch);
  add_id(fetch.app, fetch.options);
  add_file_options(fetch.app, fetch.options);
  const auto cancel = add(line, parent, "cancel", "end an experiment", run_experiment_cancel);
  add_id(cancel.app, cancel.options);
}

}  // namespace drivebench::command
