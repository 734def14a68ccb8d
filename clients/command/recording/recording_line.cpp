#include "clients/command/recording/recording_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/recording/export.hpp"
#include "clients/command/recording/replay.hpp"

namespace drivebench::command {
namespace {

void add_replay(CommandLine& line) {
  const auto [sub, o] =
      line.add<ReplayOptions>("replay", "re-simulate a recording and compare it bit for bit", run_replay);
  sub.add_option("FILE", o.recording, "an MCAP recording")->type_name("FILE")->required();
  sub.footer("Exit code 3: the recording has no end; what it holds is equal.");
}

void add_export(CommandLine& line) {
  const auto [sub, o] =
      line.add<ExportOptions>("export", "a recording as CSV, MATLAB, MDF or as a CAN trace", run_export);
  sub.add_option(
         "--format", o.format,
         "csv, mat (MATLAB 7.3, which is HDF5), mdf (MDF 4.1): samples; candump: the frames of a CAN bus")
      ->check(CLI::IsMember({"csv", "mat", "mdf", "candump"}))
      ->capture_default_str();
  sub.add_option("--interface", o.interface, "candump: name of the interface")->capture_default_str();
  sub.add_option("--node-base", o.node_base, "candump: node id of the first axis")
      ->check(CLI::Range(1, 127))
      ->capture_default_str();
  sub.add_flag("--classic", o.classic, "candump: classic frames instead of FD");
  sub.add_option("--profile", o.profile, "candump: as in a can: link, current_unit_a=0.01&extended=1");
  sub.add_option("FILE", o.recording, "an MCAP recording")->type_name("FILE")->required();
  sub.add_option("--out", o.out_file, "instead of standard output")->type_name("FILE");
  sub.add_option("--axis", o.axis, "name; default: the first in the file");
  sub.add_option("--signals", o.signals, "names, separated by commas")->type_name("SIGNAL")->delimiter(',');
  sub.add_option("--from", o.from_tick, "first tick")->check(not_negative());
  sub.add_option("--to", o.to_tick, "last tick")->check(not_negative());
  sub.footer("Exit code 3: the recording has no end or lost entries; what it holds was written.");
}

}  // namespace

void add_recording_commands(CommandLine& line) {
  add_replay(line);
  add_export(line);
}

}  // namespace drivebench::command
