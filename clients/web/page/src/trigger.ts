/** The trigger of the scope. It sees every sample of its axis, whatever the rate at which the page draws. */

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

export class Trigger {
  settings: TriggerSettings = { condition: "off", axis: 0, signal: "", level: 0, upper: 0, before: 0.2, sweep: "normal", holdOffTicks: 0 };
  /** The tick that fired; null: none yet. */
  firedTick: number | null = null;
  isArmed = false;
  private previous = NaN;
  private lastTick = -Infinity;
  private quietUntil = -Infinity;

  /** From now on, whatever fired before. */
  arm(): void {
    this.isArmed = this.settings.condition !== "off";
    this.firedTick = null;
    this.previous = NaN;
    this.quietUntil = -Infinity;
  }

  /** For the next trigger of a sweep, after the hold-off. */
  armAgain(): void {
    const quietUntil = this.firedTick === null ? -Infinity : this.firedTick + this.settings.holdOffTicks;
    this.arm();
    this.quietUntil = quietUntil;
  }

  /** It is armed, and the hold-off of the trigger before is not over. */
  get holdsOff(): boolean {
    return this.lastTick + 1 < this.quietUntil;
  }

  see(axis: number, sample: Record<string, number>): void {
    const { axis: own, signal } = this.settings;
    if (!this.isArmed || this.firedTick !== null || axis !== own) return;
    if (sample.tick < this.lastTick) this.arm(); // another run of the bench
    const value = sample[signal];
    const previous = this.previous;
    this.previous = value;
    this.lastTick = sample.tick;
    if (sample.tick >= this.quietUntil && fires(this.settings, previous, value)) this.firedTick = sample.tick;
  }
}

/** An edge, the end of a band and a state need a sample on the other side first; what lies above or below fires at once. */
export function fires({ condition, level, upper }: Pick<TriggerSettings, "condition" | "level" | "upper">, previous: number, value: number): boolean {
  const isInside = (each: number) => each >= level && each <= upper;
  const isOutside = (each: number) => each < level || each > upper;
  switch (condition) {
    case "rising":
      return previous < level && value >= level;
    case "falling":
      return previous > level && value <= level;
    case "above":
      return value > level;
    case "below":
      return value < level;
    case "leaves":
      return isInside(previous) && isOutside(value);
    case "enters":
      return isOutside(previous) && isInside(value);
    case "bit":
      return !Number.isNaN(previous) && !hasBit(previous, level) && hasBit(value, level);
    case "state":
      return !Number.isNaN(previous) && previous !== level && value === level;
    default:
      return false;
  }
}

/** Whether a bit is set in a number of up to 53 bits. */
export function hasBit(word: number, bit: number): boolean {
  return Math.floor(word / bit) % 2 === 1;
}
