#include "clients/web/gateway/gateway.hpp"

#include <fcntl.h>

#include <algorithm>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <csignal>
#include <exception>
#include <list>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "clients/web/gateway/asio.hpp"
#include "clients/web/gateway/door.hpp"
#include "clients/web/gateway/frames.hpp"
#include "clients/web/gateway/page_files.hpp"
#include "clients/web/gateway/reports.hpp"
#include "clients/web/gateway/send_queue.hpp"
#include "clients/web/gateway/tls_door.hpp"
#include "protocols/framing.hpp"

namespace drivebench::web {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::use_awaitable;
using asio::ip::tcp;
using boost::system::error_code;
using namespace std::chrono_literals;

using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;
using Stream = beast::basic_stream<asio::generic::stream_protocol>;

constexpr std::size_t kMaxConnections = 256;
constexpr std::size_t kMaxBrowsers = 64;
constexpr std::size_t kMaxHeader = 8192;
constexpr std::size_t kMinToken = 16;
constexpr int kSendBuffer = 64 * 1024;
constexpr auto kRequestTime = 10s;      // for a handshake, a request or an answer
constexpr auto kSilence = 30s;          // of a browser that answers no ping
constexpr auto kBetweenMessages = 4ms;  // to a browser: many small frames become one message
constexpr auto kWrongToken = 500ms;     // before the answer to a wrong token
constexpr std::string_view kWebSocketPath = "/bench";

/// No inline script or style, nothing from elsewhere, and no page that frames this one.
constexpr std::string_view kContentPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src "
    "'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A connection as the others see it. One that waits for a request may have to give way to a new one.
struct Place {
  std::function<void()> close{};  ///< while it waits
};

/// One thread runs everything but the calls that wait for the bench: those have threads of their own.
struct Shared {
  explicit Shared(const GatewayOptions& chosen)
      : options(chosen), files(read_page_files(chosen.page)), probe(chosen.bench, chosen.bench_token) {
    if (!chosen.certificate.empty()) tls.emplace(chosen.certificate, chosen.key);
  }

  GatewayOptions options;
  PageFiles files;
  Door door{};
  std::optional<TlsDoor> tls{};
  BenchProbe probe;
  GatewayCounts counts{};
  std::list<Place> places{};
  asio::thread_pool connecting{4};
  asio::thread_pool probing{1};
};

/// A browser's WebSocket and its session with the bench. Three coroutines share it; the one that sends to the
/// browser also closes.
class Relay : public std::enable_shared_from_this<Relay> {
 public:
  Relay(Shared& shared, Stream stream)
      : shared_(shared),
        browser_(std::move(stream)),
        bench_(browser_.get_executor()),
        pause_(browser_.get_executor()) {
    ++shared_.counts.browsers;
  }
  ~Relay() { --shared_.counts.browsers; }
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  asio::awaitable<void> run(Request request) {
    browser_.set_option(websocket::stream_base::timeout{kRequestTime, kSilence, true});
    browser_.read_message_max(kFrameHeaderSize + kMaxRequestFrame);
    browser_.binary(true);
    browser_.auto_fragment(false);
    co_await browser_.async_accept(request, use_awaitable);
    const bool is_connected = co_await connect();
    if (is_connected) {
      const auto self = shared_from_this();
      asio::co_spawn(
          browser_.get_executor(), [self] { return self->to_bench(); }, asio::detached);
      asio::co_spawn(
          browser_.get_executor(), [self] { return self->from_bench(); }, asio::detached);
      co_await to_browser();
    }
    error_code ignored;
    co_await browser_.async_close(reason_, asio::redirect_error(use_awaitable, ignored));
    bench_.close(ignored);
  }

 private:
  /// Connects to the bench on another thread, since that may wait.
  asio::awaitable<bool> connect() {
    const auto open = [address = shared_.options.bench]() -> asio::awaitable<int> {
      const link::FileDescriptor socket = link::connect_to(link::parse_address(address), 3000ms);
      co_return ::fcntl(socket.get(), F_DUPFD_CLOEXEC, 0);
    };
    try {
      const int socket = co_await asio::co_spawn(shared_.connecting, open, use_awaitable);
      bench_.assign(asio::generic::stream_protocol(AF_UNSPEC, 0), socket);
      co_return true;
    } catch (const std::exception& error) {
      end(websocket::close_code::try_again_later, error.what());
    }
    co_return false;
  }

  /// Notes the reason for the browser; the first one counts.
  void end(websocket::close_code code, std::string_view why) {
    if (reason_.code == websocket::close_code::none) {
      reason_ = websocket::close_reason(
          code, beast::string_view(why.data(), std::min<std::size_t>(why.size(), 120)));
    }
    error_code ignored;
    bench_.close(ignored);
    pause_.cancel();
  }

  asio::awaitable<void> to_bench() {
    error_code error;
    for (beast::flat_buffer buffer; !error; buffer.clear()) {
      co_await browser_.async_read(buffer, asio::redirect_error(use_awaitable, error));
      if (error) break;
      const std::span message(static_cast<const std::byte*>(buffer.data().data()), buffer.size());
      const std::string_view problem =
          browser_.got_binary() ? problem_of_frames(message) : "messages are binary";
      if (!problem.empty()) {
        ++shared_.counts.refusals["frame"];
        end(websocket::close_code::protocol_error, problem);
        co_return;
      }
      shared_.counts.bytes_to_bench += message.size();
      co_await asio::async_write(bench_, buffer.data(), asio::redirect_error(use_awaitable, error));
    }
    if (error == websocket::error::message_too_big) ++shared_.counts.refusals["size"];
    end(websocket::close_code::normal, "");
  }

  /// Reads on however slow the browser is: the server would end a session that takes nothing.
  asio::awaitable<void> from_bench() {
    FrameReader reader(kMaxReplyFrame);
    bool is_taken = true;
    for (error_code error; !error && is_taken && reader.error().empty();) {
      const std::span<std::byte> space = reader.free_space();
      reader.received(co_await bench_.async_read_some(asio::buffer(space.data(), space.size()),
                                                      asio::redirect_error(use_awaitable, error)));
      while (const auto frame = reader.next())
        is_taken = queue_.add(*frame) && is_taken;
      pause_.cancel();
      if (error) break;
      asio::steady_timer between(browser_.get_executor(), kBetweenMessages);
      co_await between.async_wait(use_awaitable);
    }
    end(websocket::close_code::going_away,
        is_taken ? "the bench has ended the session" : "the browser reads too slowly");
  }

  asio::awaitable<void> to_browser() {
    std::vector<std::byte> message;
    for (error_code error; !error;) {
      queue_.take(message);
      if (message.empty()) {
        if (reason_.code != websocket::close_code::none) co_return;
        pause_.expires_at(asio::steady_timer::time_point::max());
        co_await pause_.async_wait(asio::redirect_error(use_awaitable, error));
        error = {};
        continue;
      }
      co_await browser_.async_write(asio::buffer(message), asio::redirect_error(use_awaitable, error));
      shared_.counts.bytes_to_browsers += message.size();
    }
    end(websocket::close_code::normal, "");
  }

  Shared& shared_;
  websocket::stream<Stream> browser_;
  asio::generic::stream_protocol::socket bench_;
  asio::steady_timer pause_;  // of to_browser(), until there is something to send
  SendQueue queue_{};
  websocket::close_reason reason_{websocket::close_code::none};
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

asio::awaitable<Response> respond(Shared& shared, const Request& request) {
  const std::string_view target = view(request.target());
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    co_return answer_of(request, 405, kText, "only GET and HEAD\n");
  }
  if (target == "/metrics" || target == "/health") {
    Response response = co_await report(shared, request, target == "/metrics");
    co_return response;
  }
  if (target == kWebSocketPath) co_return answer_of(request, 426, kText, "a WebSocket\n");
  const auto file = shared.files.find(target);
  if (file == shared.files.end()) co_return answer_of(request, 404, kText, "no such page\n");
  co_return answer_of(request, 200, file->second.type, file->second.bytes);
}

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
    std::optional<DoorRefusal> refusal =
        refusal_of(shared.door, {.host = view(request[http::field::host]),
                                 .origin = view(request[http::field::origin]),
                                 .authorization = view(request[http::field::authorization])});
    const bool is_browser = websocket::is_upgrade(request) && view(request.target()) == kWebSocketPath;
    if (!refusal && is_browser && shared.counts.browsers >= kMaxBrowsers) {
      refusal = DoorRefusal{.status = 503, .name = "browsers", .sentence = "too many browsers are connected"};
    }
    if (!refusal && is_browser) {
      stream.expires_never();
      co_await std::make_shared<Relay>(shared, std::move(stream))->run(request);
      co_return;
    }
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
  shared.door = {.address = options.listen, .tls = shared.tls.has_value(), .token = options.browser_token};
  shared.door.address.port = acceptor.local_endpoint().port();
  asio::co_spawn(io, admit(shared, acceptor), asio::detached);
  asio::signal_set signals(io, SIGINT, SIGTERM);
  signals.async_wait([&io](const error_code&, int) { io.stop(); });
  ready((shared.door.tls ? "https://" : "http://") + to_string(shared.door.address) + "/");
  io.run();
  shared.connecting.join();  // their answers go to `io`
  shared.probing.join();
}

}  // namespace drivebench::web
