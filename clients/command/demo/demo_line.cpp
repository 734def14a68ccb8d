#include "clients/command/demo/demo_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/demo/demo.hpp"

namespace drivebench::command {

void add_demo_command(CommandLine& line) {
  const auto [sub, o] = line.add<DemoOptions>(
      "demo", "make one move in lockstep and in real time, compare, record and replay it", run_demo);
  begin_group(sub, kOutput);
  sub.add_option("--keep", o.folder, "folder for the recordings")->type_name("FOLDER")->capture_default_str();
  sub.footer("Example:\n  drivebench demo");
}

}  // namespace drivebench::command
