/** The newest samples of an axis at full rate, one column for each signal. */

/** Samples that are kept: half a minute at 8 kHz. */
const kCapacity = 1 << 18;

/** Samples of one axis in the order of their ticks. A gap has a row of NaN. */
export interface Rows {
  ticks: Float64Array;
  columns: Map<string, Float64Array>;
}

export class History {
  // Each value stands twice, one capacity apart, so that every window is one piece of memory.
  private readonly ticks = new Float64Array(2 * kCapacity);
  private columns = new Map<string, Float64Array>();
  private count = 0;
  lastTick = -1;

  /** Keeps these signals from now on; their earlier values, if there are none, are NaN. */
  choose(signals: Iterable<string>): void {
    const chosen = new Map<string, Float64Array>();
    for (const name of signals) chosen.set(name, this.columns.get(name) ?? new Float64Array(2 * kCapacity).fill(NaN));
    this.columns = chosen;
  }

  push(sample: Record<string, number>, afterGap: boolean): void {
    const tick = sample.tick;
    if (tick <= this.lastTick) this.count = 0; // another run of the bench
    const isGap = afterGap || tick > this.lastTick + 1;
    if (isGap && this.count > 0) this.put(tick - 0.5, null);
    this.put(tick, sample);
    this.lastTick = tick;
  }

  clear(): void {
    this.count = 0;
    this.lastTick = -1;
  }

  /** The rows with ticks from `from` to `to`; they are valid until the next push. */
  rows(from: number, to: number): Rows {
    const kept = Math.min(this.count, kCapacity);
    const start = (this.count - kept) % kCapacity;
    const all = this.ticks.subarray(start, start + kept);
    const first = start + lowerBound(all, from);
    const end = start + lowerBound(all, to + 0.25);
    const columns = new Map([...this.columns].map(([name, values]) => [name, values.subarray(first, end)]));
    return { ticks: this.ticks.subarray(first, end), columns };
  }

  private put(tick: number, sample: Record<string, number> | null): void {
    const at = this.count++ % kCapacity;
    this.ticks[at] = this.ticks[at + kCapacity] = tick;
    for (const [name, values] of this.columns) {
      values[at] = values[at + kCapacity] = sample === null ? NaN : sample[name];
    }
  }
}

/** The number of values below the limit in rising values, of which those before `low` are known to be. */
export function lowerBound(values: Float64Array, limit: number, low = 0): number {
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

/** A copy that later samples do not change. */
export function copyOf(rows: Rows): Rows {
  return { ticks: rows.ticks.slice(), columns: new Map([...rows.columns].map(([name, values]) => [name, values.slice()])) };
}

/** The rows between two ticks of rows. */
export function between(rows: Rows, from: number, to: number): Rows {
  const first = lowerBound(rows.ticks, from);
  const end = lowerBound(rows.ticks, to + 0.25);
  return {
    ticks: rows.ticks.subarray(first, end),
    columns: new Map([...rows.columns].map(([name, values]) => [name, values.subarray(first, end)])),
  };
}

/**
 * The least and the greatest value in each of `count` equal parts of the window, in the order in which they came: a spike
 * of one tick stays visible. A part without samples is undefined (the line goes on), one with a gap alone is null.
 */
export function envelope(rows: Rows, signal: string, from: number, to: number, count: number): (number | null | undefined)[] {
  const points = new Array<number | null | undefined>(2 * count);
  const { ticks, columns } = rows;
  const values = columns.get(signal);
  if (values === undefined) return points;
  const perTick = count / (to - from);
  for (let row = 0; row < values.length;) {
    const part = Math.min(Math.max(Math.floor((ticks[row] - from) * perTick), 0), count - 1);
    const end = from + (part + 1) / perTick;
    const first = row;
    row = part === count - 1 ? values.length : lowerBound(ticks, end, row + 1);
    let low = Infinity;
    let high = -Infinity;
    let lowAt = -1;
    let highAt = -1;
    for (let i = first; i < row; ++i) {
      const value = values[i];
      if (value < low) {
        low = value;
        lowAt = i;
      }
      if (value > high) {
        high = value;
        highAt = i;
      }
    }
    const isGap = lowAt < 0;
    points[2 * part] = isGap ? null : lowAt < highAt ? low : high;
    points[2 * part + 1] = isGap ? null : lowAt < highAt ? high : low;
  }
  return points;
}
