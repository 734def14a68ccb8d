/** Writes MCAP files (https://mcap.dev/spec) in chunks without compression, with the index that other readers want. */

type Entries = Record<string, string>;

const kMagic = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a];
const kChunkBytes = 1 << 20;
/** Of a message before its payload: channel, sequence, two times. */
const kMessageHead = 22;
const [kHeader, kFooter, kSchema, kChannel, kMessage, kChunk, kMessageIndex, kChunkIndex] = [1, 2, 3, 4, 5, 6, 7, 8];
const [kStatistics, kMetadata, kMetadataIndex, kDataEnd] = [0x0b, 0x0c, 0x0d, 0x0f];

/** Little-endian numbers and texts, one after the other. */
class Bytes {
  private all = new Uint8Array(1024);
  private view = new DataView(this.all.buffer);
  size = 0;

  u8(value: number): this { return this.put(1, (at) => this.view.setUint8(at, value)); }
  u16(value: number): this { return this.put(2, (at) => this.view.setUint16(at, value, true)); }
  u32(value: number): this { return this.put(4, (at) => this.view.setUint32(at, value, true)); }
  u64(value: number | bigint): this { return this.put(8, (at) => this.view.setBigUint64(at, BigInt(value), true)); }
  raw(bytes: ArrayLike<number>): this { return this.put(bytes.length, (at) => this.all.set(bytes, at)); }
  text(text: string): this { return this.block(new TextEncoder().encode(text)); }
  /** With its length. */
  block(bytes: ArrayLike<number>): this { return this.u32(bytes.length).raw(bytes); }
  /** What the function puts, with its length. */
  group(put: (into: Bytes) => void): this {
    const inner = new Bytes();
    put(inner);
    return this.block(inner.taken());
  }
  map(entries: Entries): this {
    return this.group((each) => Object.keys(entries).sort().forEach((key) => each.text(key).text(entries[key])));
  }
  record(kind: number, put: (into: Bytes) => void): this {
    const inner = new Bytes();
    put(inner);
    return this.u8(kind).u64(inner.size).raw(inner.taken());
  }
  taken(): Uint8Array<ArrayBuffer> { return this.all.slice(0, this.size); }

  private put(count: number, write: (at: number) => void): this {
    if (this.size + count > this.all.length) {
      const larger = new Uint8Array(Math.max(2 * this.all.length, this.size + count));
      larger.set(this.all);
      this.all = larger;
      this.view = new DataView(larger.buffer);
    }
    write(this.size);
    this.size += count;
    return this;
  }
}

interface Chunk {
  first: bigint;
  last: bigint;
  offset: number;
  length: number;
  indexes: Map<number, number>;
  indexBytes: number;
  size: number;
}

export class McapFile {
  private readonly parts: Uint8Array<ArrayBuffer>[] = [];
  private written = 0;
  private readonly definitions = new Bytes(); // schemas and channels
  private schemas = 0;
  private readonly counts: number[] = []; // of messages, by channel
  private readonly metadata: { offset: number; length: number; name: string }[] = [];
  private records = new Bytes(); // of the present chunk
  private index = new Map<number, [bigint, number][]>();
  private times: [bigint, bigint] = [0n, 0n];
  private readonly chunks: Chunk[] = [];

  constructor(profile: string, library: string) {
    this.put(new Bytes().raw(kMagic).record(kHeader, (each) => each.text(profile).text(library)));
  }

  /** Returns its number, from 1. */
  addSchema(name: string, encoding: string, data: Uint8Array): number {
    this.define(new Bytes().record(kSchema, (each) => each.u16(++this.schemas).text(name).text(encoding).block(data)));
    return this.schemas;
  }

  /** Returns its number, from 0. */
  addChannel(topic: string, schema: number, encoding: string, metadata: Entries): number {
    this.define(new Bytes().record(kChannel, (each) => each.u16(this.counts.length).u16(schema).text(topic).text(encoding).map(metadata)));
    return this.counts.push(0) - 1;
  }

  addMetadata(name: string, entries: Entries): void {
    const offset = this.written;
    this.put(new Bytes().record(kMetadata, (each) => each.text(name).map(entries)));
    this.metadata.push({ offset, length: this.written - offset, name });
  }

  /** Messages come in the order of their times. */
  addMessage(channel: number, timeNs: bigint, payload: Uint8Array): void {
    if (this.index.size === 0) this.times = [timeNs, timeNs];
    this.times[1] = timeNs;
    if (!this.index.has(channel)) this.index.set(channel, []);
    this.index.get(channel)!.push([timeNs, this.records.size]);
    this.records.u8(kMessage).u64(kMessageHead + payload.length).u16(channel).u32(this.counts[channel]).u64(timeNs).u64(timeNs).raw(payload);
    ++this.counts[channel];
    if (this.records.size >= kChunkBytes) this.closeChunk();
  }

  /** The whole file. */
  finish(): Uint8Array<ArrayBuffer>[] {
    this.closeChunk();
    this.put(new Bytes().record(kDataEnd, (each) => each.u32(0)));
    const summary = this.written;
    this.put(this.definitions);
    this.put(new Bytes().record(kStatistics, (each) => each.u64(this.counts.reduce((sum, count) => sum + count, 0))
      .u16(this.schemas).u32(this.counts.length).u32(0).u32(this.metadata.length).u32(this.chunks.length)
      .u64(this.chunks[0]?.first ?? 0n).u64(this.chunks[this.chunks.length - 1]?.last ?? 0n)
      .group((counts) => this.counts.forEach((count, channel) => counts.u16(channel).u64(count)))));
    for (const each of this.chunks) this.put(new Bytes().record(kChunkIndex, (into) => into.u64(each.first).u64(each.last).u64(each.offset)
      .u64(each.length).group((offsets) => each.indexes.forEach((offset, channel) => offsets.u16(channel).u64(offset)))
      .u64(each.indexBytes).text("").u64(each.size).u64(each.size)));
    for (const { offset, length, name } of this.metadata) this.put(new Bytes().record(kMetadataIndex, (each) => each.u64(offset).u64(length).text(name)));
    this.put(new Bytes().record(kFooter, (each) => each.u64(summary).u64(0).u32(0)).raw(kMagic));
    return this.parts;
  }

  private define(record: Bytes): void {
    this.definitions.raw(record.taken());
    this.records.raw(record.taken());
  }

  private put(bytes: Bytes): void {
    this.parts.push(bytes.taken());
    this.written += bytes.size;
  }

  private closeChunk(): void {
    if (this.index.size === 0) return;
    const [first, last] = this.times;
    const size = this.records.size;
    const offset = this.written;
    this.put(new Bytes().record(kChunk, (each) => each.u64(first).u64(last).u64(size).u32(0).text("").u64(size).raw(this.records.taken())));
    const length = this.written - offset;
    const indexes = new Map<number, number>();
    for (const [channel, entries] of this.index) {
      indexes.set(channel, this.written);
      this.put(new Bytes().record(kMessageIndex, (each) => each.u16(channel)
        .group((into) => entries.forEach(([time, at]) => into.u64(time).u64(at)))));
    }
    this.chunks.push({ first, last, offset, length, indexes, indexBytes: this.written - offset - length, size });
    this.records = new Bytes();
    this.index = new Map();
  }
}
