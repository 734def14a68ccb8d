/** What a pane draws of a view: over time, one signal over another, or amplitudes over frequency. */
import { envelope } from "./history";
import { sinceLastGap, Spectrum, spectrumOf } from "./spectrum";
import { Channel, View } from "./view";

export type Kind = "time" | "xy" | "spectrum";

/** In y, NaN and null break the line, and undefined is no point. */
export interface Line {
  channel: Channel;
  x: ArrayLike<number>;
  y: ArrayLike<number | null | undefined>;
}

export interface Curves {
  /** null: as wide as the lines. */
  x: [number, number] | null;
  lines: Line[];
}

/** Which axes of a plot are logarithmic. */
export interface Logarithms {
  x: boolean;
  y: boolean;
}

/** Decades below the largest value that a logarithmic axis shows. */
const kDecades = { x: 4, y: 6 };

/** From values to 0 at `low` and 1 at `high`. Below a logarithmic axis all is at 0. */
export function shareOf(value: number, [low, high]: [number, number], isLog: boolean): number {
  if (isLog) return value <= low ? 0 : Math.log(value / low) / Math.log(high / low);
  return (value - low) / (high - low);
}

/** The value at a share. */
export function valueOf(share: number, [low, high]: [number, number], isLog: boolean): number {
  return isLog ? low * (high / low) ** share : low + share * (high - low);
}

/** The range of a logarithmic axis: whole decades in y; in x up to the end. */
export function logRange(axis: "x" | "y", [low, high]: [number, number]): [number, number] {
  if (!(high > 0)) return [1e-3, 1];
  const top = axis === "y" ? 10 ** Math.ceil(Math.log10(high)) : high;
  const least = top / 10 ** kDecades[axis];
  if (!(low > least)) return [least, top];
  return [axis === "y" ? Math.min(10 ** Math.floor(Math.log10(low)), top / 10) : Math.min(low, top / 10), top];
}

/** Shows the points of a line in their order; `begins`: the line does not come from the point before. */
export function eachPoint({ x, y }: Line, see: (x: number, y: number, begins: boolean) => void): void {
  let begins = true;
  for (let i = 0; i < y.length; ++i) {
    const value = y[i];
    if (value === undefined) continue;
    if (value === null || Number.isNaN(value) || Number.isNaN(x[i])) {
      begins = true;
      continue;
    }
    see(x[i], value, begins);
    begins = false;
  }
}

/** The least and the greatest value in each of `count` columns. */
export function timeCurves(view: View, channels: Channel[], periodS: number, count: number): Curves {
  const start = (view.from - view.origin) * periodS;
  const end = (view.to - view.origin) * periodS;
  const x = Float64Array.from({ length: 2 * count }, (_, i) => start + (((i >> 1) + 0.5) / count) * (end - start));
  return {
    x: [start, end],
    lines: channels.map((channel) => ({ channel, x, y: envelope(view.rows[channel.axis], channel.signal, view.from, view.to, count) })),
  };
}

/** The first channel goes to the right, the others go up: every sample at which both exist. */
export function xyCurves(view: View, [first, ...others]: Channel[]): Curves {
  return { x: null, lines: first === undefined ? [] : others.map((channel) => ({ channel, ...pairsOf(view, first, channel) })) };
}

/** Values of two channels at the same ticks, which may belong to different axes. */
export function pairsOf(view: View, first: Channel, second: Channel): { x: Float64Array; y: Float64Array } {
  const none = new Float64Array(0);
  const [a, b] = [view.rows[first.axis], view.rows[second.axis]];
  const [xs, ys] = [a.columns.get(first.signal) ?? none, b.columns.get(second.signal) ?? none];
  if (first.axis === second.axis) return { x: xs, y: ys };
  const [x, y]: number[][] = [[], []];
  for (let i = 0, j = 0; i < xs.length && j < ys.length;) {
    const ahead = a.ticks[i] - b.ticks[j];
    if (ahead === 0) {
      x.push(xs[i]);
      y.push(ys[j]);
    }
    if (ahead <= 0) ++i;
    if (ahead >= 0) ++j;
  }
  return { x: Float64Array.from(x), y: Float64Array.from(y) };
}

/** The spectrum of each channel in the view; null where there are too few samples since the last gap. */
export function spectraOf(view: View, channels: Channel[], periodS: number): (Spectrum | null)[] {
  return channels.map(({ axis, signal }) =>
    spectrumOf(sinceLastGap(view.rows[axis].columns.get(signal) ?? new Float64Array(0)), periodS));
}

/** From 0, on a logarithmic axis from the first step on. */
export function spectrumCurves(spectra: (Spectrum | null)[], channels: Channel[], highestHz: number, isLog: boolean): Curves {
  const least = Math.min(...spectra.map((each) => each?.stepHz ?? Infinity), highestHz);
  return {
    x: isLog ? logRange("x", [least, highestHz]) : [0, highestHz],
    lines: spectra.map((spectrum, i) => {
      const y = spectrum?.amplitudes.subarray(0, Math.floor(highestHz / spectrum.stepHz) + 2) ?? new Float64Array(0);
      return { channel: channels[i], x: y.map((_, k) => k * (spectrum?.stepHz ?? 0)), y };
    }),
  };
}

/** From the least to the greatest value; 0 to 1 where there is none. */
export function extentOf(all: ArrayLike<number | null | undefined>[]): [number, number] {
  let low = Infinity;
  let high = -Infinity;
  for (const values of all) {
    for (let i = 0; i < values.length; ++i) {
      const value = values[i];
      if (value === null || value === undefined) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : [0, 1];
}
