/** Samples that stay: those of an experiment, or of a recording. */
import { Source, Timeline } from "../bench";
import { between, lowerBound, Rows } from "../history";
import { pb } from "../wire";

type Values = Record<string, number>;

/** The samples of an axis. The player shows those up to a position. */
export class Track implements Timeline {
  /** The position. */
  lastTick: number;
  private readonly columns = new Map<string, Float64Array>();

  /** `read` gives the values of a row, by their signals. */
  constructor(readonly ticks: Float64Array, readonly read: (row: number) => Values) {
    this.lastTick = this.endTick;
  }

  get endTick(): number {
    return this.ticks.length === 0 ? 0 : this.ticks[this.ticks.length - 1];
  }

  /** Reads the columns of these signals, as far as they are not there. */
  choose(signals: string[]): void {
    const missing = signals.filter((each) => !this.columns.has(each));
    if (missing.length === 0) return;
    const columns = missing.map((each) => {
      const made = new Float64Array(this.ticks.length);
      this.columns.set(each, made);
      return made;
    });
    for (let row = 0; row < this.ticks.length; ++row) {
      const values = this.read(row);
      for (let i = 0; i < missing.length; ++i) columns[i][row] = values[missing[i]] ?? NaN;
    }
  }

  /** All values of a chosen signal. */
  column(signal: string): Float64Array {
    return this.columns.get(signal) as Float64Array;
  }

  rows(from: number, to: number): Rows {
    return between({ ticks: this.ticks, columns: this.columns }, from, Math.min(to, this.lastTick));
  }

  /** The sample at the position; null before the first. */
  sample(): Values | null {
    const row = lowerBound(this.ticks, this.lastTick + 0.25) - 1;
    return row < 0 ? null : this.read(row);
  }
}

/** What the player plays. */
export interface Recorded extends Source {
  readonly histories: Track[];
}

/** From tracks of the axes. Of an axis that the bench does not have only its name is known. */
export function recordedOf(bench: pb.BenchDescription, axes: string[], signals: string[] | null, histories: Track[], periodS: number,
  decimation: number): Recorded {
  const axisOf = (name: string) => bench.axes.find((each) => each.name === name)
    ?? ({ name, machine_kind: "machine", drive_kind: "drive", phases: 3 } as pb.IAxisDescription);
  const description = {
    ...bench, period_s: periodS, axes: axes.map(axisOf),
    signals: signals === null ? bench.signals : bench.signals.filter((each) => signals.includes(each.name as string)),
  } as pb.BenchDescription;
  const firstTick = Math.min(...histories.filter((each) => each.ticks.length > 0).map((each) => each.ticks[0]));
  return { description, histories, firstTick: Number.isFinite(firstTick) ? firstTick : 0, sampleS: periodS * decimation, dropped: 0 };
}

/** The rows of an experiment: float64 for each of its signals, from the first row on. */
export function recordedRows(bench: pb.BenchDescription, info: pb.ExperimentInfo, bytes: Uint8Array): Recorded {
  const { signals } = info;
  const decimation = info.decimation as number;
  const count = Math.floor(bytes.length / (8 * signals.length));
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const read = (row: number) => {
    const values: Values = { tick: row * decimation };
    signals.forEach((name, i) => { values[name] = view.getFloat64(8 * (row * signals.length + i), true); });
    return values;
  };
  const track = new Track(Float64Array.from({ length: count }, (_, row) => row * decimation), read);
  const name = bench.axes[info.axis as number]?.name ?? `axis ${info.axis}`;
  return recordedOf(bench, [name], signals, [track], info.period_s as number, decimation);
}
