#include "server/access/audit.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::audit_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const Client kAnna{.transport = "tcp", .peer = "192.0.2.1:5000", .subject = "anna"};
const Client kBen{.transport = "modbus", .peer = "192.0.2.2:5001", .subject = ""};

/// A bench in lockstep under audit, in a folder of its own.
class AuditTest : public ::testing::Test {
 protected:
  AuditTest() : folder_(fs::temp_directory_path() / ("drivebench-audit-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directory(folder_);
    audit = std::make_unique<Audit>(AuditConfig{.file = file(), .on_failure = AuditFailure::kSafe});
    engine = make_lockstep_engine(servo_bench());
    audit->watch(*engine);
    anna = engine->new_owner(kAnna);
  }
  ~AuditTest() override { fs::remove_all(folder_); }

  fs::path file() const { return folder_ / "audit.jsonl"; }
  std::vector<json> lines() const {
    std::ifstream in(file());
    std::vector<json> read;
    for (std::string line; std::getline(in, line);)
      read.push_back(json::parse(line));
    return read;
  }
  std::vector<std::string> events() const {
    std::vector<std::string> names;
    for (const json& line : lines())
      names.push_back(line["event"]);
    return names;
  }
  Refused act(Owner owner, const Action& action) {
    return ask(*engine, {.tick = 0, .axis = 0, .owner = owner, .action = action});
  }
  void drive(Owner owner, int ticks) {
    for (int i = 0; i < ticks; ++i) {
      ASSERT_EQ(engine->command(0, owner, voltage(engine->tick(), 10.0, 0.0)), Refused::kNot);
      engine->advance();
    }
  }
  /// So far files may grow from now on.
  static void limit_files(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit limit{};
    ::getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }

  fs::path folder_;
  std::unique_ptr<Audit> audit;
  std::unique_ptr<Engine> engine;
  Owner anna = 0;
};

// Catches: an event that leaves no line, has the name of another event, or lacks client, time or result.
TEST_F(AuditTest, SEC_07_EveryChangeIsALineWithClientTimeAndResult) {
  act(anna, LeaseAction::kAcquire);
  act(anna, LeaseAction::kRenew);
  drive(anna, 3);
  act(anna, LoadChange{.load_nm = 0.5, .ramp_ticks = 7});
  act(anna, InjectFault{.row = 0, .value = 1.0});
  act(anna, ShaftBump{.impulse_nms = 1e-3});
  act(anna, ClearFaults{});
  act(99, ClearFaults{});
  act(anna, LeaseAction::kLost);
  ASSERT_EQ(events(), (std::vector<std::string>{"acquire", "armed", "load", "inject", "bump", "clear",
                                                "clear", "lease_lost"}));
  const std::vector<json> said = lines();
  for (const json& line : said) {
    for (const char* const key : {"time", "monotonic_ns", "tick", "event", "axis", "transport", "peer",
                                  "subject", "result", "details"}) {
      EXPECT_TRUE(line.contains(key)) << key;
    }
  }
  EXPECT_EQ(said[1]["details"]["state"], "run");
  EXPECT_EQ(said[1]["tick"], 1);
  EXPECT_EQ(said[2]["details"]["load_nm"], 0.5);
  EXPECT_EQ(said[2]["axis"], engine->config().axes[0].name);
  EXPECT_EQ(said[2]["transport"], "tcp");
  EXPECT_EQ(said[2]["peer"], "192.0.2.1:5000");
  EXPECT_EQ(said[2]["subject"], "anna");
  EXPECT_EQ(said[5]["result"], "done");
  EXPECT_EQ(said[6]["result"], sentence_of(Refused::kNotOwner));
  EXPECT_EQ(said[6]["peer"], "") << "owner 99 is unknown";
}

// Catches: an axis that is given to the administrator while it is still driven, and an owner that is not told
// the reason.
TEST_F(AuditTest, OWN_04_TakingByForceStopsTheAxisBeforeItChangesHands) {
  const Owner admin = engine->new_owner(kBen);
  std::vector<Taken> told;
  engine->on_taken.push_back([&](const Taken& taken) {
    EXPECT_NE(engine->owner(0), anna);
    EXPECT_NE(engine->owner(0), admin) << "not yet";
    told.push_back(taken);
  });
  act(anna, LeaseAction::kAcquire);
  drive(anna, 3);
  Refused answer = Refused::kBusy;
  engine->take(0, admin, "smoke", [&](Refused refused, Tick) { answer = refused; });
  EXPECT_EQ(answer, Refused::kNot);
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0].from, anna);
  EXPECT_EQ(engine->owner(0), admin);
  EXPECT_GT(admin, anna);
  EXPECT_EQ(engine->check(0, admin, voltage(engine->tick(), 1.0, 0.0)), Refused::kLatched);
  EXPECT_EQ(engine->check(0, anna, voltage(engine->tick(), 1.0, 0.0)), Refused::kNotOwner);
  ASSERT_EQ(events(), (std::vector<std::string>{"acquire", "armed", "lease_lost", "take", "acquire"}));
  const json take = lines()[3];
  EXPECT_EQ(take["peer"], kBen.peer);
  EXPECT_EQ(take["details"]["reason"], "smoke");
  EXPECT_EQ(take["details"]["from"], "anna (tcp 192.0.2.1:5000)");
}

/// Grants every request, and shows what it is told to.
class ShownEngine final : public Engine {
 public:
  ShownEngine() : Engine(servo_bench(), nullptr) {}
  void show(Owner owner, ControlState state, std::uint64_t faults) {
    newest_[0].owner = owner;
    newest_[0].state = static_cast<std::uint64_t>(state);
    newest_[0].faults = faults;
    on_tick();
  }
  Refused check(std::uint32_t, Owner, const Command&) const override { return Refused::kNot; }
  Refused command(std::uint32_t, Owner, const Command&) override { return Refused::kNot; }
  void advance() override {}
  std::vector<std::byte> save() override { return {}; }
  bool restore(std::span<const std::byte>) override { return false; }
  Verdict stop() override { return {}; }
  std::uint64_t state_hash() const override { return 0; }

 private:
  void submit(const Input& input, Answer answer) override {
    newest_[0].owner = input.owner;
    answer(Refused::kNot, 0);
  }
};

// Catches: a lease that runs out, a fault or a second start without a line; a start with a line for each
// tick.
TEST_F(AuditTest, SEC_07_EventsThatOnlySamplesShowAreLogged) {
  ShownEngine shown;
  audit->watch(shown);
  const Owner ben = shown.new_owner(kBen);
  ask(shown, lease(LeaseAction::kAcquire, 0, ben));
  for (const ControlState state :
       {ControlState::kIdle, ControlState::kRun, ControlState::kHold, ControlState::kRun})
    shown.show(ben, state, 0);
  shown.show(ben, ControlState::kTimeout, kCommandTimeout);
  shown.show(ben, ControlState::kTimeout, kCommandTimeout);
  shown.show(ben, ControlState::kRun, 0);
  shown.show(0, ControlState::kTimeout, kLeaseLost);
  shown.show(0, ControlState::kTimeout, kLeaseLost);
  EXPECT_EQ(events(),
            (std::vector<std::string>{"acquire", "armed", "latched", "armed", "latched", "lease_expired"}));
  for (const json& line : lines())
    EXPECT_EQ(line["peer"], kBen.peer) << line;
}

// Catches: a name with a line end or an escape code that makes a second line, or colours the reader's
// terminal.
TEST_F(AuditTest, SEC_07_NamesCannotForgeLines) {
  const std::string evil = "x\n{\"event\":\"forged\"}\r\x1b[31m\x7f\u009b\xff";
  const Client client{.transport = "tcp", .peer = evil, .subject = evil};
  audit->note({.name = "session_opened", .client = &client, .details = {{"client", evil}}});
  std::ifstream in(file(), std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_TRUE(std::all_of(text.begin(), text.end() - 1, [](char c) { return c >= ' ' && c <= '~'; }));
  const std::string kept = json::parse(text)["details"]["client"];
  EXPECT_TRUE(kept.starts_with("x\n{\"event\":\"forged\"}\r\x1b[31m\x7f\u009b")) << "escaped, not lost";
}

// Catches: a stranger whose refusals fill the disk, and lines that are left out uncounted.
TEST_F(AuditTest, SEC_07_RefusalsAreBoundedAndCounted) {
  for (int i = 0; i < 5000; ++i)
    act(99, ClearFaults{});
  const std::vector<json> said = lines();
  EXPECT_GE(said.size(), 100u);
  EXPECT_LE(said.size(), 400u) << "100 at once and 2 a second: the test would have taken minutes";
  act(anna, LeaseAction::kAcquire);
  EXPECT_EQ(lines().back()["event"], "acquire");
  std::size_t left_out = 0;  // also before those that came in time on a slow machine
  for (const json& line : lines())
    left_out += line.value("details", json::object()).value("left_out_before", std::size_t{0});
  EXPECT_EQ(left_out, 5000 - said.size());
}

// Catches: strangers at three addresses that guess tokens until the forbidden requests of a known user, the
// reloads or the clients of another address leave no line.
TEST_F(AuditTest, SEC_07_AFloodOfGuessesCostsNoOtherEventItsLine) {
  const auto flood = [this] {
    for (const char* const peer : {"192.0.2.7:1", "192.0.2.8:1", "192.0.2.9:1"}) {
      const Client guesser{.transport = "tcp", .peer = peer, .subject = {}};
      for (int n = 0; n < 1000; ++n)
        audit->note({.name = "authentication", .client = &guesser, .result = "wrong token"});
    }
  };
  const Client other{.transport = "tcp", .peer = "192.0.2.10:1", .subject = {}};
  constexpr int kForbidden = 500;
  flood();
  for (int n = 0; n < kForbidden; ++n)
    audit->note({.name = "forbidden", .client = &kAnna, .result = "the role does not allow it"});
  audit->note({.name = "reload", .result = "no bench"});
  audit->note({.name = "authentication", .client = &other, .result = "wrong token"});
  flood();
  std::map<std::string, int> count;
  for (const json& line : lines())
    ++count[line["event"].get<std::string>() + " " + line["peer"].get<std::string>()];
  EXPECT_EQ(count["forbidden " + kAnna.peer], kForbidden);
  EXPECT_EQ(count["reload "], 1);
  EXPECT_EQ(count["authentication " + other.peer], 1);
  EXPECT_GE(count["authentication 192.0.2.7:1"], 100);
  EXPECT_LE(count["authentication 192.0.2.7:1"], 200) << "100 and 2 a second: it would have taken 50 s";
}

// Catches: a bench that is driven on without a log, although the configuration forbids it.
TEST_F(AuditTest, SEC_07_WithoutALogEveryControllerLosesItsAxis) {
  act(anna, LeaseAction::kAcquire);
  drive(anna, 3);
  limit_files(fs::file_size(file()) + 10);
  act(anna, LoadChange{.load_nm = 0.5, .ramp_ticks = 0});
  EXPECT_EQ(engine->owner(0), 0u);
  EXPECT_EQ(act(anna, LeaseAction::kAcquire), Refused::kNot);
  EXPECT_EQ(engine->owner(0), 0u) << "the line of this lease cannot be written";
  limit_files(RLIM_INFINITY);
  act(anna, LeaseAction::kAcquire);
  EXPECT_EQ(engine->owner(0), anna);
  EXPECT_GE(audit->lost(), 3u);
  std::ifstream in(file());
  std::string torn, last;
  for (std::string line; std::getline(in, line);)
    torn = std::exchange(last, line);
  EXPECT_EQ(torn.size(), 10u) << "the torn line ends before the next one";
  EXPECT_EQ(json::parse(last)["details"].value("lost_before", std::uint64_t{0}), audit->lost());
}

// Catches: a run that ends with its log, although the configuration lets it go on.
TEST_F(AuditTest, SEC_07_AFailingLogMayOnlyBeCounted) {
  audit =
      std::make_unique<Audit>(AuditConfig{.file = folder_ / "other", .on_failure = AuditFailure::kContinue});
  audit->watch(*engine);
  act(anna, LeaseAction::kAcquire);
  limit_files(0);
  act(anna, LoadChange{.load_nm = 0.5, .ramp_ticks = 0});
  limit_files(RLIM_INFINITY);
  EXPECT_EQ(engine->owner(0), anna);
  EXPECT_EQ(audit->lost(), 1u);
}

// Catches: a log that other users can read, that follows a link, or that is lost in a rotation.
TEST_F(AuditTest, SEC_07_OnlyTheServersUserReadsTheFile) {
  struct stat status = {};
  ASSERT_EQ(::stat(file().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0600u);
  act(anna, LeaseAction::kAcquire);
  fs::rename(file(), folder_ / "old");
  EXPECT_TRUE(audit->reopen());
  act(anna, LeaseAction::kRelease);
  EXPECT_EQ(events(), std::vector<std::string>{"release"});
  ::chmod(file().c_str(), 0644);
  EXPECT_THROW(AuditFile{file()}, std::runtime_error);
  EXPECT_FALSE(audit->reopen());
  fs::create_symlink(folder_ / "old", folder_ / "link");
  EXPECT_THROW(AuditFile{folder_ / "link"}, std::runtime_error);
  EXPECT_THROW(AuditFile{folder_}, std::runtime_error);
  EXPECT_THROW(AuditFile{folder_ / "nowhere" / "audit"}, std::runtime_error);
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_THROW(AuditFile{folder_ / "pipe"}, std::runtime_error);
}

}  // namespace
}  // namespace drivebench::audit_test
