#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "protocols/mcap/mcap.hpp"
#include "protocols/mcap/mcap_fields.hpp"

namespace drivebench {

using mcap::as_text;
using mcap::Fields;
using mcap::Opcode;

namespace {

/// Limit of one message: above the largest of drivebench, below the 2 GiB of protobuf's int sizes.
constexpr std::uint64_t kMaxMessageBytes = std::uint64_t{64} << 20;

std::string name_of(Opcode opcode) {
  static constexpr auto kNames = std::to_array<std::string_view>(
      {"zero", "header", "footer", "schema", "channel", "message", "chunk", "message index", "chunk index",
       "attachment", "attachment index", "statistics", "metadata", "metadata index", "summary offset",
       "data end"});
  const auto code = static_cast<std::size_t>(opcode);
  return code < kNames.size() ? std::string(kNames[code]) : "unknown (" + std::to_string(code) + ")";
}

std::string wrong_crc(std::string_view of, std::uint32_t stored, std::uint32_t computed) {
  std::array<char, 64> sums{};
  std::snprintf(sums.data(), sums.size(), "is 0x%08x in the file and 0x%08x over its bytes", stored,
                computed);
  return "the CRC32 of " + std::string(of) + " " + sums.data();
}

}  // namespace

McapReader::McapReader(std::span<const std::byte> file) : file_(file) {
  read_start();
}

bool McapReader::next(McapMessage& message) {
  while (!is_done_) {
    const bool in_chunk = chunk_at_ < chunk_end_;
    std::uint64_t& at = in_chunk ? chunk_at_ : at_;
    const auto record = record_at(at, in_chunk ? chunk_end_ : file_.size());
    if (!record) {
      if (!in_chunk) return truncated(at);
      return fail(McapProblem::Kind::kDamaged, at, "a record in a chunk is longer than the chunk");
    }
    at = record->end;
    bool is_good = false;
    switch (record->opcode) {
      case Opcode::kMessage:
        is_good = read_message(*record, message);
        break;
      case Opcode::kSchema:
        is_good = read_schema(*record);
        break;
      case Opcode::kChannel:
        is_good = read_channel(*record);
        break;
      default:
        if (in_chunk && record->opcode <= Opcode::kDataEnd)
          return damaged(*record, "it may not be in a chunk");
        is_good = in_chunk || read_data_record(*record);
    }
    if (!is_good) return false;
    // open_chunk() and read_end() update the checksum for these two.
    if (!in_chunk && record->opcode != Opcode::kChunk && record->opcode != Opcode::kDataEnd) {
      data_crc_ = mcap::crc32_of(data_crc_, bytes(record->begin, record->end));
    }
    if (record->opcode == Opcode::kMessage) return true;
  }
  return false;
}

std::uint64_t McapReader::message_count(std::uint16_t channel) const noexcept {
  return channel < seen_.size() ? seen_[channel].messages : 0;
}

std::optional<McapReader::Record> McapReader::record_at(std::uint64_t at, std::uint64_t end) const noexcept {
  if (end - at < mcap::kRecordHead) return std::nullopt;
  const std::uint64_t length = mcap::load<std::uint64_t>(file_.data() + at + 1);
  const std::uint64_t content = at + mcap::kRecordHead;
  if (length > end - content) return std::nullopt;
  return Record{static_cast<Opcode>(file_[at]), at, content, content + length};
}

std::span<const std::byte> McapReader::bytes(std::uint64_t begin, std::uint64_t end) const noexcept {
  return file_.subspan(begin, end - begin);
}

bool McapReader::fail(McapProblem::Kind kind, std::uint64_t offset, std::string_view what) {
  problem_ = McapProblem{kind, offset, "byte " + std::to_string(offset) + ": " + std::string(what)};
  is_done_ = true;
  return false;
}

bool McapReader::damaged(const Record& record, std::string_view what) {
  return fail(McapProblem::Kind::kDamaged, record.begin,
              "record \"" + name_of(record.opcode) + "\": " + std::string(what));
}

bool McapReader::truncated(std::uint64_t offset) {
  return fail(McapProblem::Kind::kTruncated, offset,
              offset == file_.size() ? "the file ends here, before its end mark"
                                     : "the file ends inside the record that begins here");
}

bool McapReader::read_start() {
  const std::string_view start = as_text(file_.first(std::min(file_.size(), mcap::kMagic.size())));
  if (!mcap::kMagic.starts_with(start)) {
    return fail(McapProblem::Kind::kNotMcap, 0, "this is not an MCAP file of version 0");
  }
  if (start.size() < mcap::kMagic.size()) return truncated(0);
  const auto record = record_at(mcap::kMagic.size(), file_.size());
  if (!record) return truncated(mcap::kMagic.size());
  if (record->opcode != Opcode::kHeader) return damaged(*record, "the first record must be the header");
  Fields fields(bytes(record->content, record->end));
  profile_ = fields.string();
  library_ = fields.string();
  if (!fields.ok()) return damaged(*record, "it is too short");
  at_ = record->end;
  data_crc_ = mcap::crc32_of(0, bytes(0, at_));
  return true;
}

bool McapReader::read_schema(const Record& record) {
  Fields fields(bytes(record.content, record.end));
  McapSchema schema;
  schema.id = fields.integer<std::uint16_t>();
  schema.name = fields.string();
  schema.encoding = fields.string();
  schema.data = fields.string();
  if (!fields.ok()) return damaged(record, "it is too short");
  if (schema.id == 0) return true;  // the format reserves id 0: readers ignore such a schema
  const auto [known, is_new] = schemas_.try_emplace(schema.id, schema);
  if (is_new || known->second == schema) return true;
  return damaged(record, "it differs from an earlier one with the same id");
}

bool McapReader::read_channel(const Record& record) {
  Fields fields(bytes(record.content, record.end));
  McapChannel channel;
  channel.id = fields.integer<std::uint16_t>();
  channel.schema_id = fields.integer<std::uint16_t>();
  channel.topic = fields.string();
  channel.message_encoding = fields.string();
  channel.metadata = fields.map();
  if (!fields.ok()) return damaged(record, "it is too short, or a key of its metadata comes twice");
  if (channel.schema_id != 0 && !schemas_.contains(channel.schema_id)) {
    return damaged(record, "its schema " + std::to_string(channel.schema_id) + " has not come before it");
  }
  const std::uint16_t id = channel.id;
  const auto known = channels_.find(id);
  if (known != channels_.end()) {
    if (known->second == channel) return true;
    return damaged(record, "it differs from an earlier one with the same id");
  }
  channels_.emplace(id, std::move(channel));
  if (seen_.size() <= id) seen_.resize(std::size_t{id} + 1);
  seen_[id].known = true;
  return true;
}

bool McapReader::read_message(const Record& record, McapMessage& message) {
  if (record.end - record.content < mcap::kMessageHead) return damaged(record, "it is too short");
  if (record.end - record.content > kMaxMessageBytes) return damaged(record, "it is longer than 64 MiB");
  const std::byte* at = file_.data() + record.content;
  const auto channel = mcap::load<std::uint16_t>(at);
  if (channel >= seen_.size() || !seen_[channel].known) {
    return damaged(record, "its channel " + std::to_string(channel) + " has not come before it");
  }
  message.header = {.channel = channel,
                    .sequence = mcap::load<std::uint32_t>(at + 2),
                    .log_time_ns = mcap::load<std::uint64_t>(at + 6),
                    .publish_time_ns = mcap::load<std::uint64_t>(at + 14)};
  message.payload = bytes(record.content + mcap::kMessageHead, record.end);
  ++seen_[channel].messages;
  ++message_count_;
  return true;
}

bool McapReader::read_data_record(const Record& record) {
  switch (record.opcode) {
    case Opcode::kChunk:
      return open_chunk(record);
    case Opcode::kAttachment:
      return read_attachment(record);
    case Opcode::kMetadata:
      return read_metadata(record);
    case Opcode::kDataEnd:
      return read_end(record);
    case Opcode::kMessageIndex:
      return true;  // sequential reading needs no index
    default:
      break;
  }
  if (record.opcode > Opcode::kDataEnd) return true;  // a later or private extension
  return damaged(record, "it may not be in the data section");
}

bool McapReader::open_chunk(const Record& record) {
  Fields fields(bytes(record.content, record.end));
  fields.integer<std::uint64_t>();  // earliest and latest log time: the messages have them
  fields.integer<std::uint64_t>();
  const auto size = fields.integer<std::uint64_t>();
  const auto stored = fields.integer<std::uint32_t>();
  const std::string_view compression = fields.string();
  const auto records = fields.bytes(fields.integer<std::uint64_t>());
  if (!fields.ok()) return damaged(record, "its records are longer than itself");
  if (!compression.empty()) {
    return fail(McapProblem::Kind::kUnsupported, record.begin,
                "a chunk is compressed with \"" + std::string(compression.substr(0, 32)) +
                    "\"; only uncompressed recordings can be read");
  }
  if (size != records.size()) return damaged(record, "its two sizes differ");
  const std::uint32_t crc = mcap::crc32_of(0, records);
  if (stored != 0 && stored != crc) return damaged(record, wrong_crc("its records", stored, crc));

  chunk_end_ = record.end - fields.left().size();
  chunk_at_ = chunk_end_ - size;
  data_crc_ = mcap::crc32_of(data_crc_, bytes(record.begin, chunk_at_));
  data_crc_ = mcap::crc32_joined(data_crc_, crc, size);
  data_crc_ = mcap::crc32_of(data_crc_, fields.left());
  ++chunk_count_;
  return true;
}

bool McapReader::read_attachment(const Record& record) {
  Fields fields(bytes(record.content, record.end));
  McapAttachment attachment;
  attachment.log_time_ns = fields.integer<std::uint64_t>();
  attachment.create_time_ns = fields.integer<std::uint64_t>();
  attachment.name = fields.string();
  attachment.media_type = fields.string();
  attachment.data = fields.bytes(fields.integer<std::uint64_t>());
  const std::size_t checked = record.end - record.content - fields.left().size();
  const auto stored = fields.integer<std::uint32_t>();
  if (!fields.ok()) return damaged(record, "it is too short");
  const std::uint32_t crc = mcap::crc32_of(0, file_.subspan(record.content, checked));
  if (stored != 0 && stored != crc) return damaged(record, wrong_crc("it", stored, crc));
  attachments_.push_back(attachment);
  return true;
}

bool McapReader::read_metadata(const Record& record) {
  Fields fields(bytes(record.content, record.end));
  McapMetadata metadata;
  metadata.name = fields.string();
  metadata.entries = fields.map();
  if (!fields.ok()) return damaged(record, "it is too short, or one of its keys comes twice");
  metadata_.push_back(std::move(metadata));
  return true;
}

bool McapReader::read_end(const Record& data_end) {
  Fields fields(bytes(data_end.content, data_end.end));
  const auto stored = fields.integer<std::uint32_t>();
  if (!fields.ok()) return damaged(data_end, "it is too short");
  if (stored != 0 && stored != data_crc_) {
    return damaged(data_end, wrong_crc("all bytes before it", stored, data_crc_));
  }
  data_end_ = data_end.begin;

  std::uint64_t summary = 0;  // 0 as in the footer: there is none
  std::uint64_t summary_offsets = 0;
  while (true) {
    const auto record = record_at(at_, file_.size());
    if (!record) return truncated(at_);
    if (record->opcode == Opcode::kFooter) return check_footer(*record, summary, summary_offsets);
    if (record->opcode == Opcode::kSummaryOffset) {
      if (summary_offsets == 0) summary_offsets = record->begin;
    } else if (!read_summary_record(*record)) {
      return false;
    }
    if (summary == 0 && summary_offsets == 0) summary = record->begin;
    at_ = record->end;
  }
}

bool McapReader::read_summary_record(const Record& record) {
  switch (record.opcode) {
    case Opcode::kSchema:
      return read_schema(record);
    case Opcode::kChannel:
      return read_channel(record);
    case Opcode::kStatistics:
      return check_statistics(record);
    case Opcode::kChunkIndex:
      return check_index(record, Opcode::kChunk);
    case Opcode::kAttachmentIndex:
      return check_index(record, Opcode::kAttachment);
    case Opcode::kMetadataIndex:
      return check_index(record, Opcode::kMetadata);
    default:
      break;
  }
  if (record.opcode > Opcode::kDataEnd) return true;
  return damaged(record, "it may not be in the summary");
}

bool McapReader::check_statistics(const Record& record) {
  Fields fields(bytes(record.content, record.end));
  const bool is_right = fields.integer<std::uint64_t>() == message_count_ &&
                        fields.integer<std::uint16_t>() == schemas_.size() &&
                        fields.integer<std::uint32_t>() == channels_.size() &&
                        fields.integer<std::uint32_t>() == attachments_.size() &&
                        fields.integer<std::uint32_t>() == metadata_.size() &&
                        fields.integer<std::uint32_t>() == chunk_count_;
  if (!is_right || !fields.ok()) return damaged(record, "it counts other things than the file contains");
  fields.bytes(8 + 8);  // earliest and latest log time
  Fields counts(fields.bytes(fields.integer<std::uint32_t>()));
  while (!counts.left().empty()) {
    const auto channel = counts.integer<std::uint16_t>();
    const auto messages = counts.integer<std::uint64_t>();
    if (!counts.ok() || messages != message_count(channel)) {
      return damaged(record, "it counts other messages on channel " + std::to_string(channel));
    }
  }
  return fields.ok() || damaged(record, "it is too short");
}

bool McapReader::check_index(const Record& record, Opcode target) {
  Fields fields(bytes(record.content, record.end));
  if (target == Opcode::kChunk) fields.bytes(8 + 8);  // its log times
  const auto offset = fields.integer<std::uint64_t>();
  const auto length = fields.integer<std::uint64_t>();
  if (!fields.ok()) return damaged(record, "it is too short");
  if (offset < data_end_) {
    const auto found = record_at(offset, data_end_);
    if (found && found->opcode == target && found->end - found->begin == length) return true;
  }
  return damaged(record, "there is no such " + name_of(target) + " where it points");
}

bool McapReader::check_footer(const Record& footer, std::uint64_t summary, std::uint64_t summary_offsets) {
  if (footer.end - footer.content != mcap::kFooterSize) return damaged(footer, "it has the wrong length");
  Fields fields(bytes(footer.content, footer.end));
  const bool is_right =
      fields.integer<std::uint64_t>() == summary && fields.integer<std::uint64_t>() == summary_offsets;
  if (!is_right) return damaged(footer, "it does not say where the summary is");
  const auto stored = fields.integer<std::uint32_t>();
  const std::uint64_t begin = summary != 0 ? summary : footer.begin;
  const std::uint32_t crc = mcap::crc32_of(0, bytes(begin, footer.end - sizeof stored));
  if (stored != 0 && stored != crc) return damaged(footer, wrong_crc("the summary", stored, crc));

  const std::string_view end = as_text(file_.subspan(footer.end));
  if (end.size() < mcap::kMagic.size() && mcap::kMagic.starts_with(end)) return truncated(footer.end);
  if (end != mcap::kMagic) {
    return fail(McapProblem::Kind::kDamaged, footer.end, "the file does not end with its end mark");
  }
  at_ = file_.size();
  is_done_ = true;
  return true;
}

}  // namespace drivebench
