#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/mcap/mcap_format.hpp"

/// Recordings: MCAP files (https://mcap.dev/spec, major version 0), written as indexed, uncompressed,
/// checksummed chunks and read sequentially. Neither class uses files: the writer hands bytes to a sink, the
/// reader reads a span of bytes.
namespace drivebench {

/// The header of a message. `publish_time_ns` repeats `log_time_ns` where no other time is known.
struct McapMessageHeader {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
};

struct McapWriterOptions {
  std::string profile;  ///< Empty: no well-known profile.
  std::string library;  ///< Program and version that wrote the file.
  /// A chunk is closed when its records reach this size, the most that a torn last write loses. Each chunk
  /// adds about 83 bytes (plus 10 per channel in it) to the index that the writer keeps in memory until the
  /// end.
  std::size_t chunk_size = std::size_t{1} << 20;
};

/// Turns schemas, channels, messages, attachments and metadata into an MCAP file, in the order of the calls.
///
/// One thread at a time. Messages cost a copy and an index entry; nothing is allocated once the buffers have
/// reached their size. A file without finish() is readable up to the last flush(); McapReader reports it as
/// truncated. The destructor writes nothing.
///
/// Wrong use (an unknown id, a call after finish()) aborts; a string or map of 4 GiB throws
/// std::length_error. After an exception, also one of the sink, the writer cannot be used again.
class McapWriter {
 public:
  /// Receives the bytes of the file in order: one call per chunk with its index records, one or a few per
  /// attachment or metadata record. The bytes are valid during the call.
  using Sink = std::function<void(std::span<const std::byte>)>;

  /// Writes the magic and the header at once.
  McapWriter(Sink sink, McapWriterOptions options);

  /// Ids count from 1, as 0 means "no schema" in a channel.
  std::uint16_t add_schema(std::string_view name, std::string_view encoding, std::span<const std::byte> data);

  /// Ids count from 0, so they can index the caller's own tables.
  std::uint16_t add_channel(std::string_view topic, std::uint16_t schema_id,
                            std::string_view message_encoding, const McapMap& metadata = {});

  void add_message(const McapMessageHeader& header, std::span<const std::byte> payload);

  /// A buffer of `max_size` bytes in which the caller encodes a payload in place. It is valid until the next
  /// call, which must be end_message(); any other call drops the message.
  std::span<std::byte> begin_message(const McapMessageHeader& header, std::size_t max_size);
  void end_message(std::size_t size);

  /// Attachments and metadata close the current chunk, so that the file keeps the order of the calls.
  void add_attachment(std::string_view name, std::string_view media_type, std::uint64_t log_time_ns,
                      std::span<const std::byte> data);
  void add_metadata(std::string_view name, const McapMap& entries);

  /// Closes the current chunk unless it is empty: the sink then has everything so far.
  void flush();

  /// Closes the file: the data section's checksum, the summary with statistics and indexes, the footer.
  void finish();

  /// Bytes given to the sink so far.
  std::uint64_t bytes_written() const noexcept { return position_; }

 private:
  struct IndexEntry {
    std::uint64_t log_time_ns;
    std::uint64_t offset;
  };
  struct ChannelState {
    std::uint64_t messages = 0;
    std::vector<IndexEntry> index;  // of the current chunk
  };
  struct TimeRange {
    std::uint64_t first_ns = 0;
    std::uint64_t last_ns = 0;
    bool empty = true;
    void include(std::uint64_t first, std::uint64_t last) noexcept;
  };

  void start_chunk();
  void close_chunk();
  std::size_t chunk_records_size() const noexcept;
  void emit(std::span<const std::byte> bytes);
  std::uint64_t write_message_indexes(std::uint64_t chunk_length);
  void write_statistics(mcap::Buffer& out) const;

  Sink sink_;
  std::size_t chunk_size_;
  std::uint64_t position_ = 0;
  std::uint32_t data_crc_ = 0;

  mcap::Buffer chunk_;  // the chunk record under construction; its index records follow at the end
  TimeRange chunk_times_;
  McapMessageHeader open_;
  std::size_t open_room_ = 0;
  bool is_open_ = false;
  bool is_finished_ = false;

  std::vector<ChannelState> channels_;
  std::uint16_t schema_count_ = 0;
  std::uint32_t attachment_count_ = 0;
  std::uint32_t metadata_count_ = 0;
  std::uint32_t chunk_count_ = 0;
  std::uint64_t message_count_ = 0;
  TimeRange times_;

  // Records of the summary, encoded.
  mcap::Buffer schema_records_;
  mcap::Buffer channel_records_;
  mcap::Buffer chunk_indexes_;
  mcap::Buffer attachment_indexes_;
  mcap::Buffer metadata_indexes_;
};

// Results of the reader: views into the bytes of the file, valid as long as these.

struct McapSchema {
  std::uint16_t id = 0;
  std::string_view name;
  std::string_view encoding;
  std::string_view data;
  bool operator==(const McapSchema&) const = default;
};

using McapMapView = std::map<std::string_view, std::string_view>;

struct McapChannel {
  std::uint16_t id = 0;
  std::uint16_t schema_id = 0;  ///< 0: no schema.
  std::string_view topic;
  std::string_view message_encoding;
  McapMapView metadata;
  bool operator==(const McapChannel&) const = default;
};

struct McapMessage {
  McapMessageHeader header;
  std::span<const std::byte> payload;
};

struct McapAttachment {
  std::uint64_t log_time_ns = 0;
  std::uint64_t create_time_ns = 0;  ///< 0: not known.
  std::string_view name;
  std::string_view media_type;
  std::span<const std::byte> data;
};

struct McapMetadata {
  std::string_view name;
  McapMapView entries;
};

/// The reason why reading stopped before the end of a whole file.
struct McapProblem {
  enum class Kind {
    kNotMcap,      ///< The file does not begin like an MCAP file of major version 0.
    kTruncated,    ///< The file ends early, as after a crash; all before `offset` was read.
    kDamaged,      ///< A checksum, length or reference at `offset` is wrong.
    kUnsupported,  ///< A chunk is compressed.
  };
  Kind kind = Kind::kDamaged;
  std::uint64_t offset = 0;  ///< Of the record concerned, from the start of the file.
  std::string what;          ///< A sentence with the offset in it.
};

/// Reads an MCAP file from front to back and checks every byte that it uses. It stops at the first problem
/// and never throws on bad data. It delivers the messages of a chunk after checking the chunk's checksum, so
/// that no message of a truncated chunk is delivered. After the last message it checks the rest of the file
/// (checksum of the data section, statistics, indexes, footer):
///
///     McapReader reader(bytes);
///     for (McapMessage message; reader.next(message);) ...
///     if (reader.problem()) ...  // else the file is whole
class McapReader {
 public:
  explicit McapReader(std::span<const std::byte> file);
  McapReader(const McapReader&) = delete;
  McapReader& operator=(const McapReader&) = delete;

  /// False at the end of the file and at a problem.
  bool next(McapMessage& message);

  const std::optional<McapProblem>& problem() const noexcept { return problem_; }

  std::string_view profile() const noexcept { return profile_; }
  std::string_view library() const noexcept { return library_; }

  // The records read so far; complete when next() has returned false.
  const std::map<std::uint16_t, McapSchema>& schemas() const noexcept { return schemas_; }
  const std::map<std::uint16_t, McapChannel>& channels() const noexcept { return channels_; }
  const std::vector<McapAttachment>& attachments() const noexcept { return attachments_; }
  const std::vector<McapMetadata>& metadata() const noexcept { return metadata_; }
  std::uint64_t message_count() const noexcept { return message_count_; }
  std::uint64_t message_count(std::uint16_t channel) const noexcept;

 private:
  struct Record {
    mcap::Opcode opcode;
    std::uint64_t begin;
    std::uint64_t content;
    std::uint64_t end;
  };
  struct Seen {
    bool known = false;
    std::uint64_t messages = 0;
  };

  std::optional<Record> record_at(std::uint64_t at, std::uint64_t end) const noexcept;
  std::span<const std::byte> bytes(std::uint64_t begin, std::uint64_t end) const noexcept;
  bool fail(McapProblem::Kind kind, std::uint64_t offset, std::string_view what);
  bool damaged(const Record& record, std::string_view what);
  bool truncated(std::uint64_t offset);

  // These return false after a problem.
  bool read_start();
  bool read_schema(const Record& record);
  bool read_channel(const Record& record);
  bool read_message(const Record& record, McapMessage& message);
  bool open_chunk(const Record& record);
  bool read_attachment(const Record& record);
  bool read_metadata(const Record& record);
  bool read_data_record(const Record& record);
  bool read_end(const Record& data_end);
  bool read_summary_record(const Record& record);
  bool check_statistics(const Record& record);
  bool check_index(const Record& record, mcap::Opcode target);
  bool check_footer(const Record& footer, std::uint64_t summary, std::uint64_t summary_offsets);

  std::span<const std::byte> file_;
  std::uint64_t at_ = 0;         // the next record outside chunks
  std::uint64_t chunk_at_ = 0;   // the next record inside the current chunk
  std::uint64_t chunk_end_ = 0;  // equal to chunk_at_ outside chunks
  std::uint64_t data_end_ = 0;   // end of the data section, once known
  std::uint32_t data_crc_ = 0;   // of all bytes before at_
  bool is_done_ = false;
  std::optional<McapProblem> problem_;

  std::string_view profile_;
  std::string_view library_;
  std::map<std::uint16_t, McapSchema> schemas_;
  std::map<std::uint16_t, McapChannel> channels_;
  std::vector<Seen> seen_;  // by channel id
  std::vector<McapAttachment> attachments_;
  std::vector<McapMetadata> metadata_;
  std::uint64_t message_count_ = 0;
  std::uint64_t chunk_count_ = 0;
};

}  // namespace drivebench
