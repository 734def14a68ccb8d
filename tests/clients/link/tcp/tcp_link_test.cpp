// The link against a peer that answers whatever a test wants, good and bad.
#include "clients/link/tcp/tcp_link.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <thread>
#include <utility>
#include <vector>

#include "tests/clients/link/tcp/fake_peer.hpp"

namespace drivebench::link::tcp_link_test {
namespace {

using namespace std::chrono_literals;

/// A welcome to Hello; for the rest what `rest` says.
FakePeer::Answer welcoming(FakePeer::Answer rest) {
  return [rest = std::move(rest)](const v1::Envelope& request) {
    if (!request.has_hello()) return rest(request);
    v1::Envelope welcome;
    welcome.set_id(request.id());
    welcome.mutable_welcome()->set_protocol(1);
    welcome.mutable_welcome()->mutable_bench()->set_name("bench of " + request.hello().client());
    return FakePeer::framed(welcome);
  };
}

v1::Envelope answer_to(const v1::Envelope& request) {
  v1::Envelope answer;
  answer.set_id(request.id());
  return answer;
}

std::string samples_frame(std::uint32_t axis, std::uint64_t first_tick, int count) {
  v1::Envelope unasked;
  unasked.mutable_samples()->set_axis(axis);
  for (int i = 0; i < count; ++i)
    unasked.mutable_samples()->add_samples()->set_tick(first_tick + static_cast<std::uint64_t>(i));
  return FakePeer::framed(unasked);
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const LinkError& error) {
    return error.what();
  }
  return "no error";
}

// Catches: a Hello without its name or a welcome that is lost when the arena is reset.
TEST(Link, KeepsTheWelcomeOverLaterRequests) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope answer = answer_to(request);
    answer.mutable_status()->set_tick(7);
    return FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "peer", {.client = "me"});
  EXPECT_EQ(link.status().tick(), 7U);
  EXPECT_EQ(link.status().tick(), 7U);
  EXPECT_EQ(link.welcome().bench().name(), "bench of me");
}

// Catches: a field of a command that is not sent, and an answer that belongs to another request.
TEST(Link, SendsEveryFieldOfACommandAndReturnsItsSamples) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope answer = answer_to(request);
    for (const v1::Command& command : request.exchange().commands()) {
      v1::AxisSample& sample = *answer.mutable_exchange_reply()->add_samples();
      sample.set_axis(command.axis());
      sample.mutable_sample()->set_tick(command.tick() + 1);
      sample.mutable_sample()->set_u_a_v(command.u_a_v());
      sample.mutable_sample()->set_u_b_v(command.u_b_v());
      sample.mutable_sample()->set_u_c_v(command.u_c_v());
      sample.mutable_sample()->set_u_f_v(command.u_f_v());
      sample.mutable_sample()->set_i_a_a(command.i_a_a());
      sample.mutable_sample()->set_i_b_a(command.i_b_a());
      sample.mutable_sample()->set_i_c_a(command.i_c_a());
      sample.mutable_sample()->set_i_f_a(command.i_f_a());
      sample.mutable_sample()->set_terminal_a_v(command.d_a());
      sample.mutable_sample()->set_terminal_b_v(command.d_b());
      sample.mutable_sample()->set_terminal_c_v(command.d_c());
      sample.mutable_sample()->set_terminal_a_mean_v(command.d_f());
      sample.mutable_sample()->set_faults(command.legs_off());
      sample.mutable_sample()->set_state(static_cast<std::uint64_t>(command.gates()));
    }
    return FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "peer");
  for (std::uint64_t tick = 0; tick < 1000; ++tick) {
    const AxisCommand commands[] = {{.axis = 3,
                                     .tick = tick,
                                     .gates = v1::GATES_ZERO,
                                     .u_a_v = 1.5,
                                     .u_b_v = -2.5,
                                     .u_c_v = 3.5,
                                     .u_f_v = -4.5},
                                    {.axis = 4,
                                     .tick = tick,
                                     .gates = v1::GATES_CURRENT,
                                     .u_a_v = 4.0,
                                     .i_a_a = 5.0,
                                     .i_b_a = -6.0,
                                     .i_c_a = 7.0,
                                     .i_f_a = -8.0},
                                    {.axis = 5,
                                     .tick = tick,
                                     .gates = v1::GATES_DUTY,
                                     .d_a = 0.25,
                                     .d_b = 0.5,
                                     .d_c = 1.0,
                                     .d_f = -0.75,
                                     .legs_off = 6}};
    const std::span<const AxisSample> reply = link.exchange(commands);
    ASSERT_EQ(reply.size(), 3);
    EXPECT_EQ(reply[0].axis, 3U);
    EXPECT_EQ(reply[0].sample.tick, tick + 1);
    EXPECT_EQ(reply[0].sample.u_a_v, 1.5);
    EXPECT_EQ(reply[0].sample.u_b_v, -2.5);
    EXPECT_EQ(reply[0].sample.u_c_v, 3.5);
    EXPECT_EQ(reply[0].sample.u_f_v, -4.5);
    EXPECT_EQ(reply[0].sample.state, 2U);
    const Sample& second = reply[1].sample;
    EXPECT_EQ(second.u_a_v, 4.0);
    EXPECT_EQ((std::array{second.i_a_a, second.i_b_a, second.i_c_a, second.i_f_a}),
              (std::array{5.0, -6.0, 7.0, -8.0}));
    EXPECT_EQ(second.state, 3U);
    const Sample& third = reply[2].sample;
    EXPECT_EQ(third.state, 4U);
    EXPECT_EQ(
        (std::array{third.terminal_a_v, third.terminal_b_v, third.terminal_c_v, third.terminal_a_mean_v}),
        (std::array{0.25, 0.5, 1.0, -0.75}));
    EXPECT_EQ(third.faults, 6U);
  }
}

// Catches: a field of a change that is not sent, or sent as another one.
TEST(Link, SendsEveryFieldOfAChange) {
  std::vector<v1::Envelope> requests;
  FakePeer peer(welcoming([&requests](const v1::Envelope& request) {
    requests.push_back(request);
    v1::Envelope answer = answer_to(request);
    answer.mutable_done()->set_tick(40 + requests.size());
    return FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "peer");
  EXPECT_EQ(link.write_parameter(3, {.name = "x", .value = 5.0, .ramp_ticks = 6, .at_tick = 7}), 41U);
  EXPECT_EQ(link.inject_fault(4, {.name = "y", .value = -5.0, .at_tick = 8}), 42U);
  EXPECT_EQ(link.bump_shaft(5, -0.25, 9), 43U);
  ASSERT_EQ(requests.size(), 3U);
  v1::WriteParameter write;
  write.set_axis(3);
  write.set_name("x");
  write.set_value(5.0);
  write.set_ramp_ticks(6);
  write.set_at_tick(7);
  EXPECT_EQ(requests[0].write_parameter().DebugString(), write.DebugString());
  v1::InjectFault fault;
  fault.set_axis(4);
  fault.set_name("y");
  fault.set_value(-5.0);
  fault.set_at_tick(8);
  EXPECT_EQ(requests[1].inject_fault().DebugString(), fault.DebugString());
  v1::ShaftBump bump;
  bump.set_axis(5);
  bump.set_impulse_nms(-0.25);
  bump.set_at_tick(9);
  EXPECT_EQ(requests[2].shaft_bump().DebugString(), bump.DebugString());
}

// Catches: a refusal that looks like an answer, and a link that gives up after one.
TEST(Link, ThrowsARefusalWithItsCodeAndFieldAndGoesOn) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope answer = answer_to(request);
    if (request.has_status_request()) {
      answer.mutable_status()->set_tick(1);
    } else {
      answer.mutable_refusal()->set_code(v1::REFUSAL_OUT_OF_RANGE);
      answer.mutable_refusal()->set_message("it is 5 but must be 4");
      answer.mutable_refusal()->set_field("machine." + request.write_parameter().name());
    }
    return FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "peer");
  try {
    link.write_parameter(0, {.name = "x", .value = 5.0});
    ADD_FAILURE() << "no refusal";
  } catch (const RefusalError& refused) {
    EXPECT_EQ(refused.code(), v1::REFUSAL_OUT_OF_RANGE);
    EXPECT_STREQ(refused.what(), "it is 5 but must be 4");
    EXPECT_EQ(refused.field(), "machine.x");
  }
  EXPECT_EQ(link.status().tick(), 1U);
}

// Catches: samples that are taken for the answer, lost or reordered.
TEST(Link, KeepsSamplesThatComeBeforeAnAnswer) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope answer = answer_to(request);
    answer.mutable_status()->set_tick(9);
    return samples_frame(1, 10, 2) + samples_frame(1, 12, 1) + FakePeer::framed(answer) +
           samples_frame(1, 13, 1);
  }));
  Link link(peer.client_end(), "peer");
  EXPECT_EQ(link.status().tick(), 9U);
  std::vector<std::uint64_t> ticks;
  for (int message = 0; message < 3; ++message) {
    const std::optional<v1::Samples> samples = link.next_samples(5s);
    ASSERT_TRUE(samples.has_value());
    for (const v1::Sample& sample : samples->samples())
      ticks.push_back(sample.tick());
  }
  EXPECT_EQ(ticks, (std::vector<std::uint64_t>{10, 11, 12, 13}));
  EXPECT_FALSE(link.next_samples(0ms).has_value());
}

// Catches: a notice that is taken for the answer or lost, and a link that goes on when its session has ended.
TEST(Link, OWN_04_KeepsNoticesForTheCaller) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope notice;
    notice.mutable_notice()->set_kind(request.id() == 2 ? v1::Notice::KIND_LEASE_TAKEN
                                                        : v1::Notice::KIND_SESSION_ENDED);
    notice.mutable_notice()->set_message("smoke");
    notice.mutable_notice()->set_axis(3);
    v1::Envelope answer = answer_to(request);
    answer.mutable_status()->set_tick(9);
    return FakePeer::framed(notice) + FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "the bench");
  EXPECT_EQ(link.status().tick(), 9U);
  const std::vector<v1::Notice> told = link.take_notices();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].axis(), 3U);
  EXPECT_TRUE(link.take_notices().empty());
  EXPECT_EQ(message_of([&] { link.status(); }), "the bench ended the session: smoke");
}

// Catches: a queue without bound, and losses without a count.
TEST(Link, DropsTheOldestSamplesAndCountsThem) {
  constexpr int kPerMessage = 1024;
  constexpr auto kMessages = static_cast<int>(Link::kMaxKeptSamples / kPerMessage) + 3;
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope answer = answer_to(request);
    answer.mutable_status();
    std::string bytes;
    for (int i = 0; i < kMessages; ++i)
      bytes += samples_frame(0, static_cast<std::uint64_t>(i) * kPerMessage, kPerMessage);
    return bytes + FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "peer");
  link.status();
  const std::optional<v1::Samples> oldest = link.next_samples(0ms);
  ASSERT_TRUE(oldest.has_value());
  EXPECT_EQ(oldest->dropped(), 3U * kPerMessage);
  EXPECT_EQ(oldest->samples(0).tick(), 3U * kPerMessage);
  EXPECT_EQ(link.next_samples(0ms)->dropped(), 0U);
}

// Catches: a client that hangs on a dead server, and one that takes a late answer for the next request's.
TEST(Link, GivesUpOnASilentPeerAndStaysClosed) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    return request.has_status_request() ? std::string(1, '\0') : std::string();
  }));
  Link link(peer.client_end(), "the bench");
  link.set_deadline(20ms);
  EXPECT_EQ(message_of([&] { link.status(); }), "the bench gave no answer within 20 ms");
  EXPECT_EQ(message_of([&] { link.status(); }), "the link to the bench is closed");
  EXPECT_EQ(message_of([&] { link.next_samples(1ms); }), "the link to the bench is closed");
}

// Catches: a peer that keeps the link waiting for ever with samples.
TEST(Link, GivesUpWhenOnlySamplesCome) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
  std::thread sender([fd = ends[1]] {
    const FileDescriptor socket(fd);
    const std::string frame = samples_frame(0, 1, 1);
    while (::send(socket.get(), frame.data(), frame.size(), MSG_NOSIGNAL) > 0) {
    }
  });
  EXPECT_EQ(message_of([&] { Link(FileDescriptor(ends[0]), "the bench", {.deadline = 20ms}); }),
            "the bench gave no answer within 20 ms");
  sender.join();
}

// Catches: words of a lost connection, and with them reports, that depend on how far the bytes had come.
TEST(Link, AnEndAResetAndABrokenPipeAreToldAlike) {
  enum class Leaves { kBefore, kWithUnread, kAfterReading };
  for (const Leaves leaves : {Leaves::kBefore, Leaves::kWithUnread, Leaves::kAfterReading}) {
    std::array<int, 2> ends{};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
    FileDescriptor ours(ends[0]);
    FileDescriptor theirs(ends[1]);
    if (leaves == Leaves::kBefore) theirs.close();
    std::thread peer([&] {
      if (leaves == Leaves::kBefore) return;
      std::array<char, 64> byte{};
      ::recv(theirs.get(), byte.data(), 1, leaves == Leaves::kWithUnread ? MSG_PEEK : 0);
      if (leaves == Leaves::kAfterReading)
        while (::recv(theirs.get(), byte.data(), byte.size(), MSG_DONTWAIT) > 0)
          continue;
      theirs.close();
    });
    EXPECT_EQ(message_of([&] { Link(std::move(ours), "it", {.deadline = 2s}); }), "it closed the connection");
    peer.join();
  }
}

// Catches: trust in what comes: another protocol, an oversized frame, another kind, another id, the end.
TEST(Link, NamesTheMistakeOfAPeer) {
  const auto talk = [](FakePeer::Answer answer) {
    FakePeer peer(std::move(answer));
    return message_of([&] { Link(peer.client_end(), "it", {.deadline = 2s}); });
  };
  EXPECT_EQ(talk([](const v1::Envelope&) { return std::string("HTTP/1.1 400 Bad Request\r\n"); }),
            "it does not speak this protocol: it sent a frame longer than allowed here");
  EXPECT_EQ(talk([](const v1::Envelope&) { return std::string("\0\0\0\1\xff", 5); }),
            "it does not speak this protocol: it sent a frame that is no envelope");
  EXPECT_EQ(talk([](const v1::Envelope&) { return std::string(); }), "it closed the connection");
  EXPECT_EQ(talk([](const v1::Envelope& request) {
              v1::Envelope answer = answer_to(request);
              answer.mutable_done();
              return FakePeer::framed(answer);
            }),
            "it answered with done where welcome was due");
  EXPECT_EQ(talk([](const v1::Envelope& request) {
              v1::Envelope answer = answer_to(request);
              answer.set_id(99);
              answer.mutable_welcome();
              return FakePeer::framed(answer);
            }),
            "it answered request 99 when 1 was asked");
  EXPECT_EQ(talk([](const v1::Envelope& request) {
              v1::Envelope answer = answer_to(request);
              answer.mutable_welcome()->set_protocol(2);
              return FakePeer::framed(answer);
            }),
            "it speaks protocol 2, this program speaks 1");
}

// Catches: an answer of exactly the size cap that does not fit, and one that comes in pieces.
TEST(Link, TakesAnswersUpToTheCap) {
  FakePeer peer(welcoming([](const v1::Envelope& request) {
    v1::Envelope answer = answer_to(request);
    answer.mutable_status()->add_notes(std::string(kMaxReplyFrame - 100, 'n'));
    const std::size_t missing = kMaxReplyFrame - answer.ByteSizeLong();
    answer.mutable_status()->mutable_notes(0)->append(missing, 'n');
    EXPECT_EQ(answer.ByteSizeLong(), kMaxReplyFrame);
    return FakePeer::framed(answer);
  }));
  Link link(peer.client_end(), "peer");
  for (int i = 0; i < 3; ++i)
    EXPECT_GT(link.status().notes(0).size(), kMaxReplyFrame - 100);
}

}  // namespace
}  // namespace drivebench::link::tcp_link_test
