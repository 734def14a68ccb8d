#pragma once

#include <bench.pb.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/link/common/address.hpp"
#include "clients/link/common/requests.hpp"
#include "clients/link/shm/bridge_memory.hpp"
#include "clients/link/shm/shared_memory.hpp"
#include "protocols/framing.hpp"

namespace drivebench::link {

struct LinkOptions {
  std::string client = "drivebench";  ///< a name for the server's log
  std::string token{};
  bool conducts = false;  ///< changes axes that other sessions hold; needs the role conductor
  std::chrono::milliseconds deadline{5000};  ///< for connecting and for every answer
};

/// The newest sample of an axis in the answer to an exchange.
using AxisSample = shm::SampleRecord;

/// The whole state of a bench.
struct SavedState {
  std::uint64_t tick;
  std::string state;
};

/// The client side of the wire (protocols/bench.proto) on one blocking socket, for one thread.
///
/// Every request throws RefusalError if the bench refuses it, and LinkError if the link fails or no answer
/// comes in time; after a LinkError the link stays closed. References to answers are valid until the next
/// request, whose arguments must not point into them. Samples of subscriptions that arrive meanwhile wait for
/// next_samples().
class Link {
 public:
  /// Connects and says hello. Throws AddressError, ConnectError, LinkError, RefusalError.
  explicit Link(std::string_view address, const LinkOptions& options = {})
      : Link(parse_address(address), options) {}
  Link(const Address& address, const LinkOptions& options);
  /// Uses a connected stream socket; `peer` is its name in errors.
  Link(FileDescriptor socket, std::string peer, const LinkOptions& options = {});
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  /// The bench's answer to hello.
  const v1::Welcome& welcome() const noexcept { return welcome_; }
  const std::string& peer() const noexcept { return peer_; }
  /// Sets the deadline of later answers. A lockstep exchange may wait for the controllers of other axes.
  void set_deadline(std::chrono::milliseconds deadline);

  /// Commands in, samples out: see Exchange in bench.proto. Lockstep: tick k runs, sample k+1 comes back.
  /// Real time: the first sample taken after the commands came in. No commands: the newest sample of every
  /// axis.
  std::span<const AxisSample> exchange(std::span<const AxisCommand> commands);

  /// The number that Sample.owner shows for this session.
  std::uint64_t acquire(std::uint32_t axis);
  void renew(std::uint32_t axis);
  void release(std::uint32_t axis);
  /// Acquires the axis from the session that holds it, which gets the reason. Needs the role of an
  /// administrator.
  std::uint64_t take(std::uint32_t axis, const std::string& reason);
  /// The notices of the bench since the last call: an administrator took an axis from this session, or its
  /// token is no longer valid.
  std::vector<v1::Notice> take_notices() { return std::exchange(notices_, {}); }

  /// Without names: all parameters.
  const v1::ParameterValues& read_parameters(std::uint32_t axis, std::span<const std::string> names = {});
  // These return the tick at whose start the request took effect.
  std::uint64_t write_parameter(std::uint32_t axis, const ParameterChange& change);
  std::uint64_t inject_fault(std::uint32_t axis, const FaultInjection& fault);
  /// A torque impulse on the shaft, positive like a machine torque.
  std::uint64_t bump_shaft(std::uint32_t axis, double impulse_nms, std::uint64_t at_tick = 0);
  std::uint64_t set_load(std::uint32_t axis, const LoadChange& change);
  std::uint64_t clear_faults(std::uint32_t axis);

  const v1::Status& status();

  // ---- states: see bench.proto ----
  SavedState save_state();
  /// Goes on from a saved state, with the leases as they are. Returns its tick.
  std::uint64_t restore_state(std::string_view state);
  /// Goes on from tick 0.
  void reset();

  /// Subscribes to every `decimation`-th tick; 0 ends the subscription. Without signals: all.
  void subscribe(std::uint32_t axis, std::uint32_t decimation, std::span<const std::string> signals = {});
  /// The oldest samples not yet taken; nothing if none come within `wait`.
  std::optional<v1::Samples> next_samples(std::chrono::milliseconds wait);

  // ---- experiments: see bench.proto ----
  v1::ExperimentInfo run_experiment(const v1::RunExperiment& wanted);
  v1::TableInfo upload_table(const v1::UploadTable& rows);
  v1::ExperimentList list_experiments(const std::string& owner);
  v1::ExperimentInfo cancel_experiment(std::uint64_t id, const std::string& owner);
  /// Begins to receive. No other request is allowed before the last ExperimentInfo, which has the state of
  /// the end.
  v1::ExperimentInfo begin_fetch(const v1::FetchExperiment& wanted);
  /// The next message, an ExperimentData or an ExperimentInfo.
  const v1::Envelope& next_of_fetch();

  /// A copy of an axis at gate level, over a unix socket only; both sides look for each other's word for so
  /// long before they sleep. It lives as long as this link.
  std::unique_ptr<BridgeMemory> share_bridge(std::uint32_t axis, std::chrono::microseconds spin);

  /// The most samples that wait for next_samples(); beyond it the oldest messages are lost and counted as
  /// dropped.
  static constexpr std::size_t kMaxKeptSamples = 65536;

 private:
  void hello(const LinkOptions& options);
  v1::Envelope& new_request();
  const v1::Envelope& ask(v1::Envelope& request, v1::Envelope::KindCase expected);
  void send(const v1::Envelope& request);
  const v1::Envelope& await_answer();
  v1::Envelope* next_envelope();
  void receive_some();
  bool look_before_sleeping(std::span<std::byte> space);
  std::ptrdiff_t receive_with_descriptors(std::span<std::byte> space);
  void share_memory(std::chrono::microseconds spin);
  std::vector<FileDescriptor> ask_for_memory(v1::Envelope& request, std::size_t count);
  std::span<const AxisSample> exchange_in_memory(std::span<const AxisCommand> commands);
  void keep_waiting_messages();
  std::uint64_t lease(std::uint32_t axis, v1::LeaseRequest::Action action);
  void keep(const v1::Samples& samples);
  void keep(const v1::Notice& notice);
  void keep_unasked(const v1::Envelope& envelope);
  [[noreturn]] void fail_late();
  /// `error`: of the call that found the end, or 0. An end, a reset and a broken pipe are told alike: which
  /// of them a peer that goes leaves behind depends on how far its bytes and ours had come.
  [[noreturn]] void fail_ended(int error);
  [[noreturn]] void fail(const std::string& what);

  FileDescriptor socket_;
  std::string peer_;
  std::chrono::milliseconds deadline_;
  std::chrono::microseconds spin_{0};
  v1::Welcome welcome_;
  std::uint64_t last_id_ = 0;
  std::vector<std::byte> out_;
  FrameReader reader_;
  std::vector<char> first_block_;  // the arena's first block, large enough for an exchange
  google::protobuf::Arena arena_;  // holds one request and its answer
  std::deque<v1::Samples> kept_;
  std::size_t kept_samples_ = 0;
  std::vector<v1::Notice> notices_;
  std::uint64_t dropped_ = 0;        // samples lost from kept_ since the last call
  std::vector<AxisSample> samples_;  // of the last exchange over the socket
  std::vector<FileDescriptor>* taken_ =
      nullptr;  // where to keep descriptors that come; null: they are closed
  std::unique_ptr<SharedMemory> memory_;
  bool is_subscribed_ = false;
};

/// Converts a message to a sample.
Sample plain(const v1::Sample& message);

}  // namespace drivebench::link
