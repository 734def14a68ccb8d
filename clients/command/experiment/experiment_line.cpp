#include "clients/command/experiment/experiment_line.hpp"

#include "clients/command/experiment/experiment.hpp"

namespace drivebench::command {
namespace {

void add_file_options(CLI::App& sub, ExperimentOptions& o) {
  sub.add_option("--out", o.out_file,
                 "write the data to this file, as CSV, or as the recording if it ends with .mcap")
      ->type_name("FILE")
      ->group(kOutput);
  sub.add_option("--patience", o.server.patience_s, "how long a broken link may stay broken")
      ->check(finite_between(0.0, kMost_s))
      ->type_name("SECONDS")
      ->capture_default_str()
      ->group(kConnection);
}

void add_id(CLI::App& sub, ExperimentOptions& o) {
  sub.add_option("ID", o.id, "number of the experiment; `drivebench experiment list` tells it")
      ->type_name("NUMBER")
      ->required()
      ->check(not_negative());
}

Verb<ExperimentOptions> add(CommandLine& line, CLI::App& parent, const std::string& name,
                            const std::string& description, int (*run)(const ExperimentOptions&)) {
  const auto verb = line.add<ExperimentOptions>(parent, name, description, run);
  ExperimentServer& server = verb.options.server;
  server = server_of_environment();
  add_link(verb.app, server.link);
  add_owner(verb.app, server);
  return verb;
}

}  // namespace

void add_owner(CLI::App& sub, ExperimentServer& server) {
  sub.add_option("--owner", server.owner,
                 "the secret that opens the data; else from DRIVEBENCH_OWNER, else this user's own")
      ->type_name("SECRET")
      ->group(kConnection);
}

void add_experiment_commands(CommandLine& line) {
  CLI::App& parent =
      *line.app().add_subcommand("experiment", "run experiments on a server, on a bench of their own");
  parent.require_subcommand(1);
  const auto [run, o] =
      add(line, parent, "run", "queue an experiment and fetch its data", run_experiment_run);
  run.add_option("FILE", o.file, "what to do, in TOML")->type_name("FILE")->required();
  begin_group(run, kWhat);
  run.add_option("--user", o.server.user, "a name that every client sees; default: USER")->type_name("NAME");
  run.add_flag("--detach", o.detach, "do not wait for its end");
  add_file_options(run, o);
  run.footer("Example:\n  drivebench experiment run configs/experiments/im-8-5-5-start.toml --out start.csv");
  const auto list =
      add(line, parent, "list", "list the experiments that wait, run or are kept", run_experiment_list);
  list.app.footer("Example:\n  drivebench experiment list");
  const auto fetch =
      add(line, parent, "fetch", "fetch the data of an experiment, to standard output without --out",
          run_experiment_fetch);
  add_id(fetch.app, fetch.options);
  add_file_options(fetch.app, fetch.options);
  fetch.app.footer("Example:\n  drivebench experiment fetch 1 --out fetched.mcap");
  const auto cancel = add(line, parent, "cancel", "end an experiment", run_experiment_cancel);
  add_id(cancel.app, cancel.options);
  cancel.app.footer("Example:\n  drivebench experiment cancel 1");
}

}  // namespace drivebench::command
