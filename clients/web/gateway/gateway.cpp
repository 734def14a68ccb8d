#include "clients/web/gateway/gateway.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <exception>
#include <list>
#include <optional>
#include <string_view>
#include <vector>

#include "clients/reference/preset_fit.hpp"
#include "clients/web/gateway/doors/asio.hpp"
#include "clients/web/gateway/doors/door.hpp"
#include "clients/web/gateway/doors/tls_door.hpp"
#include "clients/web/gateway/page_files.hpp"
#include "clients/web/gateway/relays/foxglove_session.hpp"
#include "clients/web/gateway/relays/relay.hpp"
#include "clients/web/gateway/reports/report_folder.hpp"
#include "clients/web/gateway/reports/reports.hpp"
#include "clients/web/gateway/runs/runs.hpp"

namespace drivebench::web {
namespace {

using asio::use_awaitable;
using asio::ip::tcp;
using boost::system::error_code;
using namespace std::chrono_literals;

using Response = http::response<http::string_body>;

constexpr std::size_t kMaxConnections = 256;
constexpr std::size_t kMaxBrowsers = 64;
constexpr std::size_t kMaxHeader = 8192;
constexpr std::size_t kMinToken = 16;
constexpr int kMostReports = 4;  // that are sent at the same time
constexpr int kSendBuffer = 64 * 1024;
constexpr auto kWrongToken = 500ms;               // before the answer to a wrong token
constexpr std::string_view kPagePath = "/bench";  // of the page's WebSocket
constexpr std::string_view kFoxglovePath = "/";   // of Foxglove's, which a user enters without a path

/// No inline script or style, nothing from elsewhere, and no page that frames this one.
constexpr std::string_view kContentPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src "
    "'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A report is a page of its own in a box: no script, nothing from elsewhere, and no part of this origin.
constexpr std::string_view kReportPolicy =
    "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action "
    "'none'; "
    "frame-ancestors 'none'";
constexpr std::string_view kReportsPath = "/reports";
constexpr std::string_view kRunsPath = "/runs";

/// A connection as the others see it. One that waits for a request may have to give way to a new one.
struct Place {
  std::function<void()> close{};  ///< while it waits
};

bool runs_something(const GatewayOptions& options) {
  return !options.suites.empty() || options.identifies;
}

/// One thread runs everything but the calls that wait for the bench: those have threads of their own.
struct Shared {
  explicit Shared(const GatewayOptions& chosen)
      : options(chosen), files(read_page_files(chosen.page)), probe(chosen.bench, chosen.bench_token) {
    if (!chosen.certificate.empty()) tls.emplace(chosen.certificate, chosen.key);
    if (!chosen.reports.empty()) reports.emplace(chosen.reports);
    if (runs_something(chosen))
      relays.runs = &runs.emplace(RunPlaces{.reports = chosen.reports,
                                            .bench = chosen.bench,
                                            .bench_token = chosen.bench_token,
                                            .verb = chosen.verb},
                                  chosen.suites, chosen.identifies);
  }

  GatewayOptions options;
  PageFiles files;
  Door door{};
  std::optional<TlsDoor> tls{};
  std::optional<ReportFolder> reports{};
  std::optional<Runs> runs{};
  int sent_reports = 0;  ///< at this moment
  BenchProbe probe;
  GatewayCounts counts{};
  std::list<Place> places{};
  asio::thread_pool connecting{4};
  RelayContext relays{
      .bench = options.bench, .bench_token = options.bench_token, .counts = counts, .connecting = connecting};
  asio::thread_pool probing{1};
};

beast::string_view view(std::string_view text) {
  return {text.data(), text.size()};
}
std::string_view view(beast::string_view text) {
  return {text.data(), text.size()};
}

Response answer_of(const Request& request, unsigned status, std::string_view type, std::string body) {
  Response response(static_cast<http::status>(status), request.version());
  response.set(http::field::content_type, view(type));
  response.set("Content-Security-Policy", view(kContentPolicy));
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Opener-Policy", "same-origin");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set(http::field::cache_control, "no-cache");
  if (status == 401) response.set(http::field::www_authenticate, "Basic realm=\"drivebench\"");
  if (status == 405) response.set(http::field::allow, "GET, HEAD");
  response.keep_alive(request.keep_alive() && status < 400);
  response.body() = std::move(body);
  response.prepare_payload();
  if (request.method() == http::verb::head) response.body().clear();
  return response;
}

const std::string kNoSubprotocol = fmt::format("a WebSocket here offers one of the subprotocols {}\n",
                                               fmt::join(kFoxgloveSubprotocols, ", "));
constexpr std::string_view kText = "text/plain; charset=utf-8";

asio::awaitable<Response> report(Shared& shared, const Request& request, bool is_metrics) {
  const auto read = [&probe = shared.probe]() -> asio::awaitable<Reading> { co_return probe.read(); };
  const Reading reading = co_await asio::co_spawn(shared.probing, read, use_awaitable);
  if (is_metrics) {
    shared.counts.connections = shared.places.size();
    co_return answer_of(request, 200, "text/plain; version=0.0.4; charset=utf-8",
                        metrics_text(reading, shared.counts));
  }
  co_return answer_of(request, reading.problem.empty() ? 200 : 503, "application/json", health_json(reading));
}

/// The list of the reports, or one of them. A thread of its own waits for the disk.
asio::awaitable<Response> respond_with_report(Shared& shared, const Request& request) {
  const std::string_view target = view(request.target());
  if (!shared.reports) {
    co_return target == kReportsPath ? answer_of(request, 200, "application/json", "null")
                                     : answer_of(request, 404, kText, "no folder of reports is shown\n");
  }
  if (target == kReportsPath) {
    const auto list = [&folder = *shared.reports]() -> asio::awaitable<std::string> {
      co_return folder.list();
    };
    std::string text = co_await asio::co_spawn(shared.probing, list, use_awaitable);
    co_return answer_of(request, 200, "application/json", std::move(text));
  }
  if (shared.sent_reports > kMostReports) {
    co_return answer_of(request, 503, kText, "other browsers read reports: try again\n");
  }
  const auto find = [&folder = *shared.reports, name = target.substr(kReportsPath.size() + 1)]()
      -> asio::awaitable<std::optional<ReportFile>> { co_return folder.find(name); };
  std::optional<ReportFile> file = co_await asio::co_spawn(shared.probing, find, use_awaitable);
  if (!file) co_return answer_of(request, 404, kText, "no such report\n");
  if (file->is_too_large) {
    co_return answer_of(request, 413, kText,
                        fmt::format("the report is larger than {} MiB\n", ReportFolder::kMostBytes >> 20));
  }
  Response response = answer_of(request, 200, file->type, std::move(file->bytes));
  response.set("Content-Security-Policy", view(kReportPolicy));
  co_return response;
}

/// The suites and the runs, or null. A thread of its own waits for the disk.
asio::awaitable<Response> respond_with_runs(Shared& shared, const Request& request) {
  const auto list = [&runs = shared.runs]() -> asio::awaitable<std::string> {
    co_return runs ? runs->list() : "null";
  };
  std::string text = co_await asio::co_spawn(shared.probing, list, use_awaitable);
  co_return answer_of(request, 200, "application/json", std::move(text));
}

bool asks_for_report(const Request& request) {
  const std::string_view target = view(request.target());
  return target == kReportsPath || (target.starts_with(kReportsPath) && target[kReportsPath.size()] == '/');
}

asio::awaitable<Response> respond(Shared& shared, const Request& request) {
  const std::string_view target = view(request.target());
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    co_return answer_of(request, 405, kText, "only GET and HEAD\n");
  }
  if (target == "/metrics" || target == "/health") {
    Response response = co_await report(shared, request, target == "/metrics");
    co_return response;
  }
  if (asks_for_report(request)) {
    Response response = co_await respond_with_report(shared, request);
    co_return response;
  }
  if (target == kRunsPath) {
    Response response = co_await respond_with_runs(shared, request);
    co_return response;
  }
  if (target == kFoxglovePath && websocket::is_upgrade(request)) {
    co_return answer_of(request, 400, kText, kNoSubprotocol);
  }
  if (target == kPagePath) co_return answer_of(request, 426, kText, "a WebSocket\n");
  const auto file = shared.files.find(target);
  if (file == shared.files.end()) co_return answer_of(request, 404, kText, "no such page\n");
  co_return answer_of(request, 200, file->second.type, file->second.bytes);
}

/// The WebSocket that a request asks for.
struct Wish {
  bool is_page = false;
  std::string_view subprotocol{};  ///< of Foxglove

  bool is_foxglove() const noexcept { return !subprotocol.empty(); }
  bool is_socket() const noexcept { return is_page || is_foxglove(); }
};

Wish wish_of(const Request& request) {
  if (!websocket::is_upgrade(request)) return {};
  const std::string_view target = view(request.target());
  if (target == kPagePath) return {.is_page = true, .subprotocol = {}};
  if (target != kFoxglovePath) return {};
  return {.is_page = false,
          .subprotocol = foxglove_subprotocol(view(request[http::field::sec_websocket_protocol]))};
}

asio::awaitable<void> relay(RelayContext& context, Stream stream, const Request& request, const Wish& wish) {
  return wish.is_page ? relay_page(context, std::move(stream), request)
                      : relay_foxglove(context, std::move(stream), request, wish.subprotocol);
}

/// Counts an answer while it is made and sent.
class Sending {
 public:
  Sending(int& count, bool counts) : count_(count), counts_(counts) { count_ += counts_ ? 1 : 0; }
  ~Sending() { count_ -= counts_ ? 1 : 0; }
  Sending(const Sending&) = delete;
  Sending& operator=(const Sending&) = delete;

 private:
  int& count_;
  bool counts_;
};

asio::awaitable<void> converse(Shared& shared, Stream stream, Place& place) {
  beast::flat_buffer buffer;
  for (bool goes_on = true; goes_on;) {
    place.close = [&stream] { stream.close(); };
    stream.expires_after(kRequestTime);
    http::request_parser<http::empty_body> parser;
    parser.header_limit(kMaxHeader);
    co_await http::async_read(stream, buffer, parser, use_awaitable);
    place.close = nullptr;
    const Request request = parser.release();
    ++shared.counts.requests;
    const Wish wish = wish_of(request);
    std::optional<DoorRefusal> refusal =
        refusal_of(shared.door, {.host = view(request[http::field::host]),
                                 .origin = view(request[http::field::origin]),
                                 .authorization = view(request[http::field::authorization]),
                                 .is_foxglove = wish.is_foxglove()});
    if (!refusal && wish.is_socket() && shared.counts.browsers >= kMaxBrowsers) {
      refusal = DoorRefusal{.status = 503, .name = "browsers", .sentence = "too many browsers are connected"};
    }
    if (!refusal && wish.is_socket()) {
      stream.expires_never();
      co_await relay(shared.relays, std::move(stream), request, wish);
      co_return;
    }
    const Sending sending(shared.sent_reports, !refusal && asks_for_report(request));
    Response response;
    if (refusal) {
      ++shared.counts.refusals[refusal->name];
      response = answer_of(request, refusal->status, kText, std::string(refusal->sentence) + "\n");
      if (refusal->status == 401) {
        asio::steady_timer pause(stream.get_executor(), kWrongToken);
        co_await pause.async_wait(use_awaitable);
      }
    } else {
      response = co_await respond(shared, request);
    }
    stream.expires_after(kRequestTime);
    co_await http::async_write(stream, response, use_awaitable);
    goes_on = response.keep_alive();
  }
}

asio::awaitable<void> welcome(Shared& shared, tcp::socket socket, std::list<Place>::iterator place) {
  try {
    if (shared.tls) {
      auto plain = co_await shared.tls->shake_hands(std::move(socket), place->close);
      co_await converse(shared, Stream(std::move(plain)), *place);
    } else {
      co_await converse(shared, Stream(std::move(socket)), *place);
    }
  } catch (const std::exception&) {
    // The connection has failed, is too slow or does not speak HTTP: it ends, and nothing else.
  }
  shared.places.erase(place);
}

/// Closes the oldest connection that waits for a request; false if there is none.
bool make_room(Shared& shared) {
  const auto waiting =
      std::ranges::find_if(shared.places, [](const Place& place) { return place.close != nullptr; });
  if (waiting == shared.places.end()) return false;
  std::exchange(waiting->close, nullptr)();
  return true;
}

asio::awaitable<void> admit(Shared& shared, tcp::acceptor& acceptor) {
  for (;;) {
    error_code error;
    tcp::socket socket = co_await acceptor.async_accept(asio::redirect_error(use_awaitable, error));
    if (error) {  // such as too many open files
      asio::steady_timer pause(acceptor.get_executor(), 100ms);
      co_await pause.async_wait(use_awaitable);
      continue;
    }
    if (shared.places.size() >= kMaxConnections) {
      ++shared.counts.refusals["connections"];
      if (!make_room(shared)) continue;
    }
    socket.set_option(tcp::no_delay(true), error);
    // What the kernel holds for a slow browser comes late: the queue drops samples, the kernel does not.
    socket.set_option(tcp::socket::send_buffer_size(kSendBuffer), error);
    const auto place = shared.places.emplace(shared.places.end());
    asio::co_spawn(acceptor.get_executor(), welcome(shared, std::move(socket), place), asio::detached);
  }
}

void check(const GatewayOptions& options) {
  link::parse_address(options.bench);
  if (options.certificate.empty() != options.key.empty()) {
    throw StartError("--certificate and --key are given together or not at all");
  }
  if (!options.listen.is_loopback && (options.certificate.empty() || options.browser_token.empty())) {
    throw StartError(
        "--listen " + to_string(options.listen) +
        ": others can reach this address, so that it needs --certificate, --key and --browser-token");
  }
  if (runs_something(options) && options.reports.empty())
    throw StartError("--suites and --identify need --reports: a folder for the results");
  for (const std::string& origin : options.foxglove_origins) {
    if (!is_origin(origin)) {
      throw StartError("--allow-origin " + origin +
                       ": an origin is SCHEME://HOST or SCHEME://HOST:PORT without a path, or file://");
    }
  }
  if (!options.browser_token.empty() && options.browser_token.size() < kMinToken) {
    throw StartError("--browser-token: the token must have at least " + std::to_string(kMinToken) +
                     " characters");
  }
}

tcp::acceptor listen(asio::io_context& io, const ListenAddress& address) {
  try {
    return {io, tcp::endpoint(asio::ip::make_address(address.host), address.port)};
  } catch (const boost::system::system_error& error) {
    throw StartError("--listen " + to_string(address) + ": " + error.code().message());
  }
}

}  // namespace

void run_gateway(const GatewayOptions& options, const std::function<void(const std::string& url)>& ready) {
  check(options);
  Shared shared(options);
  asio::io_context io(1);
  tcp::acceptor acceptor = listen(io, options.listen);
  shared.door = {.address = options.listen,
                 .tls = shared.tls.has_value(),
                 .token = options.browser_token,
                 .foxglove_origins = options.foxglove_origins};
  shared.door.address.port = acceptor.local_endpoint().port();
  asio::co_spawn(io, admit(shared, acceptor), asio::detached);
  asio::post(shared.connecting, reference::prepare_presets);  // before a page asks, and an axis waits for it
  asio::signal_set signals(io, SIGINT, SIGTERM);
  signals.async_wait([&io](const error_code&, int) { io.stop(); });
  ready((shared.door.tls ? "https://" : "http://") + to_string(shared.door.address) + "/");
  io.run();
  shared.connecting.join();  // their answers go to `io`
  shared.probing.join();
}

}  // namespace drivebench::web
