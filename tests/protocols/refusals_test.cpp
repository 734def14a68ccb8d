#include "protocols/refusals.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "bench.pb.h"

namespace drivebench::refusals_test {
namespace {

struct Codes {
  Refused refused;
  int tcp;
  int can;
  int modbus;
  int exception;
};

// Catches: a code that moves on a wire because a row or an enumerator moved, and a verdict without a row.
TEST(Refusals, EveryVerdictHasItsCodesOnEachWire) {
  const auto kCodes = std::to_array<Codes>({
      {Refused::kNot, 0, 0, 0, 0},
      {Refused::kNotOwner, 9, 1, 2, 6},
      {Refused::kOwned, 10, 2, 3, 6},
      {Refused::kNotFinite, 8, 3, 4, 3},
      {Refused::kLatched, 11, 4, 5, 4},
      {Refused::kStale, 12, 5, 6, 4},
      {Refused::kBusy, 13, 6, 7, 6},
      {Refused::kMalformed, 1, 7, 0, 3},
      {Refused::kIncomplete, 1, 8, 0, 3},
      {Refused::kWrongDrive, 16, 9, 10, 4},
      {Refused::kOutOfRange, 7, 7, 8, 3},
      {Refused::kBeyondDrive, 7, 10, 8, 3},
      {Refused::kCauseLasts, 21, 11, 11, 4},
      {Refused::kUnknownAxis, 4, 1, 1, 11},
      {Refused::kWrongMode, 15, 6, 9, 4},
      {Refused::kRuleBroken, 7, 7, 8, 3},
      {Refused::kTooManyRamps, 13, 6, 7, 6},
      {Refused::kSharedAmplifier, 23, 12, 12, 4},
  });
  ASSERT_EQ(kCodes.size(), kRefusals.size());
  std::set<Refused> seen;
  for (const Codes& codes : kCodes) {
    const RefusalRow& row = refusal_row(codes.refused);
    EXPECT_TRUE(seen.insert(row.refused).second) << row.words;
    EXPECT_EQ(row.refused, codes.refused);
    EXPECT_EQ(static_cast<int>(row.tcp), codes.tcp) << row.words;
    EXPECT_EQ(static_cast<int>(row.can), codes.can) << row.words;
    EXPECT_EQ(static_cast<int>(row.modbus), codes.modbus) << row.words;
    EXPECT_EQ(static_cast<int>(row.exception), codes.exception) << row.words;
  }
}

// Catches: a refusal that says nothing to people, and two that say the same.
TEST(Refusals, EveryVerdictHasItsOwnWords) {
  std::set<std::string_view> sentences;
  std::set<std::string_view> words;
  for (const RefusalRow& row : kRefusals) {
    EXPECT_EQ(row.sentence.empty(), row.refused == Refused::kNot) << row.words;
    EXPECT_TRUE(sentences.insert(row.sentence).second) << row.sentence;
    EXPECT_TRUE(words.insert(row.words).second) << row.words;
    EXPECT_EQ(row.words.find_first_of(",0123456789"), std::string_view::npos) << "the DBC file splits there";
  }
}

// Catches: a code of the table that bench.proto calls by another name.
TEST(Refusals, TheSchemaHasTheCodesOfTheTable) {
  const auto expect = [](TcpRefusal code, v1::RefusalCode wire) {
    EXPECT_EQ(static_cast<int>(code), static_cast<int>(wire)) << v1::RefusalCode_Name(wire);
  };
  expect(TcpRefusal::kUnspecified, v1::REFUSAL_UNSPECIFIED);
  expect(TcpRefusal::kMalformed, v1::REFUSAL_MALFORMED);
  expect(TcpRefusal::kUnknownAxis, v1::REFUSAL_UNKNOWN_AXIS);
  expect(TcpRefusal::kOutOfRange, v1::REFUSAL_OUT_OF_RANGE);
  expect(TcpRefusal::kNotFinite, v1::REFUSAL_NOT_FINITE);
  expect(TcpRefusal::kNotOwner, v1::REFUSAL_NOT_OWNER);
  expect(TcpRefusal::kOwned, v1::REFUSAL_OWNED);
  expect(TcpRefusal::kLatched, v1::REFUSAL_LATCHED);
  expect(TcpRefusal::kStale, v1::REFUSAL_STALE);
  expect(TcpRefusal::kBusy, v1::REFUSAL_BUSY);
  expect(TcpRefusal::kWrongMode, v1::REFUSAL_WRONG_MODE);
  expect(TcpRefusal::kWrongDrive, v1::REFUSAL_WRONG_DRIVE);
  expect(TcpRefusal::kCauseLasts, v1::REFUSAL_CAUSE_LASTS);
  expect(TcpRefusal::kSharedAmplifier, v1::REFUSAL_SHARED_AMPLIFIER);
}

// Catches: a code of two verdicts that a client takes for the rarer one, and a code of a newer bench that
// means nothing to it.
TEST(Refusals, ACodeMeansTheFirstOfItsRows) {
  EXPECT_EQ(refusal_meant_by(&RefusalRow::can, can::Result::kNotOwner, Refused::kBusy).refused,
            Refused::kNotOwner);
  EXPECT_EQ(refusal_meant_by(&RefusalRow::can, can::Result::kBusy, Refused::kNot).refused, Refused::kBusy);
  EXPECT_EQ(refusal_meant_by(&RefusalRow::can, can::Result::kMalformed, Refused::kNot).refused,
            Refused::kMalformed);
  EXPECT_EQ(refusal_meant_by(&RefusalRow::can, static_cast<can::Result>(200), Refused::kMalformed).refused,
            Refused::kMalformed);
  EXPECT_EQ(refusal_meant_by(&RefusalRow::modbus, modbus::Refusal::kOutOfRange, Refused::kNot).refused,
            Refused::kOutOfRange);
  EXPECT_EQ(refusal_meant_by(&RefusalRow::modbus, modbus::Refusal::kBusy, Refused::kNot).refused,
            Refused::kBusy);
}

// Catches: a list of codes in the DBC file or the register map that differs from what goes over the wire.
TEST(Refusals, TheListsOfCodesComeFromTheTable) {
  EXPECT_EQ(
      kCanResultMeaning,
      "0 done, 1 not the owner, 2 owned by another, 3 not finite, 4 latched, 5 stale, 6 busy, 7 malformed, "
      "8 incomplete, 9 wrong drive, 10 beyond drive, 11 cause lasts, 12 shares amplifier");
  EXPECT_EQ(kLastRefusalMeaning,
            "why the last write here was refused: 0 none yet, 1 no such axis, 2 not the owner, "
            "3 owned by another, 4 not finite, 5 latched, 6 stale, 7 busy, 8 out of range, 9 wrong mode, "
            "10 wrong drive, 11 cause lasts, 12 shares amplifier");
}

}  // namespace
}  // namespace drivebench::refusals_test
