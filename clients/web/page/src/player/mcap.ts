/** Reads recordings: MCAP files with the samples of axes, in chunks without compression, as the bench writes them. */
import { pb } from "../wire";
import { Recorded, recordedOf, Track } from "./recorded";

const kMagic = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a];
const [kChannel, kMessage, kChunk] = [0x04, 0x05, 0x06];
const kTopicEnd = "/sample";
/** A bench has fewer. */
const kMostAxes = 64;
/** Of a message before its payload: channel, sequence, two times. */
const kMessageHead = 22;

/** Where the samples of an axis lie in the file. */
interface Samples {
  channel: number;
  axis: string;
  starts: number[];
  ends: number[];
  timesNs: number[];
}

/** What the file holds; throws Error with a sentence for a file that is no recording. A torn end is left out. */
export function recordedFile(bench: pb.BenchDescription, bytes: Uint8Array): Recorded {
  if (!kMagic.every((each, i) => bytes[i] === each)) throw new Error("the file is no recording: it does not begin like an MCAP file");
  const found = new Map<number, Samples>();
  readRecords(new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), kMagic.length, bytes.length, bytes, found);
  const axes = [...found.values()].filter((each) => each.starts.length > 0);
  if (axes.length === 0) throw new Error("the recording has no samples of an axis");
  const sampleAt = ({ axis, starts, ends }: Samples, row: number) => {
    try {
      return pb.Sample.decode(bytes.subarray(starts[row], ends[row])) as unknown as Record<string, number>;
    } catch {
      throw new Error(`the recording is damaged: sample ${row + 1} of axis '${axis}' cannot be read`);
    }
  };
  const tracks = axes.map((each) =>
    new Track(Float64Array.from(each.starts, (_, row) => sampleAt(each, row).tick), (row) => sampleAt(each, row)));
  return recordedOf(bench, axes.map((each) => each.axis), null, tracks, periodOf(axes[0], tracks[0]) ?? bench.period_s as number, 1);
}

/** The time between two ticks; null where the samples do not tell: there is one alone, or their times do not rise. */
function periodOf({ timesNs }: Samples, { ticks }: Track): number | null {
  const last = ticks.length - 1;
  const period = Number(((1e-9 * (timesNs[last] - timesNs[0])) / (ticks[last] - ticks[0])).toPrecision(9));
  return ticks[last] > ticks[0] && period > 0 ? period : null;
}

function readRecords(view: DataView, from: number, end: number, bytes: Uint8Array, found: Map<number, Samples>, isChunk = false): void {
  for (let at = from; at + 9 <= end;) {
    const kind = view.getUint8(at);
    const size = Number(view.getBigUint64(at + 1, true));
    const start = at + 9;
    at = start + size;
    if (at > end) return;
    if (kind === kChunk && isChunk) throw new Error("the recording is damaged: a chunk lies in a chunk");
    if (kind === kChunk && size >= 40) {
      const compression = view.getUint32(start + 28, true);
      if (compression > 0) throw new Error("the recording is compressed; those of the bench are not");
      readRecords(view, start + 40, at, bytes, found, true);
    } else if (kind === kChannel && size >= 8) {
      const length = Math.min(view.getUint32(start + 4, true), size - 8);
      const topic = new TextDecoder().decode(bytes.subarray(start + 8, start + 8 + length));
      const channel = view.getUint16(start, true);
      if (!topic.endsWith(kTopicEnd) || found.has(channel)) continue; // the end of the file names the channels again
      const axis = topic.slice(1, -kTopicEnd.length);
      if ([...found.values()].some((each) => each.axis === axis)) throw new Error(`the recording has two channels of axis '${axis}'`);
      if (found.size === kMostAxes) throw new Error(`the recording has more than ${kMostAxes} axes`);
      found.set(channel, { channel, axis, starts: [], ends: [], timesNs: [] });
    } else if (kind === kMessage && size >= kMessageHead) {
      const samples = found.get(view.getUint16(start, true));
      if (samples === undefined) continue;
      samples.starts.push(start + kMessageHead);
      samples.ends.push(at);
      samples.timesNs.push(Number(view.getBigUint64(start + 6, true)));
    }
  }
}
