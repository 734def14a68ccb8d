#include "clients/command/identify/identify_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/experiment/experiment_line.hpp"
#include "clients/command/identify/filter.hpp"
#include "clients/command/identify/identify.hpp"
#include "clients/command/identify/track/track.hpp"

namespace drivebench::command {
namespace {

/// Facts about a CSV file, which `identify` and `track` read alike.
void add_csv_facts(CLI::App& sub, IdentifyOptions& o) {
  begin_group(sub, "Data of a file, in the place of a bench");
  sub.add_option("--from", o.from_file, "a recording (.mcap) or a CSV file")->type_name("FILE");
  sub.add_option("--map", o.maps,
                 "which column of a CSV file is which signal, or a file that says so (.toml); also "
                 "HEADER=SIGNAL*FACTOR+OFFSET")
      ->type_name("HEADER=SIGNAL");
  sub.add_option("--time", o.time, "header of the time [s] in a CSV file; default: time_s")
      ->type_name("HEADER");
  sub.add_option("--period", o.period_s, "time between two rows of a CSV file that has no column of time")
      ->type_name("SECONDS")
      ->check(finite_between(1e-12, kMost_s));
}

void add_measurement(CLI::App& sub, IdentifyOptions& o) {
  o.server = server_of_environment();
  add_link_with_help(sub, o.server.link,
                     "address of a server that has the bench: " + std::string(kStreamLinks) +
                         "; without it the one of DRIVEBENCH_LINK or at the "
                         "default address if it fits, or else one that is started");
  sub.get_option("--link")->each([&named = o.link_was_named](const std::string&) { named = true; });
  add_owner(sub, o.server);
  begin_group(sub, kWhat);
  sub.add_option("--motor", o.motor, "kind of the motor: im, dc, pm or bldc")->type_name("KIND");
  sub.add_option("--experiment", o.experiment,
                 "an experiment by name, or a file that ends with .toml; default: the motor's first")
      ->type_name("EXPERIMENT");
  sub.add_option("--bench", o.bench, "start a server on this bench, file or name, for the experiment")
      ->type_name("BENCH");
  sub.add_option("--find", o.find,
                 "errors of the sensors to look for beside the motor: current-offsets, voltage-offsets, "
                 "gains (of the phases b and c against a); separated by commas")
      ->type_name("ERROR")
      ->delimiter(',')
      ->check(CLI::IsMember({"current-offsets", "voltage-offsets", "gains"}));
  add_csv_facts(sub, o);
  sub.add_option("--axis", o.axis, "axis of a recording, by name; default: the first in the file")
      ->type_name("AXIS");
}

void add_filters(CLI::App& sub, IdentifyOptions& o) {
  const auto corner = [&](const char* name, std::optional<double>& value, const char* text) {
    sub.add_option(name, value, text)->type_name("HZ")->check(finite_between(0.0, 1e9));
  };
  corner("--current-hz", o.current_hz, "corner of the zero-phase filter of the currents; 0: none");
  corner("--voltage-hz", o.voltage_hz, "corner of the filter of the voltages; 0: none");
  corner("--shaft-hz", o.shaft_hz, "corner of the filter of angle and speed; 0: none");
  sub.add_option("--order", o.order, "order of these filters")
      ->type_name("NUMBER")
      ->check(whole_between(1, 10));
}

void add_settings(CLI::App& sub, IdentifyOptions& o) {
  begin_group(sub, "How data become equations (default: what bench, recording and experiment say)");
  sub.add_option("--pole-pairs", o.pole_pairs, "pole pairs of the motor; --from CSV finds them in the data")
      ->type_name("NUMBER")
      ->check(whole_between(1, 1000));
  sub.add_option("--counts", o.counts_per_revolution,
                 "counts of encoder_count in a revolution; 0: angle_rad counts")
      ->type_name("COUNTS")
      ->check(finite_between(0.0, 1e9));
  sub.add_option("--direction", o.direction,
                 "direction of the encoder against the order of the phases; --from CSV finds it in the data")
      ->check(CLI::IsMember({"forward", "reversed"}));
  sub.add_option("--phases", o.phases, "3 phases in a star, or the 2 of a two-phase machine")
      ->check(CLI::IsMember({2, 3}));
  sub.add_option("--voltages", o.voltages,
                 "mean: of the period before the sample (an amplifier); instant: at the sample (a line)")
      ->check(CLI::IsMember({"mean", "instant"}));
  sub.add_option("--voltage-shift", o.voltage_shift,
                 "advance voltages by this many periods; mean is 0.5, instant 0; --from CSV finds it in the "
                 "data")
      ->type_name("PERIODS")
      ->check(finite_between(-100.0, 100.0));
  sub.add_option("--window", o.window, "the part of the record that counts, in seconds")
      ->type_name("FROM:TO");
  add_filters(sub, o);
  sub.add_option("--load", o.load, "load of an induction motor: viscous friction or a constant torque")
      ->check(CLI::IsMember({"viscous", "constant"}));
  sub.add_flag("--one-stage", o.one_stage, "find all parameters of a PM motor in one least squares");
  sub.add_option("--stator-resistance", o.stator_resistance_ohm,
                 "R_S as measured with DC, for the no-load and the blocked-rotor test")
      ->type_name("OHM")
      ->check(finite_between(1e-9, 1e9));
}

void add_suggestion(CLI::App& sub, IdentifyOptions& o) {
  begin_group(sub, "An experiment for the bench's motor, by trials on the bench");
  const auto limit = [&](const char* name, std::optional<double>& value, const char* unit, const char* text) {
    sub.add_option(name, value, text)->type_name(unit)->check(finite_between(1e-9, 1e9))->needs("--suggest");
  };
  sub.add_flag("--suggest", o.suggest,
               "make an experiment whose worst interval is small, beside what the named ones would give");
  limit("--max-current", o.suggestion.current_a, "AMPERES",
        "largest current of a phase; default: that of the bench's amplifier");
  limit("--max-voltage", o.suggestion.voltage_v, "VOLTS",
        "largest voltage of a phase; default: that of the bench's amplifier or source");
  limit("--max-speed", o.suggestion.speed_rad_s, "RAD/S", "largest speed; default: none");
  limit("--seconds", o.suggestion.duration_s, "SECONDS",
        "length of the record; default: that of the motor's first experiment");
  sub.add_option("--trials", o.suggestion.trials, "largest number of experiments that are tried")
      ->type_name("NUMBER")
      ->check(whole_between(1, 250))
      ->capture_default_str()
      ->needs("--suggest");
  sub.add_option("--suggest-file", o.suggestion.file, "write the experiment (.toml), for --experiment")
      ->type_name("FILE")
      ->needs("--suggest");
}

void add_files(CLI::App& sub, IdentifyOptions& o) {
  begin_group(sub, kOutput);
  sub.add_flag("--list", o.list, "print motors and experiments and end");
  sub.add_option("--markdown", o.markdown_file, "write the report in Markdown")->type_name("FILE");
  sub.add_option("--plot", o.plot_file,
                 "write an SVG picture: measured against re-simulated, and what is left between them")
      ->type_name("FILE");
  sub.add_option("--motor-file", o.motor_file, "write a TOML file for configs/motors")->type_name("FILE");
  sub.add_option("--data", o.data_file, "write what was measured as CSV")->type_name("FILE");
}

void add_identify(CommandLine& line) {
  const auto [sub, o] = line.add<IdentifyOptions>(
      "identify", "find the parameters of a motor, from an experiment or a file", run_identify);
  add_measurement(sub, o);
  add_settings(sub, o);
  add_suggestion(sub, o);
  add_files(sub, o);
  sub.footer(
      "Example:\n"
      "  drivebench identify --list\n"
      "  drivebench identify --motor dc --markdown dc.md\n"
      "Exit codes: 0 ok, 1 the experiment failed or its data do not tell every parameter, 2 usage, file or "
      "configuration, 3 cannot connect.");
}

void add_track_settings(CLI::App& sub, TrackOptions& o) {
  begin_group(sub, "The motor and its sensors (default: what the bench or the recording says)");
  sub.add_option("--motor-file", o.motor_file, "take the inductances of this file or name of configs/motors")
      ->type_name("MOTOR");
  sub.add_option("--stator-inductance", o.stator_inductance_h, "inductance L_S of the stator")
      ->type_name("H")
      ->check(finite_between(1e-9, 1e6));
  sub.add_option("--leakage", o.leakage, "total leakage sigma = 1 - M^2/(L_S L_R)")
      ->type_name("SIGMA")
      ->check(finite_between(1e-6, 0.999999));
  sub.add_option("--pole-pairs", o.data.pole_pairs, "pole pairs of the motor")
      ->type_name("NUMBER")
      ->check(whole_between(1, 1000));
  sub.add_option("--counts", o.data.counts_per_revolution, "counts of encoder_count in a revolution")
      ->type_name("COUNTS")
      ->check(finite_between(0.0, 1e9));
  sub.add_option("--phases", o.data.phases, "3 phases in a star, or the 2 of a two-phase machine")
      ->check(CLI::IsMember({2, 3}));
  sub.add_option("--voltage-shift", o.data.voltage_shift,
                 "advance voltages by this many periods, as for `drivebench identify`")
      ->type_name("PERIODS")
      ->check(finite_between(-100.0, 100.0));
}

void add_track(CommandLine& line) {
  const auto [sub, o] = line.add<TrackOptions>(
      "track", "follow stator resistance and rotor time constant of an induction motor while it runs",
      run_track);
  add_link(sub, o.data.server.link);
  begin_group(sub, kWhat);
  sub.add_option("--axis", o.data.axis, "axis by number or name; default: the first")->type_name("AXIS");
  add_csv_facts(sub, o.data);
  add_track_settings(sub, o);
  begin_group(sub, kLimits);
  sub.add_option("--window", o.window_s, "length of the data that an estimate goes by")
      ->type_name("SECONDS")
      ->check(finite_between(1e-3, 1e3))
      ->capture_default_str();
  sub.add_option("--stride", o.stride_s, "time between two estimates")
      ->type_name("SECONDS")
      ->check(finite_between(1e-4, 1e3))
      ->capture_default_str();
  sub.add_option("--duration", o.duration_s, "end after this much of the bench's time; 0: at Ctrl-C")
      ->type_name("SECONDS")
      ->check(finite_between(0.0, kMost_s))
      ->capture_default_str();
  sub.add_option("--cutoff-hz", o.cutoff_hz, "corner of all filters")
      ->type_name("HZ")
      ->check(finite_between(1e-3, 1e9))
      ->capture_default_str();
  begin_group(sub, kOutput);
  sub.add_option("--plot", o.plot_file, "write an SVG picture of both over time, with the truth of a bench")
      ->type_name("FILE");
  sub.footer(
      "Example:\n  drivebench track --duration 3 --plot track.svg\n"
      "Exit codes: 0 ok, 1 nothing could be told, 2 usage, file or configuration, 3 cannot connect.");
}

void add_filter(CommandLine& line) {
  const auto [sub, o] = line.add<FilterOptions>(
      "filter", "print the numbers of a Butterworth low-pass, or filter a column of a CSV file", run_filter);
  sub.add_option("FILE", o.file, "a CSV file; without it the numbers are printed")->type_name("FILE");
  begin_group(sub, "The filter");
  sub.add_option("--order", o.order, "order of the filter")
      ->type_name("NUMBER")
      ->check(whole_between(1, 10))
      ->capture_default_str();
  sub.add_option("--cutoff-hz", o.cutoff_hz, "corner of the filter")
      ->type_name("HZ")
      ->check(finite_between(1e-6, 1e9))
      ->capture_default_str();
  sub.add_option("--rate-hz", o.rate_hz, "sample rate; default with a file: that of its rows")
      ->type_name("HZ")
      ->check(finite_between(1e-6, 1e9));
  begin_group(sub, "The file");
  sub.add_option("--column", o.column, "header of the column that is filtered")->type_name("HEADER");
  sub.add_option("--time", o.time, "header of the time [s]")->type_name("HEADER")->capture_default_str();
  begin_group(sub, kOutput);
  sub.add_option("--out", o.out_file,
                 "write the column as it was, filtered once, filtered there and back, and the slope of that; "
                 "default: standard output")
      ->type_name("FILE");
  sub.footer(
      "Example:\n"
      "  drivebench filter --order 3 --cutoff-hz 100 --rate-hz 5000\n"
      "  drivebench filter run.csv --column encoder_count --cutoff-hz 200 --out filtered.csv");
}

}  // namespace

void add_identify_commands(CommandLine& line) {
  add_identify(line);
  add_track(line);
  add_filter(line);
}

}  // namespace drivebench::command
