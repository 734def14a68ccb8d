/** What the scope shows as an MCAP file, with the topics, the schema and the times of a recording. */
import { Reader, Writer } from "protobufjs/minimal.js";
import { axisName, signalOf, Source } from "./bench";
import { lowerBound } from "./history";
import { McapFile } from "./mcap_file";
import { Channel, View } from "./view";
import { pb } from "./wire";

/** Ticks that are written in one go: some ten milliseconds. Between them the page must be heard while it drives an axis. */
const kTicksAtOnce = 2048;
const kSample = "drivebench.v1.Sample";

/** The samples of a view that stays. The schema has the shown signals alone, under their numbers in bench.proto. */
export async function mcapOf(source: Source, channels: Channel[], view: View): Promise<BlobPart[]> {
  const periodNs = BigInt(Math.round(1e9 * (source.description.period_s as number)));
  const file = new McapFile("drivebench", "drivebench page");
  const axes = [...new Set(channels.map((each) => each.axis))].map((axis) => {
    const signals = [...new Set(channels.filter((each) => each.axis === axis && each.signal !== "tick").map((each) => each.signal))];
    const schema = file.addSchema(kSample, "protobuf", sampleSchema(["tick", ...signals]));
    const units = Object.fromEntries(["tick", ...signals].map((each) => [`unit.${each}`, signalOf(source, each).unit as string]));
    return { rows: view.rows[axis], signals, channel: file.addChannel(`/${axisName(source, axis)}/sample`, schema, "protobuf", units) };
  });
  file.addMetadata("drivebench.view", {
    bench: source.description.name as string, first_tick: String(Math.ceil(view.from)), last_tick: String(Math.floor(view.to)),
    reading: "what a scope showed, not a whole run; log time [ns] is the tick times the period; a value that the page did not have is NaN, or 0 where it is an integer",
  });
  const ticks = [...new Set(axes.flatMap(({ rows }) => [...rows.ticks]))].filter(Number.isInteger).sort((a, b) => a - b);
  for (let n = 0; n < ticks.length; ++n) {
    for (const { rows, signals, channel } of axes) {
      const sample = sampleAt(rows.ticks, rows.columns, signals, ticks[n]);
      if (sample !== null) file.addMessage(channel, BigInt(ticks[n]) * periodNs, pb.Sample.encode(sample as unknown as pb.ISample).finish());
    }
    if (n % kTicksAtOnce === kTicksAtOnce - 1) await new Promise((done) => setTimeout(done));
  }
  return file.finish();
}

/** null where the axis has no sample, or none of these signals. */
function sampleAt(ticks: Float64Array, columns: Map<string, Float64Array>, signals: string[], tick: number): Record<string, number> | null {
  const row = lowerBound(ticks, tick);
  if (ticks[row] !== tick) return null;
  const sample: Record<string, number> = { tick };
  for (const signal of signals) sample[signal] = columns.get(signal)?.[row] ?? NaN;
  return signals.length > 0 && signals.every((each) => Number.isNaN(sample[each])) ? null : sample;
}

/** A FileDescriptorSet (descriptor.proto) with the message Sample of these fields alone. */
export function sampleSchema(signals: string[]): Uint8Array {
  const message = new Writer();
  text(message, 1, "Sample");
  for (const signal of signals) message.uint32(tag(2)).bytes(fieldOf(signal));
  const file = new Writer();
  text(text(file, 1, "bench.proto"), 2, "drivebench.v1").uint32(tag(4)).bytes(message.finish());
  return new Writer().uint32(tag(1)).bytes(text(file, 12, "proto3").finish()).finish();
}

/** Number and type are what the encoder writes for the value 1: a double, a varint of 1, or one of 2 (zigzag). */
function fieldOf(signal: string): Uint8Array {
  const written = new Reader(pb.Sample.encode({ [signal]: 1 } as pb.ISample).finish());
  const key = written.uint32();
  const [kDouble, kUint64, kSint64, kOptional] = [1, 4, 18, 1];
  const type = (key & 7) === 1 ? kDouble : written.uint32() === 1 ? kUint64 : kSint64;
  return text(new Writer(), 1, signal).uint32(3 << 3).uint32(key >> 3).uint32(4 << 3).uint32(kOptional).uint32(5 << 3).uint32(type).finish();
}

function text(into: Writer, field: number, value: string): Writer {
  return into.uint32(tag(field)).string(value);
}

/** Of a field whose value has a length. */
function tag(field: number): number {
  return (field << 3) | 2;
}
