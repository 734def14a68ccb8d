/** The samples that the server has kept around an event. */
import { lowerBound, Rows } from "./history";
import { Channel, View } from "./view";

/** CaptureRows as it comes. */
export interface Piece {
  first_row: number;
  data: Uint8Array;
}

/** By axis; null for an axis of which nothing was kept. */
export interface Captured {
  tick: number;
  rows: Map<number, Rows>;
}

/** From rows of a tick and the values of the channels; NaN is no sample. A gap has a row of NaN, as in a history. */
export function capturedRows(data: Float64Array, channels: Channel[]): Map<number, Rows> {
  const width = 1 + channels.length;
  const places: number[] = []; // of the rows in data; -1 is a gap
  const ticks: number[] = [];
  for (let at = 0; at < data.length; at += width) {
    if (at > 0 && data[at] > data[at - width] + 1) {
      places.push(-1);
      ticks.push(data[at] - 0.5);
    }
    places.push(at);
    ticks.push(data[at]);
  }
  const found = new Map<number, Rows>();
  channels.forEach(({ axis, signal }, n) => {
    if (!found.has(axis)) found.set(axis, { ticks: Float64Array.from(ticks), columns: new Map() });
    found.get(axis)!.columns.set(signal, Float64Array.from(places, (place) => (place < 0 ? NaN : data[place + 1 + n])));
  });
  return found;
}

/** A view with the captured samples in the place of its own, which may have gaps; beyond their ends its own. */
export function withCapture(view: View, captured: Captured): View {
  return { ...view, rows: view.rows.map((rows, axis) => merged(rows, captured.rows.get(axis), view.from, view.to)) };
}

function merged(rows: Rows, kept: Rows | undefined, from: number, to: number): Rows {
  if (kept === undefined || kept.ticks.length === 0) return rows;
  const [begin, end] = [lowerBound(kept.ticks, from), lowerBound(kept.ticks, to + 0.25)];
  const inside = kept.ticks.subarray(begin, end);
  const before = lowerBound(rows.ticks, kept.ticks[0] - 0.75);
  const after = lowerBound(rows.ticks, kept.ticks[kept.ticks.length - 1] + 0.75);
  const joined = (head: Float64Array, middle: Float64Array, tail: Float64Array) => {
    const all = new Float64Array(head.length + middle.length + tail.length);
    all.set(head);
    all.set(middle, head.length);
    all.set(tail, head.length + middle.length);
    return all;
  };
  // What was not captured, such as a signal that is shown since then, is there as far as the page has it.
  const own = (values: Float64Array) => Float64Array.from(inside, (tick) => {
    const row = lowerBound(rows.ticks, tick);
    return rows.ticks[row] === tick ? values[row] : NaN;
  });
  const names = new Set([...rows.columns.keys(), ...kept.columns.keys()]);
  return {
    ticks: joined(rows.ticks.subarray(0, before), inside, rows.ticks.subarray(after)),
    columns: new Map([...names].map((name) => {
      const values = rows.columns.get(name) ?? new Float64Array(rows.ticks.length).fill(NaN);
      const middle = kept.columns.get(name)?.subarray(begin, end) ?? own(values);
      return [name, joined(values.subarray(0, before), middle, values.subarray(after))];
    })),
  };
}
