#include "clients/command/regression/test_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/common/line/version.hpp"
#include "clients/command/regression/rerun.hpp"
#include "clients/command/regression/test.hpp"

namespace drivebench::command {

namespace {

void add_rerun_command(CommandLine& line) {
  const auto [sub, o] =
      line.add<RerunOptions>("rerun", "run the case of a bundle again, and compare", run_rerun);
  o.program = version_line();
  sub.add_option("BUNDLE", o.bundle, "a file that `drivebench test --keep` has made")
      ->type_name("FILE")
      ->required();
  begin_group(sub, kWhat);
  auto* const plant_only = sub.add_flag("--plant-only", o.plant_only,
                                        "replay the recorded commands, without the device under test");
  sub.add_option(
         "--from", o.from,
         "repeat the recorded run up to this tick, or this time as 0.03s; the device under test begins "
         "there")
      ->type_name("TICK")
      ->excludes(plant_only);
  auto* const interactive =
      sub.add_flag("--interactive", o.interactive,
                   "serve the bench as it was at the failure, or at --from, with free leases, until Ctrl-C")
          ->excludes(plant_only);
  sub.add_option("--port", o.port, "TCP port of --interactive; 0: chosen by the system")
      ->type_name("PORT")
      ->check(whole_between(0, 65535))
      ->needs(interactive);
  sub.footer(
      "Example:\n"
      "  drivebench rerun kept/servo-position.zip\n"
      "  drivebench rerun kept/servo-position.zip --from 0.03s\n"
      "  drivebench rerun kept/servo-position.zip --interactive");
}

void add_choice(CLI::App& sub, TestOptions& o) {
  sub.add_option("SUITE", o.suite,
                 "a folder of cases, a case file, or the name of a suite that came with drivebench")
      ->type_name("SUITE")
      ->required();
  begin_group(sub, kWhat);
  sub.add_flag("--list", o.list, "print the cases and end");
  sub.add_option("--filter", o.filter, "only cases whose name contains this text")->type_name("NAME");
  sub.add_option("--tag", o.wanted_tags, "only cases with this tag; several: with all of them")
      ->type_name("TAG")
      ->allow_extra_args(false);
  sub.add_option(
         "--shard", o.shard,
         "run only every N-th case from the I-th on, as I/N, or as the environment of Slurm, GitLab or "
         "Kubernetes says: auto")
      ->type_name("I/N");
  begin_group(sub, kLimits);
  sub.add_option("--jobs", o.jobs, "cases that run at the same time")
      ->type_name("NUMBER")
      ->capture_default_str()
      ->check(whole_between(1, 1024));
  sub.add_option("--retries", o.retries, "run a case so often again if the bench was late in it")
      ->type_name("NUMBER")
      ->capture_default_str()
      ->check(whole_between(0, 100));
}

void add_reports(CLI::App& sub, TestOptions& o) {
  begin_group(sub, "Results between runs");
  auto* const results = sub.add_option("--results", o.results_folder,
                                       "keep each result in this folder, and run only cases without one")
                            ->type_name("FOLDER");
  auto* const timing =
      sub.add_option("--timing", o.timing_file,
                     "write how fast the devices under test answered, as FILE.json or as a page FILE.html")
          ->type_name("FILE");
  sub.add_option("--merge", o.merged_folders,
                 "run nothing: report the results of this folder; several: of all of them")
      ->type_name("FOLDER")
      ->allow_extra_args(false)
      ->excludes(results)
      ->excludes(timing);
  sub.add_option("--keep", o.keep_folder,
                 "keep a bundle of each case that has not passed in this folder, for `drivebench rerun`")
      ->type_name("FOLDER");
  begin_group(sub, "Slurm");
  auto* const slurm =
      sub.add_option("--slurm", o.slurm_tasks,
                     "run nothing here: submit the cases to Slurm as an array of so many tasks, each "
                     "with --jobs CPUs; sbatch reads SBATCH_PARTITION and others")
          ->type_name("TASKS")
          ->check(whole_between(1, 1'000'000))
          ->needs(results);
  auto* const status =
      sub.add_flag("--status", o.status,
                   "run nothing: print how many cases have a result, and the state of the Slurm job; "
                   "exit code 1 while one is missing")
          ->needs(results)
          ->excludes(slurm);
  begin_group(sub, "A smaller case");
  auto* const shrink = sub.add_option("--shrink", o.shrunk_file,
                                      "make the one failing case that is chosen, or a bundle in the place of "
                                      "the suite, smaller; writes it to "
                                      "this new file beside the case")
                           ->type_name("FILE")
                           ->excludes(results)
                           ->excludes(timing);
  sub.add_option("--shrink-runs", o.shrink_runs, "the most runs that it may cost")
      ->type_name("NUMBER")
      ->capture_default_str()
      ->check(whole_between(1, 100'000))
      ->needs(shrink);
  begin_group(sub, kOutput);
  sub.add_option("--junit", o.junit_file, "write a JUnit XML report")->type_name("FILE");
  sub.add_option("--json", o.json_file, "write a JSON report")->type_name("FILE");
  sub.add_option("--html", o.html_file, "write a report with plots, as one page that needs no network")
      ->type_name("FILE");
  sub.add_flag("--tap", o.tap, "print the Test Anything Protocol instead of the table");
  sub.add_flag("--github", o.github, "print annotations for GitHub");
  for (const char* other :
       {"--list", "--shard", "--merge", "--keep", "--junit", "--json", "--html", "--tap", "--github"})
    shrink->excludes(sub.get_option(other));
  for (const char* other :
       {"--list", "--shard", "--timing", "--junit", "--json", "--html", "--tap", "--github"}) {
    slurm->excludes(sub.get_option(other));
    status->excludes(sub.get_option(other));
  }
}

}  // namespace

void add_regression_commands(CommandLine& line) {
  const auto [sub, o] = line.add<TestOptions>("test", "run a suite of regression cases", run_test);
  o.program = version_line();
  add_choice(sub, o);
  add_reports(sub, o);
  sub.footer(
      "Example:\n"
      "  drivebench test reference --list\n"
      "  drivebench test reference --jobs 2 --junit report.xml --keep kept\n"
      "  drivebench test hil --filter servo --shrink hil/small.toml\n"
      "  drivebench test hil --results /shared/results --slurm 32\n"
      "Exit codes: 0 all passed or were skipped, 1 one failed or had an error, 2 usage or configuration, 4 "
      "none failed, but real time was not kept.");
  add_rerun_command(line);
}

}  // namespace drivebench::command
