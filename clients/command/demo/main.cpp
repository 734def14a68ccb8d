// drivebench-demo: the verbs of drivebench that `./bench demo` runs, which are built in half the time of all.
#include "clients/command/common/line/command_line.hpp"
#include "clients/command/control/control_line.hpp"
#include "clients/command/demo/demo_line.hpp"

int main(int argc, char** argv) {
  using namespace drivebench::command;
  CommandLine line;
  add_demo_command(line);
  add_control_commands(line);
  return line.run(argc, argv);
}
