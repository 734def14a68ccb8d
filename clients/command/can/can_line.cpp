#include "clients/command/can/can_line.hpp"

#include "clients/command/can/can_check.hpp"
#include "clients/command/can/can_log.hpp"
#include "clients/command/common/line/command_line.hpp"

namespace drivebench::command {
namespace {

void add_can_check(CommandLine& line) {
  CLI::App& can = *line.app().add_subcommand("can", "check the CAN interfaces of this computer");
  can.require_subcommand(1);
  const auto [sub, o] = line.add<CanCheckOptions>(
      can, "check", "what is wrong with an interface, and the line that cures it", run_can_check);
  sub.add_option("IFACE", o.interface, "name of the interface, such as can0")->type_name("IFACE")->required();
  begin_group(sub, kWhat);
  sub.add_flag("--classic", o.classic, "classic frames will do: no CAN FD is asked for");
  sub.footer(
      "Example:\n  drivebench can check can0\n"
      "Exit codes: 0 nothing is wrong, 1 something is, 2 there is no such CAN interface.");
}

void add_can_log(CommandLine& line) {
  const auto [sub, o] =
      line.add<CanLogOptions>("can-log", "write what is on a CAN bus, as candump -l does", run_can_log);
  sub.add_option("LINK", o.address, "can:BACKEND:CHANNEL, such as can:socketcan:vcan0")
      ->type_name("ADDRESS")
      ->required();
  begin_group(sub, kLimits);
  sub.add_option("--count", o.count, "end after this many frames; 0: never")
      ->type_name("NUMBER")
      ->check(not_negative())
      ->capture_default_str();
  sub.add_option("--duration", o.duration_s, "end after this time; 0: never")
      ->type_name("SECONDS")
      ->check(finite_between(0.0, kMost_s))
      ->capture_default_str();
  begin_group(sub, kOutput);
  sub.add_option("--output", o.out_file, "write to this file; default: standard output")->type_name("FILE");
  sub.footer("Example:\n  drivebench can-log can:udp_multicast:239.74.163.2 --duration 2");
}

}  // namespace

void add_can_commands(CommandLine& line) {
  add_can_check(line);
  add_can_log(line);
}

}  // namespace drivebench::command
