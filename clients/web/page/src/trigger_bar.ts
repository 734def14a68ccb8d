/** The row of the scope that sets its trigger. */
import { kStates, Source } from "./bench";
import { button, choice, element, setText } from "./dom";
import { numberIn } from "./numbers";
import { Condition, Sweep, Trigger } from "./trigger";

const kConditions: [Condition, string][] = [["off", "off"], ["rising", "rising edge"], ["falling", "falling edge"], ["above", "above level"],
  ["below", "below level"], ["leaves", "leaves a band"], ["enters", "enters a band"], ["bit", "fault appears"], ["state", "state is entered"]];

export class TriggerBar {
  readonly root = element("div", { class: "bar" });
  private readonly source: HTMLSelectElement;
  private readonly bit: HTMLSelectElement;
  private readonly entered: HTMLSelectElement;
  private readonly level = this.field("trigger level", 7);
  private readonly upper = this.field("upper end of the band", 7);
  private readonly before = element("input", {
    type: "range", min: 0, max: 100, value: 20, "aria-label": "part of the window before the trigger, percent", input: () => this.apply(),
  });
  private readonly beforeText = element("span", {}, "20 % before");
  private readonly holdOff = this.field("hold-off after a trigger", 5);
  private readonly holdOffUnit = choice("unit of the hold-off", [["s", "s"], ["ticks", "ticks"]], () => this.apply());
  private readonly holdOffPlace = element("span", { class: "bar" }, "hold-off", this.holdOff, this.holdOffUnit);
  private readonly state = element("output", { "aria-label": "trigger state" }, "off");
  private readonly loss = element("span", { class: "note" });
  private readonly arm = button("Arm", () => this.changed(), { disabled: true });
  private readonly periodS: number;
  private condition: Condition = "off";
  private sweep: Sweep = "normal";

  constructor(source: Source, private readonly trigger: Trigger, private readonly changed: () => void) {
    const { axes, signals, faults, injectable_faults: injectable, period_s: period } = source.description;
    this.periodS = period as number;
    this.source = choice("trigger signal", axes.flatMap((axis, number) => signals.map((each): [string, string] =>
      [`${number}:${each.name}`, axes.length > 1 ? `${axis.name}.${each.name}` : each.name as string])), () => this.apply());
    this.source.value = "0:speed_rad_s";
    this.bit = choice("trigger bit", axes.flatMap((axis, number) => [
      ...faults.map((each): [string, string] => [`${number}:faults:${each.bit}`, `${axis.name}: fault ${each.name}`]),
      ...injectable.map((each): [string, string] => [`${number}:injected:${each.bit}`, `${axis.name}: injected ${each.name}`]),
    ]), () => this.apply());
    this.entered = choice("state that is entered", axes.flatMap((axis, number) =>
      kStates.map((each, state): [string, string] => [`${number}:state:${state}`, `${axis.name}: ${each}`])), () => this.apply());
    this.root.append("Trigger", choice("trigger condition", kConditions, (value) => {
      this.condition = value as Condition;
      this.apply();
    }), this.source, this.bit, this.entered, this.level, this.upper, this.before, this.beforeText, choice("trigger sweep",
      [["normal", "normal"], ["single", "single"], ["auto", "auto"]], (value) => {
        this.sweep = value as Sweep;
        this.apply();
      }), this.holdOffPlace, this.arm, this.state, this.loss);
    this.showParts();
  }

  /** The signal that the trigger needs of an axis. */
  signalOf(axis: number): string | null {
    const { condition, axis: own, signal } = this.trigger.settings;
    return condition !== "off" && own === axis ? signal : null;
  }

  show(text: string): void {
    setText(this.state, text);
  }

  /** Events of which nothing was kept, and ticks that the trigger did not see. */
  showLoss(events: number, ticks: number): void {
    setText(this.loss, [events > 0 ? `${events} events before it while the last ones were fetched` : "",
      ticks > 0 ? `${ticks} ticks unseen: the server was too busy` : ""].filter((each) => each !== "").join("; "));
  }

  private field(label: string, size: number): HTMLInputElement {
    return element("input", { "aria-label": label, value: "0", size, change: () => this.apply() });
  }

  private get isBand(): boolean {
    return this.condition === "leaves" || this.condition === "enters";
  }

  private showParts(): void {
    const isOff = this.condition === "off";
    this.bit.hidden = this.condition !== "bit";
    this.entered.hidden = this.condition !== "state";
    this.source.hidden = this.level.hidden = isOff || !this.bit.hidden || !this.entered.hidden;
    this.upper.hidden = !this.isBand;
    this.before.hidden = this.beforeText.hidden = this.arm.disabled = isOff;
    this.holdOffPlace.hidden = isOff || this.sweep === "single";
    this.level.setAttribute("aria-label", this.isBand ? "lower end of the band" : "trigger level");
  }

  /** The number of a field, which shows whether it is one that is allowed. */
  private numberOf(field: HTMLInputElement, least = -Infinity): number {
    const value = numberIn(field.value);
    const isGood = value >= least;
    field.setAttribute("aria-invalid", String(!isGood));
    return isGood ? value : NaN;
  }

  private apply(): void {
    this.showParts();
    const chosen = { bit: this.bit, state: this.entered }[this.condition as string];
    const [axis, signal, number] = (chosen ?? this.source).value.split(":");
    const level = chosen === undefined ? this.numberOf(this.level) : Number(number);
    const upper = this.isBand ? this.numberOf(this.upper, level) : level;
    const holdOff = this.numberOf(this.holdOff, 0);
    const holdOffTicks = Math.ceil((Number.isNaN(holdOff) ? 0 : holdOff) / (this.holdOffUnit.value === "s" ? this.periodS : 1) - 1e-6);
    const before = Number(this.before.value) / 100;
    setText(this.beforeText, `${this.before.value} % before`);
    this.trigger.settings = { condition: this.condition, axis: Number(axis), signal, level, upper, before, sweep: this.sweep, holdOffTicks };
    this.changed();
  }
}
