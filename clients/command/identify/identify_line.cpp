#include "clients/command/identify/identify_line.hpp"

#include <cstdlib>

#include "clients/command/common/line_values.hpp"

namespace drivebench::command {
namespace {

void add_measurement(CLI::App& sub, LinkChoice& link, IdentifyOptions& o) {
  sub.add_option("--motor", o.motor, "im, dc, pm or bldc");
  sub.add_option("--experiment", o.experiment,
                 "by name, or a file that ends with .toml; default: the motor's first");
  sub.add_flag("--list", o.list, "print motors and experiments and end");
  sub.add_option("--bench", o.bench, "start a server on this bench, file or name, for the experiment");
  sub.add_option("--link", link.address,
                 std::string(kStreamLinks) +
                     " of a server that has the bench; without it one that is there, "
                     "or else one that is started");
  sub.add_option("--token", link.token, "what the server asks for; else from DRIVEBENCH_TOKEN");
  sub.add_option("--owner", o.server.owner,
                 "the secret that opens the data; else from DRIVEBENCH_OWNER, else this user's own");
  sub.add_option("--from", o.from_file, "a recording (.mcap) or a CSV file in the place of an experiment");
  sub.add_option("--axis", o.axis, "--from a recording: name; default: the first in the file");
  sub.add_option("--map", o.maps,
                 "--from CSV: HEADER=SIGNAL, HEADER=SIGNAL*FACTOR+OFFSET, or a column-map file (.toml)");
  sub.add_option("--time", o.time, "--from CSV: header of the time [s]; default: time_s");
  sub.add_option("--period", o.period_s,
                 "--from CSV: seconds between two rows, if there is no column of time")
      ->check(finite_between(1e-12, kMost_s));
}

void add_settings(CLI::App& sub, IdentifyOptions& o) {
  constexpr const char* kGroup =
      "How data become equations (default: what bench, recording and experiment say)";
  sub.add_option("--pole-pairs", o.pole_pairs, "of the motor")->check(CLI::Range(1, 1000))->group(kGroup);
  sub.add_option("--counts", o.counts_per_revolution, "of encoder_count in a revolution; 0: angle_rad counts")
      ->check(finite_between(0.0, 1e9))
      ->group(kGroup);
  sub.add_option("--phases", o.phases, "3 in a star, or the 2 of a two-phase machine")
      ->check(CLI::IsMember({2, 3}))
      ->group(kGroup);
  sub.add_option("--voltages", o.voltages,
                 "mean: of the period before the sample (an amplifier); instant: at the sample (a line)")
      ->check(CLI::IsMember({"mean", "instant"}))
      ->group(kGroup);
  sub.add_option("--voltage-shift", o.voltage_shift,
                 "advance voltages by so many periods; mean is 0.5, instant 0")
      ->check(finite_between(-100.0, 100.0))
      ->group(kGroup);
  sub.add_option("--window", o.window, "FROM:TO [s], the part of the record that counts")->group(kGroup);
  sub.add_option("--current-hz", o.current_hz, "corner of the zero-phase filter; 0: none")
      ->check(finite_between(0.0, 1e9))
      ->group(kGroup);
  sub.add_option("--voltage-hz", o.voltage_hz, "the same")->check(finite_between(0.0, 1e9))->group(kGroup);
  sub.add_option("--shaft-hz", o.shaft_hz, "the same")->check(finite_between(0.0, 1e9))->group(kGroup);
  sub.add_option("--order", o.order, "of these filters")->check(CLI::Range(1, 10))->group(kGroup);
  sub.add_option("--load", o.load, "im: viscous friction or a constant load torque")
      ->check(CLI::IsMember({"viscous", "constant"}))
      ->group(kGroup);
  sub.add_flag("--one-stage", o.one_stage, "pm: all parameters in one least squares")->group(kGroup);
}

}  // namespace

void add_identify_command(CLI::App& app, LinkChoice& link, bool& json, IdentifyOptions& options,
                          const std::function<void()>& choose) {
  CLI::App* const sub =
      app.add_subcommand("identify", "the parameters of a motor, from an experiment or a file");
  sub->add_flag("--json", json, "print JSON");
  add_measurement(*sub, link, options);
  sub->add_option("--markdown", options.markdown_file, "write the report");
  sub->add_option("--plot", options.plot_file, "write an SVG picture: measured against re-simulated");
  sub->add_option("--motor-file", options.motor_file, "write a TOML file for configs/motors");
  sub->add_option("--data", options.data_file, "write what was measured as CSV");
  add_settings(*sub, options);
  sub->footer(
      "Exit codes: 0 ok, 1 the experiment failed or its data do not tell every parameter, 2 usage, file or "
      "configuration, 3 cannot connect.");
  sub->callback([&, sub, choose] {
    if (const char* owner = std::getenv("DRIVEBENCH_OWNER"); owner != nullptr && options.server.owner.empty())
      options.server.owner = owner;
    if (const char* user = std::getenv("USER"); user != nullptr) options.server.user = user;
    options.json = json;
    options.server.link = link;
    options.link_was_named = sub->get_option("--link")->count() > 0;
    choose();
  });
}

}  // namespace drivebench::command
