/** The trigger of the scope. It sees every sample of its axis, whatever the rate at which the page draws. */

export type Condition = "off" | "rising" | "falling" | "above" | "below" | "bit";
export type Sweep = "auto" | "normal" | "single";

export interface TriggerSettings {
  condition: Condition;
  axis: number;
  signal: string;
  /** The level, or for "bit" the value of the bit. */
  level: number;
  /** The part of the window before the trigger, 0 to 1. */
  before: number;
  sweep: Sweep;
}

export class Trigger {
  settings: TriggerSettings = { condition: "off", axis: 0, signal: "", level: 0, before: 0.2, sweep: "normal" };
  /** The tick that fired; null: none yet. */
  firedTick: number | null = null;
  isArmed = false;
  private previous = NaN;

  arm(): void {
    this.isArmed = this.settings.condition !== "off";
    this.firedTick = null;
    this.previous = NaN;
  }

  see(axis: number, sample: Record<string, number>): void {
    const { condition, axis: own, signal, level } = this.settings;
    if (!this.isArmed || this.firedTick !== null || axis !== own) return;
    const value = sample[signal];
    const previous = this.previous;
    this.previous = value;
    if (fires(condition, previous, value, level)) this.firedTick = sample.tick;
  }
}

/** An edge needs a sample on the other side first; a state fires at once. */
export function fires(condition: Condition, previous: number, value: number, level: number): boolean {
  switch (condition) {
    case "rising":
      return previous < level && value >= level;
    case "falling":
      return previous > level && value <= level;
    case "above":
      return value > level;
    case "below":
      return value < level;
    case "bit":
      return !Number.isNaN(previous) && !hasBit(previous, level) && hasBit(value, level);
    default:
      return false;
  }
}

/** Whether a bit is set in a number of up to 53 bits. */
export function hasBit(word: number, bit: number): boolean {
  return Math.floor(word / bit) % 2 === 1;
}
