#include "clients/command/demo/demo_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/demo/demo.hpp"

namespace drivebench::command {

void add_demo_command(CommandLine& line) {
  const auto [sub, o] = line.add<DemoOptions>(
      "demo", "one move in lockstep and in real time, compared, recorded and replayed", run_demo);
  sub.add_option("--keep", o.folder, "folder for the recordings")->type_name("FOLDER")->capture_default_str();
}

}  // namespace drivebench::command
