#include "clients/command/identify/identify_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/identify/filter.hpp"
#include "clients/command/identify/identify.hpp"
#include "clients/command/identify/track/track.hpp"

namespace drivebench::command {
namespace {

void add_measurement(CLI::App& sub, IdentifyOptions& o) {
  sub.add_option("--motor", o.motor, "im, dc, pm or bldc");
  sub.add_option("--experiment", o.experiment,
                 "by name, or a file that ends with .toml; default: the motor's first");
  sub.add_flag("--list", o.list, "print motors and experiments and end");
  sub.add_option("--bench", o.bench, "start a server on this bench, file or name, for the experiment")
      ->type_name("BENCH");
  o.server = server_of_environment();
  add_link_with_help(sub, o.server.link,
                     std::string(kStreamLinks) +
                         " of a server that has the bench; without it the one of DRIVEBENCH_LINK or at the "
                         "default address if it fits, or else one that is started");
  sub.get_option("--link")->each([&named = o.link_was_named](const std::string&) { named = true; });
  sub.add_option("--owner", o.server.owner,
                 "the secret that opens the data; else from DRIVEBENCH_OWNER, else this user's own");
  sub.add_option("--from", o.from_file, "a recording (.mcap) or a CSV file in the place of an experiment")
      ->type_name("FILE");
  sub.add_option("--axis", o.axis, "--from a recording: name; default: the first in the file");
  sub.add_option("--map", o.maps,
                 "--from CSV: HEADER=SIGNAL, HEADER=SIGNAL*FACTOR+OFFSET, or a column-map file (.toml)");
  sub.add_option("--find", o.find,
                 "errors of the sensors to look for beside the motor: current-offsets, voltage-offsets, "
                 "gains (of the "
                 "phases b and c against a); separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"current-offsets", "voltage-offsets", "gains"}));
  sub.add_option("--time", o.time, "--from CSV: header of the time [s]; default: time_s");
  sub.add_option("--period", o.period_s,
                 "--from CSV: seconds between two rows, if there is no column of time")
      ->check(finite_between(1e-12, kMost_s));
}

void add_settings(CLI::App& sub, IdentifyOptions& o) {
  constexpr const char* kGroup =
      "How data become equations (default: what bench, recording and experiment say)";
  sub.add_option("--pole-pairs", o.pole_pairs, "of the motor; --from CSV finds them in the data")
      ->check(CLI::Range(1, 1000))
      ->group(kGroup);
  sub.add_option("--counts", o.counts_per_revolution, "of encoder_count in a revolution; 0: angle_rad counts")
      ->check(finite_between(0.0, 1e9))
      ->group(kGroup);
  sub.add_option("--direction", o.direction,
                 "of the encoder against the order of the phases; --from CSV finds it in the data")
      ->check(CLI::IsMember({"forward", "reversed"}))
      ->group(kGroup);
  sub.add_option("--phases", o.phases, "3 in a star, or the 2 of a two-phase machine")
      ->check(CLI::IsMember({2, 3}))
      ->group(kGroup);
  sub.add_option("--voltages", o.voltages,
                 "mean: of the period before the sample (an amplifier); instant: at the sample (a line)")
      ->check(CLI::IsMember({"mean", "instant"}))
      ->group(kGroup);
  sub.add_option(
         "--voltage-shift", o.voltage_shift,
         "advance voltages by so many periods; mean is 0.5, instant 0; --from CSV finds it in the data")
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
  sub.add_option("--stator-resistance", o.stator_resistance_ohm,
                 "no-load, blocked-rotor: R_S [ohm] as measured with DC")
      ->check(finite_between(1e-9, 1e9))
      ->group(kGroup);
}

void add_suggestion(CLI::App& sub, IdentifyOptions& o) {
  constexpr const char* kGroup = "An experiment for the bench's motor, by trials on the bench";
  const auto limit = [&](const char* name, std::optional<double>& value, const char* text) {
    sub.add_option(name, value, text)->check(finite_between(1e-9, 1e9))->group(kGroup)->needs("--suggest");
  };
  sub.add_flag("--suggest", o.suggest,
               "make an experiment whose worst interval is small, beside what the named ones would give")
      ->group(kGroup);
  limit("--max-current", o.suggestion.current_a, "[A] of a phase; default: that of the bench's amplifier");
  limit("--max-voltage", o.suggestion.voltage_v,
        "[V] of a phase; default: that of the bench's amplifier or source");
  limit("--max-speed", o.suggestion.speed_rad_s, "[rad/s]; default: none");
  limit("--seconds", o.suggestion.duration_s, "of the record; default: that of the motor's first experiment");
  sub.add_option("--trials", o.suggestion.trials, "experiments that are tried at most")
      ->check(CLI::Range(1, 250))
      ->capture_default_str()
      ->group(kGroup)
      ->needs("--suggest");
  sub.add_option("--suggest-file", o.suggestion.file, "write the experiment (.toml), for --experiment")
      ->type_name("FILE")
      ->group(kGroup)
      ->needs("--suggest");
}

void add_files(CLI::App& sub, IdentifyOptions& o) {
  sub.add_option("--markdown", o.markdown_file, "write the report")->type_name("FILE");
  sub.add_option("--plot", o.plot_file,
                 "write an SVG picture: measured against re-simulated, and what is left between them")
      ->type_name("FILE");
  sub.add_option("--motor-file", o.motor_file, "write a TOML file for configs/motors")->type_name("FILE");
  sub.add_option("--data", o.data_file, "write what was measured as CSV")->type_name("FILE");
}

void add_identify(CommandLine& line) {
  const auto [sub, o] = line.add<IdentifyOptions>(
      "identify", "the parameters of a motor, from an experiment or a file", run_identify);
  add_measurement(sub, o);
  add_suggestion(sub, o);
  add_files(sub, o);
  add_settings(sub, o);
  sub.footer(
      "Exit codes: 0 ok, 1 the experiment failed or its data do not tell every parameter, 2 usage, file or "
      "configuration, 3 cannot connect.");
}

void add_track(CommandLine& line) {
  const auto [sub, o] = line.add<TrackOptions>(
      "track", "stator resistance and rotor time constant of an induction motor while it runs", run_track);
  add_link(sub, o.data.server.link);
  sub.add_option("--axis", o.data.axis, "number or name; default: the first");
  sub.add_option("--from", o.data.from_file, "a recording (.mcap) or a CSV file in the place of a bench")
      ->type_name("FILE");
  sub.add_option("--map", o.data.maps, "--from CSV: as of identify");
  sub.add_option("--time", o.data.time, "--from CSV: header of the time [s]; default: time_s");
  sub.add_option("--period", o.data.period_s,
                 "--from CSV: seconds between two rows, without a column of time")
      ->check(finite_between(1e-12, kMost_s));
  sub.add_option("--motor-file", o.motor_file, "the inductances: a file or name of configs/motors")
      ->type_name("MOTOR");
  sub.add_option("--stator-inductance", o.stator_inductance_h, "L_S [H]; default: the bench's")
      ->check(finite_between(1e-9, 1e6));
  sub.add_option("--leakage", o.leakage, "sigma = 1 - M^2/(L_S L_R); default: the bench's")
      ->check(finite_between(1e-6, 0.999999));
  sub.add_option("--window", o.window_s, "[s] that an estimate goes by")
      ->check(finite_between(1e-3, 1e3))
      ->capture_default_str();
  sub.add_option("--stride", o.stride_s, "[s] between two estimates")
      ->check(finite_between(1e-4, 1e3))
      ->capture_default_str();
  sub.add_option("--duration", o.duration_s, "[s] of the bench's time; 0: until ctrl-C")
      ->check(finite_between(0.0, kMost_s))
      ->capture_default_str();
  sub.add_option("--cutoff-hz", o.cutoff_hz, "corner of all filters")
      ->check(finite_between(1e-3, 1e9))
      ->capture_default_str();
  sub.add_option("--pole-pairs", o.data.pole_pairs)->check(CLI::Range(1, 1000));
  sub.add_option("--counts", o.data.counts_per_revolution, "of encoder_count in a revolution")
      ->check(finite_between(0.0, 1e9));
  sub.add_option("--phases", o.data.phases)->check(CLI::IsMember({2, 3}));
  sub.add_option("--voltage-shift", o.data.voltage_shift, "as of identify; default: that of the drive")
      ->check(finite_between(-100.0, 100.0));
  sub.add_option("--plot", o.plot_file, "write an SVG picture of both over time, with the truth of a bench")
      ->type_name("FILE");
  sub.footer("Exit codes: 0 ok, 1 nothing could be told, 2 usage, file or configuration, 3 cannot connect.");
}

void add_filter(CommandLine& line) {
  const auto [sub, o] = line.add<FilterOptions>(
      "filter", "the numbers of a Butterworth low-pass, or a column of a CSV file through it", run_filter);
  sub.add_option("FILE", o.file, "a CSV file; without it the numbers are printed")->type_name("FILE");
  sub.add_option("--order", o.order)->check(CLI::Range(1, 10))->capture_default_str();
  sub.add_option("--cutoff-hz", o.cutoff_hz, "corner")
      ->check(finite_between(1e-6, 1e9))
      ->capture_default_str();
  sub.add_option("--rate-hz", o.rate_hz, "sample rate; of a file it is that of the rows")
      ->check(finite_between(1e-6, 1e9));
  sub.add_option("--column", o.column, "header of the column to be filtered");
  sub.add_option("--time", o.time, "header of the time [s]")->capture_default_str();
  sub.add_option("--out", o.out_file,
                 "instead of standard output: the column as it was, filtered once, filtered there and back, "
                 "and the slope of that")
      ->type_name("FILE");
}

}  // namespace

void add_identify_commands(CommandLine& line) {
  add_identify(line);
  add_track(line);
  add_filter(line);
}

}  // namespace drivebench::command
