#include "clients/command/recording/recording_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/recording/export.hpp"
#include "clients/command/recording/replay.hpp"

namespace drivebench::command {
namespace {

void add_replay(CommandLine& line) {
  const auto [sub, o] =
      line.add<ReplayOptions>("replay", "simulate a recording again and compare it bit for bit", run_replay);
  sub.add_option("FILE", o.recording, "an MCAP recording")->type_name("FILE")->required();
  sub.footer(
      "Example:\n  drivebench replay run.mcap\n"
      "Exit codes: 0 equal, bit for bit, 1 it differs, 2 usage or file, 3 the recording has no end; what it "
      "holds is equal.");
}

void add_export(CommandLine& line) {
  const auto [sub, o] = line.add<ExportOptions>(
      "export", "write a recording as CSV, MATLAB, MDF or as a CAN trace", run_export);
  sub.add_option("FILE", o.recording, "an MCAP recording")->type_name("FILE")->required();
  begin_group(sub, kWhat);
  sub.add_option("--axis", o.axis, "axis of the recording, by name; default: the first in the file")
      ->type_name("AXIS");
  sub.add_option("--signals", o.signals, "names of signals, separated by commas; default: all")
      ->type_name("SIGNAL")
      ->delimiter(',');
  begin_group(sub, kLimits);
  sub.add_option("--from", o.from_tick, "first tick that is written")
      ->type_name("TICK")
      ->check(not_negative());
  sub.add_option("--to", o.to_tick, "last tick that is written")->type_name("TICK")->check(not_negative());
  begin_group(sub, "Only with --format candump");
  sub.add_option("--interface", o.interface, "name of the interface in each line")
      ->type_name("IFACE")
      ->capture_default_str();
  sub.add_option("--node-base", o.node_base, "node id of the first axis")
      ->type_name("NUMBER")
      ->check(whole_between(1, 127))
      ->capture_default_str();
  sub.add_flag("--classic", o.classic, "classic frames instead of FD");
  sub.add_option("--profile", o.profile, "keys as in a can: link, such as current_unit_a=0.01&extended=1")
      ->type_name("KEY=VALUE&...");
  begin_group(sub, kOutput);
  sub.add_option(
         "--format", o.format,
         "csv, mat (MATLAB 7.3, which is HDF5), mdf (MDF 4.1): samples; candump: the frames of a CAN bus; "
         "default: as the name of --out ends (.mat, .h5, .mf4), else csv")
      ->type_name("FORMAT")
      ->check(CLI::IsMember({"csv", "mat", "mdf", "candump"}));
  sub.add_option("--out", o.out_file, "write to this file; default: standard output")->type_name("FILE");
  sub.footer(
      "Example:\n"
      "  drivebench export run.mcap --out run.csv\n"
      "  drivebench export run.mcap --signals tick,speed_rad_s --from 100 --to 200\n"
      "  drivebench export run.mcap --format candump --out run.log\n"
      "A recording made in real time also gives the UTC at which each sample was due: unix_ns, and the times "
      "of candump.\n"
      "Exit codes: 0 written, 1 failed, 2 usage or file, 3 the recording has no end or lost entries; what it "
      "holds was written.");
}

}  // namespace

void add_recording_commands(CommandLine& line) {
  add_replay(line);
  add_export(line);
}

}  // namespace drivebench::command
