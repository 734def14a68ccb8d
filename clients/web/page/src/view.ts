/** What the scope shows: a window that rolls with time, or one that stands still. */
import { Source } from "./bench";
import { between, copyOf, Rows } from "./history";

/** A window in ticks, with the samples of every axis. Times are shown from the origin on. */
export interface View {
  from: number;
  to: number;
  origin: number;
  rows: Rows[];
}

export interface Channel {
  axis: number;
  signal: string;
}

export function rollingView(source: Source, windowTicks: number): View {
  const newest = Math.max(...source.histories.map((each) => each.lastTick), source.firstTick + windowTicks);
  return viewOf(source, newest - windowTicks, newest, 0);
}

export function viewOf(source: Source, from: number, to: number, origin: number): View {
  return { from, to, origin, rows: source.histories.map((each) => each.rows(from, to)) };
}

/** A copy that stays as it is. */
export function frozen(view: View): View {
  return { ...view, rows: view.rows.map(copyOf) };
}

/** A part of a view that stands still. */
export function part(view: View, from: number, to: number): View {
  return { ...view, from, to, rows: view.rows.map((each) => between(each, from, to)) };
}

/** The part between the cursors where both stand, else all of it. */
export function betweenCursors(view: View, [a, b]: (number | null)[]): View {
  return a === null || b === null || a === b ? view : part(view, Math.min(a, b), Math.max(a, b));
}

/** The value of the sample at or before a tick; NaN before the first. */
export function valueAt(view: View, channel: Channel, tick: number): number {
  const rows = between(view.rows[channel.axis], -Infinity, tick);
  const values = rows.columns.get(channel.signal);
  return values === undefined || values.length === 0 ? NaN : values[values.length - 1];
}
