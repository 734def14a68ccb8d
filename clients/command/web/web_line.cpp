#include "clients/command/web/web_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/web/web.hpp"

namespace drivebench::command {

void add_web_command(CommandLine& line) {
  const auto [sub, o] = line.add<WebOptions>("web", "show the bench in a browser, and its metrics", run_web);
  add_link(sub, o.link);
  begin_group(sub, "What browsers see");
  sub.add_option("--listen", o.listen, "where browsers connect; port 0: the system chooses one")
      ->type_name("ADDRESS:PORT")
      ->capture_default_str();
  sub.add_option("--certificate", o.certificate, "certificate chain for TLS, PEM")->type_name("FILE");
  sub.add_option("--key", o.key, "private key for TLS, PEM")->type_name("FILE");
  sub.add_option("--browser-token", o.browser_token, "file with the token that browsers must show")
      ->type_name("FILE");
  sub.add_option("--reports", o.reports,
                 "show the reports in this folder: .html of `drivebench test`, .json and .svg of `drivebench "
                 "identify`")
      ->type_name("FOLDER");
  sub.add_option(
         "--suites", o.suites,
         "let operators run `drivebench test` on the suites in this folder, and so every program that "
         "their cases name; needs --reports")
      ->type_name("FOLDER");
  sub.add_flag("--identify", o.identifies,
               "let operators identify motors from experiments of the bench; needs --reports");
  sub.add_option("--allow-origin", o.origins,
                 "a site whose page may read through Foxglove's WebSocket, such as https://app.foxglove.dev")
      ->type_name("ORIGIN");
  sub.footer("Example:\n  drivebench web --listen 127.0.0.1:7380");
}

}  // namespace drivebench::command
