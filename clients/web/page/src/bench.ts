/** What the page knows of the bench. */
import { History, Rows } from "./history";
import { pb, Wire } from "./wire";

/** Samples of an axis, of which those up to the last tick are shown. */
export interface Timeline {
  lastTick: number;
  rows(from: number, to: number): Rows;
}

/** What the scope shows: the bench, or something recorded. */
export interface Source {
  readonly description: pb.BenchDescription;
  readonly histories: Timeline[];
  readonly firstTick: number;
  /** The time between two samples. [s] */
  readonly sampleS: number;
  readonly dropped: number;
  /** Of the bench. */
  readonly wire?: Wire;
}

/** The states of an axis, as samples number them. */
export const kStates = ["idle", "run", "hold", "timeout", "fault", "ready"];

export function axisName(source: Source, axis: number): string {
  return source.description.axes[axis].name as string;
}

export function signalOf(source: Source, name: string): pb.SignalDescription {
  return source.description.signals.find((each) => each.name === name) as pb.SignalDescription;
}

export class Bench implements Source {
  readonly description: pb.BenchDescription;
  readonly histories: History[];
  readonly firstTick = 0;
  status: pb.Status | null = null;
  /** Samples that the server dropped because the page read too slowly. */
  dropped = 0;

  constructor(readonly wire: Wire, readonly welcome: pb.Welcome, readonly conducts: boolean) {
    this.description = welcome.bench as pb.BenchDescription;
    this.histories = this.description.axes.map(() => new History());
  }

  get mayChange(): boolean {
    return this.welcome.role !== pb.Role.ROLE_VIEWER;
  }

  /** Whether a change of an axis needs its lease. */
  get changesUnderLease(): boolean {
    return !this.conducts && this.description.mode !== pb.Mode.MODE_FREE;
  }

  get isRealtime(): boolean {
    return this.description.mode === pb.Mode.MODE_REALTIME;
  }

  get isLockstep(): boolean {
    return this.description.mode === pb.Mode.MODE_LOCKSTEP;
  }

  get sampleS(): number {
    return this.description.period_s as number;
  }

  sampleOf(axis: number): pb.Sample | null {
    return (this.status?.axes.find((each) => each.axis === axis)?.sample ?? null) as pb.Sample | null;
  }
}

/** Whether a bit is set in a number of up to 53 bits. */
export function hasBit(word: number, bit: number): boolean {
  return Math.floor(word / bit) % 2 === 1;
}

/** The names of the bits that are set. */
export function namesOfBits(descriptions: { bit?: number | null; name?: string | null }[], word: number): string[] {
  return descriptions.filter((each) => hasBit(word, each.bit as number)).map((each) => each.name as string);
}

/** The signals that an axis usually shows, in panes. */
export function usualPanes(axis: pb.IAxisDescription): string[][] {
  const terminals = ["a", "b", "c"].slice(0, axis.phases ?? 3);
  const currents = terminals.map((each) => `i_${each}_a`);
  const voltages = terminals.map((each) => `u_${each}_v`);
  if (axis.field_winding) {
    currents.push("i_f_a");
    voltages.push("u_f_v");
  }
  return [["speed_rad_s"], currents, voltages];
}
