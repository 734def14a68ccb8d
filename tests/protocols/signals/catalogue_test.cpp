#include "protocols/signals/catalogue.hpp"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>

#include "bench.pb.h"
#include "protocols/descriptor_set.hpp"

namespace drivebench::catalogue_test {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

FieldDescriptor::Type wire_type(SignalType type) {
  switch (type) {
    case SignalType::kUnsigned:
      return FieldDescriptor::TYPE_UINT64;
    case SignalType::kSigned:
      return FieldDescriptor::TYPE_SINT64;
    case SignalType::kReal:
      break;
  }
  return FieldDescriptor::TYPE_DOUBLE;
}

// Catches: a signal that is added to the table or to bench.proto only, in another order, or with another
// type.
TEST(Catalogue, MatchesTheMessageSampleOfTheWire) {
  const Descriptor& message = *v1::Sample::descriptor();
  ASSERT_EQ(static_cast<std::size_t>(message.field_count()), kSignals.size());
  for (std::size_t row = 0; row < kSignals.size(); ++row) {
    const FieldDescriptor* field = message.FindFieldByNumber(static_cast<int>(row) + 1);
    ASSERT_NE(field, nullptr) << row;
    EXPECT_EQ(field->name(), kSignals[row].name);
    EXPECT_EQ(field->type(), wire_type(kSignals[row].type)) << field->name();
    EXPECT_FALSE(field->is_repeated() || field->has_presence()) << field->name();
  }
}

// Catches: two rows that show the same member of Sample, a row of the wrong type, a member without a row, or
// rows in another order than the members.
TEST(Catalogue, RowsAreTheMembersOfSampleInOrder) {
  for (std::size_t row = 0; row < kSignals.size(); ++row) {
    const Signal& signal = kSignals[row];
    const int pointers =
        (signal.as_unsigned != nullptr) + (signal.as_signed != nullptr) + (signal.as_real != nullptr);
    EXPECT_EQ(pointers, 1) << signal.name;
    std::uint64_t words[kSampleWords] = {};
    words[row] = 0x4010'0000'0000'0000u;  // 4.0 as a double
    Sample sample;
    std::memcpy(&sample, words, sizeof(sample));
    const double expected = signal.type == SignalType::kReal ? 4.0 : 0x1p62 + 0x1p52;
    EXPECT_EQ(value_of(signal, sample), expected) << signal.name;
  }
}

// Catches: a name used twice, a name without unit or meaning, a range that is empty, a lookup that misses.
TEST(Catalogue, EveryRowHasANameAUnitAndAMeaning) {
  std::set<std::string_view> names;
  for (const Signal& signal : kSignals) {
    EXPECT_TRUE(names.insert(signal.name).second) << signal.name;
    EXPECT_FALSE(signal.unit.empty()) << signal.name;
    EXPECT_FALSE(signal.meaning.empty()) << signal.name;
    EXPECT_LT(signal.minimum, signal.maximum) << signal.name;
    EXPECT_EQ(find_signal(signal.name), &signal);
  }
  EXPECT_EQ(find_signal("speed"), nullptr);
  EXPECT_EQ(find_signal(""), nullptr);
}

// Catches: truth that a controller of a real bench could not know, offered as a sensor; or a sensor hidden.
TEST(Catalogue, NoTruthIsMarkedAsSensor) {
  const auto visible = [](std::string_view name) { return find_signal(name)->kind != SignalKind::kTruth; };
  for (const char* name : {"tick", "state", "faults", "injected", "encoder_count", "edge_period_s", "i_a_a",
                           "u_b_v", "i_c_a", "u_f_v", "u_n_v", "hall_lines", "meter_pf"})
    EXPECT_TRUE(visible(name)) << name;
  for (const char* name :
       {"angle_rad", "speed_rad_s", "torque_nm", "load_nm", "true_i_a_a", "psi_b_wb", "true_i_c_a",
        "true_i_f_a", "load_angle_rad", "load_speed_rad_s", "load_position_m"})
    EXPECT_FALSE(visible(name)) << name;
}

// Catches: a descriptor set that generic clients cannot use: the welcome and every recording carry it.
TEST(Catalogue, DescriptorSetDescribesTheWholeWire) {
  google::protobuf::FileDescriptorSet set;
  ASSERT_TRUE(set.ParseFromString(bench_descriptor_set()));
  google::protobuf::DescriptorPool pool;
  for (const auto& file : set.file())
    ASSERT_NE(pool.BuildFile(file), nullptr) << file.name();
  for (const char* name :
       {"drivebench.v1.Envelope", "drivebench.v1.Sample", "drivebench.v1.Input", "drivebench.v1.Verdict"}) {
    const Descriptor* message = pool.FindMessageTypeByName(name);
    ASSERT_NE(message, nullptr) << name;
  }
  EXPECT_EQ(pool.FindMessageTypeByName("drivebench.v1.Sample")->DebugString(),
            v1::Sample::descriptor()->DebugString());
}

// Catches: a changed number of the wire: older recordings and clients would misread it. The literal bytes
// were put together by hand.
TEST(Catalogue, NumbersOfTheWireStayAsTheyAre) {
  using namespace std::string_literals;
  v1::Envelope done;
  done.set_id(7);
  done.mutable_done()->set_tick(300);
  done.mutable_done()->set_owner(2);
  EXPECT_EQ(done.SerializeAsString(), "\x08\x07\x2a\x05\x08\xac\x02\x10\x02"s);
  v1::Envelope back;
  ASSERT_TRUE(back.ParseFromString(done.SerializeAsString()));
  EXPECT_EQ(back.done().tick(), 300u);
  EXPECT_EQ(back.done().owner(), 2u);

  v1::Envelope exchange;
  v1::Command& command = *exchange.mutable_exchange()->add_commands();
  command.set_axis(1);
  command.set_tick(5);
  command.set_gates(v1::GATES_VOLTAGE);
  command.set_u_a_v(1.0);
  command.set_u_b_v(-2.0);
  EXPECT_EQ(exchange.SerializeAsString(),
            "\x3a\x1a\x0a\x18\x08\x01\x10\x05\x18\x01\x21\x00\x00\x00\x00\x00\x00\xf0\x3f\x29\x00\x00\x00\x00"
            "\x00\x00"
            "\x00\xc0"s);

  v1::Envelope inject;
  inject.mutable_inject_fault()->set_axis(1);
  inject.mutable_inject_fault()->set_name("x");
  inject.mutable_inject_fault()->set_value(1.0);
  inject.mutable_inject_fault()->set_at_tick(300);
  EXPECT_EQ(inject.SerializeAsString(),
            "\x92\x01\x11\x08\x01\x12\x01x\x19\x00\x00\x00\x00\x00\x00\xf0\x3f\x20\xac\x02"s);
  v1::Envelope bump;
  bump.mutable_shaft_bump()->set_impulse_nms(-2.0);
  bump.mutable_shaft_bump()->set_at_tick(1);
  EXPECT_EQ(bump.SerializeAsString(), "\x9a\x01\x0b\x11\x00\x00\x00\x00\x00\x00\x00\xc0\x18\x01"s);
  v1::Command currents;
  currents.set_gates(v1::GATES_CURRENT);
  currents.set_u_c_v(1.0);
  currents.set_u_f_v(1.0);
  currents.set_i_a_a(1.0);
  currents.set_i_f_a(-2.0);
  EXPECT_EQ(currents.SerializeAsString(),
            "\x18\x03\x31\x00\x00\x00\x00\x00\x00\xf0\x3f\x39\x00\x00\x00\x00\x00\x00\xf0\x3f"
            "\x41\x00\x00\x00\x00\x00\x00\xf0\x3f\x59\x00\x00\x00\x00\x00\x00\x00\xc0"s);
  v1::Input input;
  input.mutable_inject();
  EXPECT_EQ(input.SerializeAsString(), "\x6a\x00"s);
  input.mutable_bump();
  EXPECT_EQ(input.SerializeAsString(), "\x72\x00"s);
  input.mutable_multisine();
  EXPECT_EQ(input.SerializeAsString(), "\x7a\x00"s);

  v1::Envelope welcome;
  welcome.set_id(1);
  welcome.mutable_welcome()->set_protocol(1);
  welcome.mutable_welcome()->set_build_id("x");
  welcome.mutable_welcome()->mutable_bench()->set_mode(v1::MODE_LOCKSTEP);
  EXPECT_EQ(welcome.SerializeAsString(), "\x08\x01\x1a\x09\x08\x01\x12\x01x\x22\x02\x10\x02"s);
}

}  // namespace
}  // namespace drivebench::catalogue_test
