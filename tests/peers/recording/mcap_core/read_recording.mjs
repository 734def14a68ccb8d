// node read_recording.mjs FILE
//
// Reads a recording with both readers of @mcap/core, by index and from front to back, and prints one JSON object:
// the results of the index reader. Ends with code 1 and a sentence on stderr when the readers refuse the file, disagree, or
// a checksum is wrong. The front-to-back reader gets the file in pieces of an odd size, as from a slow link.
import { open, stat } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const kPieceSize = 65_521;

class Summary {
  schemas = new Map();
  channels = new Map();
  attachments = [];
  metadata = {};
  first = {};
  last = {};

  addSchema({ id, name, encoding }) {
    this.schemas.set(id, { name, encoding });
  }

  addChannel({ id, topic, metadata }) {
    if (this.channels.has(id)) return;
    this.channels.set(id, {
      topic,
      messages: 0,
      first_log_time: null,
      last_log_time: null,
      metadata: Object.fromEntries(metadata),
    });
  }

  addMessage({ channelId, logTime, data }) {
    const channel = this.channels.get(channelId);
    if (channel.messages++ === 0) {
      this.first[channel.topic] = Buffer.from(data).toString("hex");
      channel.first_log_time = channel.last_log_time = logTime;
    }
    this.last[channel.topic] = Buffer.from(data).toString("hex");
    if (logTime < channel.first_log_time) channel.first_log_time = logTime;
    if (logTime > channel.last_log_time) channel.last_log_time = logTime;
  }

  addAttachment({ name, data }) {
    this.attachments.push({ name, size: data.byteLength });
  }

  addMetadata({ name, metadata }) {
    this.metadata[name] = Object.fromEntries(metadata);
  }

  // Times are strings: a JSON number does not hold 64 bits. Objects are in the order of the ids and names.
  toJson({ profile, library }) {
    const byKey = (a, b) => (a[0] < b[0] ? -1 : 1);
    const inOrder = (map) => [...map].sort((a, b) => a[0] - b[0]).map(([, value]) => value);
    const object = {
      profile,
      library,
      schemas: inOrder(this.schemas),
      channels: inOrder(this.channels),
      attachments: this.attachments,
      metadata: Object.fromEntries(Object.entries(this.metadata).sort(byKey)),
      first: Object.fromEntries(Object.entries(this.first).sort(byKey)),
      last: Object.fromEntries(Object.entries(this.last).sort(byKey)),
    };
    return JSON.stringify(object, (_, value) => (typeof value === "bigint" ? String(value) : value));
  }
}

async function readIndexed(file, size) {
  const readable = {
    size: async () => BigInt(size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      const { bytesRead } = await file.read(bytes, 0, bytes.length, Number(offset));
      if (bytesRead !== bytes.length) throw new Error(`the file ends before byte ${offset + length}`);
      return bytes;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable });
  const summary = new Summary();
  for (const schema of reader.schemasById.values()) summary.addSchema(schema);
  for (const channel of reader.channelsById.values()) summary.addChannel(channel);
  for await (const message of reader.readMessages({ validateCrcs: true })) summary.addMessage(message);
  for await (const attachment of reader.readAttachments({ validateCrcs: true })) summary.addAttachment(attachment);
  for await (const metadata of reader.readMetadata()) summary.addMetadata(metadata);

  for (const [id, { topic, messages }] of summary.channels) {
    const counted = reader.statistics.channelMessageCounts.get(id) ?? 0n;
    if (counted !== BigInt(messages)) throw new Error(`${topic}: ${messages} messages, but the statistics say ${counted}`);
  }
  return summary.toJson(reader.header);
}

async function readStreamed(file, size) {
  const reader = new McapStreamReader({ validateCrcs: true });
  const summary = new Summary();
  let header;
  for (let at = 0; at < size; ) {
    const { bytesRead, buffer } = await file.read(new Uint8Array(kPieceSize), 0, kPieceSize, at);
    at += bytesRead;
    reader.append(buffer.subarray(0, bytesRead));
    for (let record; (record = reader.nextRecord()); ) {
      if (record.type === "Header") header = record;
      if (record.type === "Schema") summary.addSchema(record);
      if (record.type === "Channel") summary.addChannel(record);
      if (record.type === "Message") summary.addMessage(record);
      if (record.type === "Attachment") summary.addAttachment(record);
      if (record.type === "Metadata") summary.addMetadata(record);
    }
  }
  if (!reader.done()) throw new Error(`the file is cut short: ${reader.bytesRemaining()} bytes of a record are left`);
  return summary.toJson(header);
}

try {
  const path = process.argv[2];
  if (path === undefined) throw new Error("usage: node read_recording.mjs FILE");
  const { size } = await stat(path);
  const file = await open(path);
  const indexed = await readIndexed(file, size);
  const streamed = await readStreamed(file, size);
  if (indexed !== streamed) throw new Error(`the readers disagree:\nby index       ${indexed}\nfront to back  ${streamed}`);
  console.log(indexed);
  await file.close();
} catch (error) {
  console.error(`read_recording: ${error.message}`);
  process.exitCode = 1;
}
