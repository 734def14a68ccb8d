#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <utility>

#include "protocols/mcap/mcap.hpp"

namespace drivebench {

using mcap::Buffer;
using mcap::Opcode;

namespace {

// A chunk record up to its records: head, start time, end time, uncompressed size, CRC, compression "", size.
constexpr std::size_t kChunkHead = mcap::kRecordHead + 8 + 8 + 8 + 4 + 4 + 8;
constexpr std::size_t kMessagePrefix = mcap::kRecordHead + mcap::kMessageHead;
constexpr std::size_t kIndexEntrySize = 8 + 8;
constexpr std::size_t kMaxChannels = std::size_t{1} << 16;
// Keeps the uint32 length of an index record from overflowing: an entry is shorter than its message.
constexpr std::size_t kMaxChunkSize = std::size_t{1} << 30;

void require(bool is_met, const char* rule) {
  if (is_met) return;
  std::fprintf(stderr, "McapWriter used wrongly: %s\n", rule);
  std::abort();
}

}  // namespace

void McapWriter::TimeRange::include(std::uint64_t first, std::uint64_t last) noexcept {
  first_ns = empty ? first : std::min(first_ns, first);
  last_ns = empty ? last : std::max(last_ns, last);
  empty = false;
}

McapWriter::McapWriter(Sink sink, McapWriterOptions options)
    : sink_(std::move(sink)), chunk_size_(options.chunk_size) {
  require(sink_ != nullptr, "it needs a sink");
  require(chunk_size_ > 0 && chunk_size_ <= kMaxChunkSize, "the chunk size is between 1 byte and 1 GiB");
  Buffer start;
  start.put_bytes(std::as_bytes(std::span(mcap::kMagic)));
  const std::size_t header = start.begin_record(Opcode::kHeader);
  start.put_string(options.profile);
  start.put_string(options.library);
  start.end_record(header);
  emit(start.bytes());
  chunk_.reserve(kChunkHead + chunk_size_ + chunk_size_ / 4);  // a quarter for the index and the last message
  start_chunk();
}

std::uint16_t McapWriter::add_schema(std::string_view name, std::string_view encoding,
                                     std::span<const std::byte> data) {
  require(!is_finished_, "no schema after finish()");
  require(schema_count_ < std::numeric_limits<std::uint16_t>::max(), "at most 65535 schemas");
  require(data.size() <= std::numeric_limits<std::uint32_t>::max(), "a schema is shorter than 4 GiB");
  is_open_ = false;
  const std::uint16_t id = ++schema_count_;
  const std::size_t begin = schema_records_.begin_record(Opcode::kSchema);
  schema_records_.put(id);
  schema_records_.put_string(name);
  schema_records_.put_string(encoding);
  schema_records_.put(static_cast<std::uint32_t>(data.size()));
  schema_records_.put_bytes(data);
  schema_records_.end_record(begin);
  // The copy inside the chunk is under its checksum and in front of every message that needs it.
  chunk_.put_bytes(schema_records_.bytes().subspan(begin));
  return id;
}

std::uint16_t McapWriter::add_channel(std::string_view topic, std::uint16_t schema_id,
                                      std::string_view message_encoding, const McapMap& metadata) {
  require(!is_finished_, "no channel after finish()");
  require(channels_.size() < kMaxChannels, "at most 65536 channels");
  require(schema_id <= schema_count_, "a channel's schema is added before it");
  is_open_ = false;
  const auto id = static_cast<std::uint16_t>(channels_.size());
  const std::size_t begin = channel_records_.begin_record(Opcode::kChannel);
  channel_records_.put(id);
  channel_records_.put(schema_id);
  channel_records_.put_string(topic);
  channel_records_.put_string(message_encoding);
  channel_records_.put_map(metadata);
  channel_records_.end_record(begin);
  chunk_.put_bytes(channel_records_.bytes().subspan(begin));
  channels_.emplace_back();
  return id;
}

std::span<std::byte> McapWriter::begin_message(const McapMessageHeader& header, std::size_t max_size) {
  require(!is_finished_, "no message after finish()");
  require(header.channel < channels_.size(), "a message's channel is added before it");
  require(max_size <= std::numeric_limits<std::size_t>::max() / 4, "a payload fits into memory");
  std::byte* at = chunk_.reserve(kMessagePrefix + max_size);
  open_ = header;
  open_room_ = max_size;
  is_open_ = true;
  return {at + kMessagePrefix, max_size};
}

void McapWriter::end_message(std::size_t size) {
  require(is_open_, "end_message() follows begin_message()");
  require(size <= open_room_, "a payload is no longer than the room asked for");
  is_open_ = false;
  std::byte* at = chunk_.data() + chunk_.size();
  mcap::store(at, static_cast<std::uint8_t>(Opcode::kMessage));
  mcap::store(at + 1, std::uint64_t{mcap::kMessageHead + size});
  mcap::store(at + 9, open_.channel);
  mcap::store(at + 11, open_.sequence);
  mcap::store(at + 15, open_.log_time_ns);
  mcap::store(at + 23, open_.publish_time_ns);
  ChannelState& channel = channels_[open_.channel];
  channel.index.push_back({open_.log_time_ns, chunk_records_size()});
  ++channel.messages;
  ++message_count_;
  chunk_times_.include(open_.log_time_ns, open_.log_time_ns);
  chunk_.advance(kMessagePrefix + size);
  if (chunk_records_size() >= chunk_size_) close_chunk();
}

void McapWriter::add_message(const McapMessageHeader& header, std::span<const std::byte> payload) {
  const std::span<std::byte> room = begin_message(header, payload.size());
  if (!payload.empty()) std::memcpy(room.data(), payload.data(), payload.size());
  end_message(payload.size());
}

void McapWriter::add_attachment(std::string_view name, std::string_view media_type, std::uint64_t log_time_ns,
                                std::span<const std::byte> data) {
  flush();
  const std::uint64_t create_time_ns = 0;  // not known
  const std::uint64_t offset = position_;
  Buffer head;
  const std::size_t begin = head.begin_record(Opcode::kAttachment);
  head.put(log_time_ns);
  head.put(create_time_ns);
  head.put_string(name);
  head.put_string(media_type);
  head.put(std::uint64_t{data.size()});
  const std::uint64_t content = head.size() - mcap::kRecordHead + data.size() + sizeof(std::uint32_t);
  mcap::store(head.data() + begin + 1, content);
  Buffer tail;
  tail.put(mcap::crc32_of(mcap::crc32_of(0, head.bytes().subspan(mcap::kRecordHead)), data));
  emit(head.bytes());
  emit(data);
  emit(tail.bytes());

  const std::size_t index = attachment_indexes_.begin_record(Opcode::kAttachmentIndex);
  attachment_indexes_.put(offset);
  attachment_indexes_.put(std::uint64_t{position_ - offset});
  attachment_indexes_.put(log_time_ns);
  attachment_indexes_.put(create_time_ns);
  attachment_indexes_.put(std::uint64_t{data.size()});
  attachment_indexes_.put_string(name);
  attachment_indexes_.put_string(media_type);
  attachment_indexes_.end_record(index);
  ++attachment_count_;
}

void McapWriter::add_metadata(std::string_view name, const McapMap& entries) {
  flush();
  const std::uint64_t offset = position_;
  Buffer record;
  record.begin_record(Opcode::kMetadata);
  record.put_string(name);
  record.put_map(entries);
  record.end_record(0);
  emit(record.bytes());

  const std::size_t index = metadata_indexes_.begin_record(Opcode::kMetadataIndex);
  metadata_indexes_.put(offset);
  metadata_indexes_.put(std::uint64_t{position_ - offset});
  metadata_indexes_.put_string(name);
  metadata_indexes_.end_record(index);
  ++metadata_count_;
}

void McapWriter::flush() {
  require(!is_finished_, "nothing is written after finish()");
  is_open_ = false;
  if (chunk_records_size() > 0) close_chunk();
}

void McapWriter::emit(std::span<const std::byte> bytes) {
  data_crc_ = mcap::crc32_of(data_crc_, bytes);
  position_ += bytes.size();
  sink_(bytes);
}

std::size_t McapWriter::chunk_records_size() const noexcept {
  return chunk_.size() - kChunkHead;
}

void McapWriter::start_chunk() {
  chunk_.clear();
  chunk_.reserve(kChunkHead);
  chunk_.advance(kChunkHead);  // filled in by close_chunk()
  chunk_times_ = {};
}

void McapWriter::close_chunk() {
  const std::uint64_t size = chunk_records_size();
  const std::uint64_t length = chunk_.size();
  const std::uint32_t crc = mcap::crc32_of(0, chunk_.bytes().subspan(kChunkHead));
  std::byte* at = chunk_.data();
  mcap::store(at, static_cast<std::uint8_t>(Opcode::kChunk));
  mcap::store(at + 1, std::uint64_t{length - mcap::kRecordHead});
  mcap::store(at + 9, chunk_times_.first_ns);
  mcap::store(at + 17, chunk_times_.last_ns);
  mcap::store(at + 25, size);
  mcap::store(at + 33, crc);
  mcap::store(at + 37, std::uint32_t{0});  // the length of compression ""
  mcap::store(at + 41, size);

  const std::size_t index = chunk_indexes_.begin_record(Opcode::kChunkIndex);
  chunk_indexes_.put(chunk_times_.first_ns);
  chunk_indexes_.put(chunk_times_.last_ns);
  chunk_indexes_.put(position_);
  chunk_indexes_.put(length);
  const std::uint64_t index_length = write_message_indexes(length);
  chunk_indexes_.put(index_length);
  chunk_indexes_.put_string("");
  chunk_indexes_.put(size);
  chunk_indexes_.put(size);
  chunk_indexes_.end_record(index);

  // Joins the checksum of the records to that of the data section, without reading them a second time.
  data_crc_ = mcap::crc32_of(data_crc_, chunk_.bytes().first(kChunkHead));
  data_crc_ = mcap::crc32_joined(data_crc_, crc, size);
  data_crc_ = mcap::crc32_of(data_crc_, chunk_.bytes().subspan(length));
  position_ += chunk_.size();
  ++chunk_count_;
  if (!chunk_times_.empty) times_.include(chunk_times_.first_ns, chunk_times_.last_ns);
  sink_(chunk_.bytes());
  start_chunk();
}

// Appends the message index records to the chunk, and their offsets to the chunk index record under
// construction.
std::uint64_t McapWriter::write_message_indexes(std::uint64_t chunk_length) {
  const std::size_t map_begin = chunk_indexes_.size();
  chunk_indexes_.put(std::uint32_t{0});
  for (std::size_t id = 0; id < channels_.size(); ++id) {
    std::vector<IndexEntry>& entries = channels_[id].index;
    if (entries.empty()) continue;
    chunk_indexes_.put(static_cast<std::uint16_t>(id));
    chunk_indexes_.put(std::uint64_t{position_ + chunk_.size()});
    const std::size_t begin = chunk_.begin_record(Opcode::kMessageIndex);
    chunk_.put(static_cast<std::uint16_t>(id));
    const std::size_t size = entries.size() * kIndexEntrySize;
    chunk_.put(static_cast<std::uint32_t>(size));
    std::byte* at = chunk_.reserve(size);
    for (const IndexEntry& entry : entries) {
      mcap::store(at, entry.log_time_ns);
      mcap::store(at + 8, entry.offset);
      at += kIndexEntrySize;
    }
    chunk_.advance(size);
    chunk_.end_record(begin);
    entries.clear();
  }
  const std::size_t map_size = chunk_indexes_.size() - map_begin - sizeof(std::uint32_t);
  mcap::store(chunk_indexes_.data() + map_begin, static_cast<std::uint32_t>(map_size));
  return chunk_.size() - chunk_length;
}

void McapWriter::write_statistics(Buffer& out) const {
  const std::size_t begin = out.begin_record(Opcode::kStatistics);
  out.put(message_count_);
  out.put(schema_count_);
  out.put(static_cast<std::uint32_t>(channels_.size()));
  out.put(attachment_count_);
  out.put(metadata_count_);
  out.put(chunk_count_);
  out.put(times_.first_ns);
  out.put(times_.last_ns);
  out.put(static_cast<std::uint32_t>(channels_.size() * (sizeof(std::uint16_t) + sizeof(std::uint64_t))));
  for (std::size_t id = 0; id < channels_.size(); ++id) {
    out.put(static_cast<std::uint16_t>(id));
    out.put(channels_[id].messages);
  }
  out.end_record(begin);
}

void McapWriter::finish() {
  flush();
  is_finished_ = true;

  Buffer end;
  const std::size_t data_end = end.begin_record(Opcode::kDataEnd);
  end.put(data_crc_);
  end.end_record(data_end);
  emit(end.bytes());

  const std::uint64_t summary_start = position_;
  Buffer statistics;
  write_statistics(statistics);
  // Channels stand in front of the statistics that count their messages, as the format asks.
  const auto groups = std::to_array<std::pair<Opcode, const Buffer*>>({
      {Opcode::kSchema, &schema_records_},
      {Opcode::kChannel, &channel_records_},
      {Opcode::kStatistics, &statistics},
      {Opcode::kChunkIndex, &chunk_indexes_},
      {Opcode::kAttachmentIndex, &attachment_indexes_},
      {Opcode::kMetadataIndex, &metadata_indexes_},
  });
  Buffer tail;  // summary offsets and footer
  std::uint32_t crc = 0;
  for (const auto& [opcode, records] : groups) {
    if (records->size() == 0) continue;
    const std::size_t offset = tail.begin_record(Opcode::kSummaryOffset);
    tail.put(static_cast<std::uint8_t>(opcode));
    tail.put(position_);
    tail.put(std::uint64_t{records->size()});
    tail.end_record(offset);
    crc = mcap::crc32_of(crc, records->bytes());
    emit(records->bytes());
  }

  const std::uint64_t summary_offset_start = position_;
  const std::size_t footer = tail.begin_record(Opcode::kFooter);
  tail.put(summary_start);
  tail.put(summary_offset_start);
  mcap::store(tail.data() + footer + 1,
              std::uint64_t{mcap::kFooterSize});  // before the checksum, which covers it
  tail.put(mcap::crc32_of(crc, tail.bytes()));
  tail.put_bytes(std::as_bytes(std::span(mcap::kMagic)));
  emit(tail.bytes());
}

}  // namespace drivebench
