#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench.pb.h"
#include "protocols/framing.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"
#include "server/access/admission.hpp"
#include "server/access/audit.hpp"
#include "server/endpoints/deadline.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/endpoints/tcp/audience.hpp"
#include "server/endpoints/tcp/outbox.hpp"
#include "server/endpoints/transport_report.hpp"
#include "server/engine/engine.hpp"
#include "server/experiments/experiments.hpp"
#include "server/experiments/row_file.hpp"

namespace drivebench {

/// What all sessions share.
struct SessionContext {
  Engine& engine;
  Admission admission;
  Audience& audience;
  std::function<std::size_t()> session_count;
  std::function<std::vector<TransportReport>()> transports;  ///< all ways in
  Experiments* experiments;                                  ///< null: this bench keeps none
  Audit* audit = nullptr;                                    ///< null: no audit log is kept

  struct Counts {
    std::uint64_t turned_away = 0;      ///< connections, by a limit
    std::uint64_t tls_refused = 0;      ///< connections that did not get through the TLS handshake
    std::uint64_t malformed = 0;        ///< sessions that sent what no client of this protocol does
    std::uint64_t wrong_tokens = 0;     ///< hellos
    std::uint64_t excess_commands = 0;  ///< exchanges, in real time, that no tick can use
    std::uint64_t throttled = 0;        ///< times that a session was not read for a while
    std::uint64_t cut = 0;              ///< sessions that took or said nothing
  } counts{};
  std::shared_ptr<OutboxPool> outboxes = std::make_shared<OutboxPool>();
  v1::Envelope reply{};              ///< the one that is being written, by whichever session
  std::vector<std::byte> scratch{};  ///< its bytes
  LogLimit wrong_token_log{};
};

/// One client on a stream socket: Hello first, then requests. Every request gets an answer with its id; what
/// cannot be done is refused with a code, a sentence and the field. An error ends this session and nothing
/// else.
class Session : public std::enable_shared_from_this<Session> {
 public:
  /// `who` without a subject, which hello tells.
  Session(Outbox::Socket socket, Client who, SessionContext& context);

  /// Reads and answers until the peer or an error ends the session, then gives its leases back.
  asio::awaitable<void> run();

  /// When newest() of the engine is up to date: answers a waiting exchange.
  void on_newest();
  /// Sends the samples that wait; false if there are none, or the peer takes nothing now.
  bool send_samples();
  /// When an experiment may have gone on: serves a fetch.
  void on_experiments();
  /// When an administrator has taken an axis from somebody: tells the session if it was this one.
  void on_taken(const Taken& taken);
  /// When other tokens hold: ends the session if its own does not.
  void on_new_grants();
  bool greeted() const noexcept { return greeted_; }

  /// When somebody who passes on what this session sends finds that the peer takes nothing.
  void on_deaf() { outbox_.cut_deaf(); }

  /// Refuses the connection itself, before anything was read.
  void turn_away(std::string_view sentence);
  void close();

 private:
  static constexpr auto kHelloLimit = std::chrono::seconds(2);
  static constexpr auto kFrameLimit = std::chrono::seconds(2);  ///< of silence within a frame
  /// So many commands may come at once that no tick can use, and one more with every tick.
  static constexpr double kExcessAtOnce = 1000.0;
  static constexpr auto kLongestThrottle = std::chrono::seconds(1);
  static constexpr std::size_t kSamplesPerMessage = 32;
  /// A turn of this session ends after so much; then the others have theirs.
  static constexpr int kRequestsPerTurn = 64;
  static constexpr std::size_t kReplyBytesPerTurn = std::size_t{16} * 1024;

  struct Subscription {
    std::uint32_t axis;
    SignalMask mask;
    std::shared_ptr<const SampleFeed> feed;
    SampleFeed::Reader reader;
  };
  struct WaitingExchange {
    std::uint64_t id;
    std::vector<std::uint32_t> axes;
  };

  /// A fetch that is going on.
  struct Fetch {
    std::uint64_t id;  ///< of the request
    std::shared_ptr<const Experiment> experiment;
    bool recording;
    std::uint64_t next;                ///< row, or byte of the recording
    std::size_t row_bytes;             ///< 1 for a recording
    std::unique_ptr<FileReader> file;  ///< opened when there is something to read
    ServerClock::time_point last_info;
    int send_buffer_bytes;  ///< of the socket, before and after
  };

  /// How far the frames that are there have been answered.
  enum class Turn { kAll, kMoreToCome, kOver };
  Turn handle_some();
  bool handle(std::span<const std::byte> frame);
  bool dispatch();
  bool may_ask();
  void watch_for_silence();
  void charge_excess();
  void refill_excess();
  ServerClock::duration throttle();
  void watch_slot();
  void end(const std::string& sentence);
  void audit(std::string_view event, std::string_view result, std::vector<AuditDetail> details);
  bool greet(const v1::Hello& hello);
  bool end_malformed(v1::RefusalCode code, const std::string& sentence, const char* field);
  bool is_admitted(const v1::Hello& hello);
  void notify(v1::Notice::Kind kind, const std::string& sentence, std::uint32_t axis);
  void lease(const v1::LeaseRequest& request);
  void exchange(const v1::Exchange& request);
  void abandon_exchange(std::uint32_t axis);
  std::string not_owner_of(std::uint32_t axis) const;
  void subscribe(const v1::Subscribe& request);
  void read_parameters(const v1::ReadParameters& request);
  void write_parameter(const v1::WriteParameter& request);
  void set_load(const v1::SetLoad& request);
  void inject_fault(const v1::InjectFault& request);
  void bump_shaft(const v1::ShaftBump& request);
  void clear_faults(const v1::ClearFaults& request);
  void report_status();
  void run_experiment(const v1::RunExperiment& request);
  void upload_table(const v1::UploadTable& request);
  void list_experiments(const v1::ListExperiments& request);
  void fetch_experiment(const v1::FetchExperiment& request);
  void cancel_experiment(const v1::CancelExperiment& request);

  /// Carries out a request about experiments; what it throws becomes a refusal.
  template <class Action>
  void with_experiments(Action action);
  void send_experiment();
  bool send_rows(std::size_t& budget);
  void end_fetch();
  void send_info(std::uint64_t id, const Experiment& experiment);

  /// These refuse the present request if the answer is no.
  bool axis_exists(std::uint32_t axis);
  bool may_change(std::uint32_t axis);
  bool is_tick(std::uint64_t ticks, const char* field);
  bool is_within(double value, double bound, std::string_view unit, const char* field);

  void take(const v1::LeaseRequest& request, Engine::Answer answer);
  void request(const Input& input, const char* field, std::function<void()> on_done = nullptr);
  Engine::Answer answer_for(const char* field, std::function<void()> on_done, std::uint32_t axis);
  void refuse_owned(std::uint64_t id, std::uint32_t axis);
  void done(std::uint64_t id, Tick tick);
  void refuse(std::uint64_t id, v1::RefusalCode code, const std::string& message, const char* field);
  void refuse(std::uint64_t id, Refused why, const char* field);
  void reply_exchange(std::uint64_t id, std::span<const std::uint32_t> axes);
  void send(const v1::Envelope& envelope);
  void give_leases_back();

  Outbox::Socket socket_;
  Outbox outbox_;
  Client client_;
  SessionContext& context_;
  Engine& engine_;
  FrameReader reader_;
  v1::Envelope request_;
  std::size_t last_frame_ = 0;
  std::size_t replied_bytes_ = 0;  // in this turn
  v1::Envelope& reply_;
  std::vector<std::byte>& scratch_;
  std::vector<AxisSampleView> views_;
  bool greeted_ = false;
  bool over_ = false;  ///< the peer is gone
  Grant grant_;
  ServerTimer slot_timer_;  // runs to the end of the grant
  Deadline silence_;        // runs until hello, and while a frame is not whole
  std::string why_ended_ = "the peer left";
  double excess_left_ = kExcessAtOnce;
  ServerClock::time_point excess_refilled_ = ServerClock::now();
  Owner owner_ = 0;
  std::vector<bool> leased_;          // by axis
  std::size_t leases_in_flight_ = 0;  // requests without an answer yet
  std::vector<std::string> taken_;    // by axis: who took it from this session, and why
  std::optional<WaitingExchange> waiting_;
  std::vector<Subscription> subscriptions_;
  std::optional<Fetch> fetch_;
  std::map<std::uint64_t, std::shared_ptr<SignalTable>> tables_;  // by number
  std::uint64_t last_table_ = 0;
};

}  // namespace drivebench
