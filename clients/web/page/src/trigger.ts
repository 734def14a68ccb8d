/**
 * The trigger of the scope. The server looks at every sample and keeps those around an event until they are fetched, so that
 * no event is missed, whatever the browser, the gateway and the network do meanwhile.
 */
import { Captured, Piece, capturedRows } from "./capture";
import { Channel } from "./view";
import { pb, Refused, Wire } from "./wire";

export type Condition = "off" | "rising" | "falling" | "above" | "below" | "leaves" | "enters" | "bit" | "state";
export type Sweep = "auto" | "normal" | "single";

export interface TriggerSettings {
  condition: Condition;
  axis: number;
  signal: string;
  /** The level; the lower end of a band; for "bit" the value of the bit, for "state" the number of the state. */
  level: number;
  /** The upper end of a band. */
  upper: number;
  /** The part of the window before the trigger, 0 to 1. */
  before: number;
  sweep: Sweep;
  /** After a trigger so many ticks have none. */
  holdOffTicks: number;
}

const kConditions = { ...conditions("RISING", "FALLING", "ABOVE", "BELOW", "LEAVES", "ENTERS"), bit: pb.TriggerCondition.TRIGGER_BITS_APPEAR,
  state: pb.TriggerCondition.TRIGGER_EQUALS } as Record<Condition, pb.TriggerCondition>;
/** The bounds of a capture in bench.proto: ticks, and numbers in all. */
const kMostTicks = 65536;
const kMostNumbers = 1 << 20;
/** Requests for pieces that are under way; more would fill the gateway's queue. */
const kPiecesAtOnce = 8;

export class Trigger {
  settings: TriggerSettings = { condition: "off", axis: 0, signal: "", level: 0, upper: 0, before: 0.2, sweep: "normal", holdOffTicks: 0 };
  isArmed = false;
  /** The tick of an event whose capture is not fetched yet. */
  firedTick: number | null = null;
  /** The newest capture that is fetched; the scope takes it from here. */
  captured: Captured | null = null;
  /** The server's words for settings that it refused. */
  problem = "";
  /** What the server has told of the newest event. */
  missedEvents = 0;
  lostTicks = 0;
  private channels: Channel[] = [];
  private setting = 0; // the number of the newest
  private settingInForce = 0; // the newest that is answered: events are of this one
  private lastFired = Infinity;

  /** `changed` is called when there is something to show. */
  constructor(private readonly wire: Pick<Wire, "ask"> | undefined, private readonly changed: () => void) {}

  /** From now on, whatever fired before. The capture has the channels and the signal of the trigger. */
  arm(shown: Channel[], windowTicks: number): void {
    const { condition, axis, signal, level, upper, before, sweep, holdOffTicks } = this.settings;
    if (condition === "off") return this.end();
    const isKept = shown.some((each) => each.axis === axis && each.signal === signal);
    this.channels = isKept ? shown : [...shown, { axis, signal }];
    const isBit = condition === "bit";
    this.set(true, {
      condition: kConditions[condition], axis, signal, level: isBit ? 0 : level, upper, bits: isBit ? level : 0,
      ...ticksAround(before, windowTicks, this.channels.length), hold_off_ticks: holdOffTicks, single: sweep === "single", captured: grouped(this.channels),
    });
  }

  /** Nothing fires until it is armed again. */
  end(): void {
    if (this.isArmed) this.set(false, {});
  }

  /** It is armed, and the hold-off of the trigger before is not over at this tick. */
  holdsOff(tick: number): boolean {
    return tick >= this.lastFired && tick + 1 < this.lastFired + this.settings.holdOffTicks;
  }

  /** An event, and later that its capture is complete. */
  take(triggered: pb.Triggered): void {
    if (!this.isArmed || this.settingInForce !== this.setting) return;
    this.firedTick = this.lastFired = triggered.tick as number;
    this.missedEvents = triggered.missed_events as number;
    this.lostTicks = triggered.lost_ticks as number;
    if (triggered.complete) void this.fetch(triggered.capture as number, triggered.tick as number, triggered.rows as number);
    this.changed();
  }

  private set(isArmed: boolean, trigger: pb.ITrigger): void {
    this.isArmed = isArmed;
    this.firedTick = this.captured = null;
    this.problem = "";
    this.lastFired = Infinity;
    const setting = ++this.setting;
    // Noted while the message is read: an event may follow in the same one.
    const answered = () => {
      this.settingInForce = setting;
      return false;
    };
    this.wire?.ask({ trigger }, answered).catch((problem) => {
      if (!(problem instanceof Refused) || setting !== this.setting) return; // a lost connection is told elsewhere
      this.isArmed = false;
      this.problem = problem.message;
      this.changed();
    });
  }

  /** All pieces of a capture; the last one arms a trigger that is not single. */
  private async fetch(capture: number, tick: number, rows: number): Promise<void> {
    const { channels, setting } = this;
    const data = new Float64Array(rows * (1 + channels.length));
    const piece = async (first: number) => {
      const answer = await this.wire!.ask({ read_capture: { capture, first_row: first } });
      return put(data, channels.length, answer.capture_rows as Piece);
    };
    try {
      const perPiece = await piece(0);
      for (let first = perPiece; first < rows; first += kPiecesAtOnce * perPiece) {
        await Promise.all(Array.from({ length: kPiecesAtOnce }, (_, n) => first + n * perPiece).filter((each) => each < rows).map(piece));
      }
    } catch {
      return; // another setting has taken its place, or the connection is lost
    }
    if (setting !== this.setting) return;
    if (this.firedTick === tick) this.firedTick = null; // otherwise it is the tick of the next event
    this.isArmed = this.settings.sweep !== "single";
    this.captured = { tick, rows: capturedRows(data, channels) };
    this.changed();
  }
}

function conditions(...names: string[]): object {
  return Object.fromEntries(names.map((each) => [each.toLowerCase(), pb.TriggerCondition[`TRIGGER_${each}` as keyof typeof pb.TriggerCondition]]));
}

/** The ticks of a capture: those of the window, or the largest part of it that the server keeps. */
export function ticksAround(before: number, windowTicks: number, channels: number): { ticks_before: number; ticks_after: number } {
  const ticks = Math.min(Math.ceil(windowTicks) + 1, kMostTicks, Math.floor(kMostNumbers / (1 + channels)));
  const ticksBefore = Math.min(Math.floor(before * ticks), ticks - 1);
  return { ticks_before: ticksBefore, ticks_after: ticks - ticksBefore };
}

function grouped(channels: Channel[]): pb.ICapturedSignals[] {
  const axes = [...new Set(channels.map((each) => each.axis))];
  return axes.map((axis) => ({ axis, signals: channels.filter((each) => each.axis === axis).map((each) => each.signal) }));
}

/** Copies the rows of a piece to their place; returns their number. */
function put(data: Float64Array, channels: number, { first_row: first, data: bytes }: Piece): number {
  const rowBytes = 8 * (1 + channels);
  new Uint8Array(data.buffer).set(bytes, first * rowBytes);
  return bytes.length / rowBytes;
}
