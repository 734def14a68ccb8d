/** The row of the scope that sets its trigger. */
import { Source } from "./bench";
import { button, choice, element, setText } from "./dom";
import { numberIn } from "./numbers";
import { Condition, Sweep, Trigger } from "./trigger";

export class TriggerBar {
  readonly root = element("div", { class: "bar" });
  private readonly source: HTMLSelectElement;
  private readonly bit: HTMLSelectElement;
  private readonly level = element("input", { "aria-label": "trigger level", value: "0", size: 7, change: () => this.apply() });
  private readonly before = element("input", {
    type: "range", min: 0, max: 100, value: 20, "aria-label": "part of the window before the trigger, percent", input: () => this.apply(),
  });
  private readonly beforeText = element("span", {}, "20 % before");
  private readonly state = element("output", { "aria-label": "trigger state" }, "off");
  private readonly arm = button("Arm", () => this.changed(), { disabled: true });
  private condition: Condition = "off";
  private sweep: Sweep = "normal";

  constructor(source: Source, private readonly trigger: Trigger, private readonly changed: () => void) {
    const { axes, signals, faults, injectable_faults: injectable } = source.description;
    this.source = choice("trigger signal", axes.flatMap((axis, number) => signals.map((each): [string, string] =>
      [`${number}:${each.name}`, axes.length > 1 ? `${axis.name}.${each.name}` : each.name as string])), () => this.apply());
    this.source.value = "0:speed_rad_s";
    this.bit = choice("trigger bit", axes.flatMap((axis, number) => [
      ...faults.map((each): [string, string] => [`${number}:faults:${each.bit}`, `${axis.name}: fault ${each.name}`]),
      ...injectable.map((each): [string, string] => [`${number}:injected:${each.bit}`, `${axis.name}: injected ${each.name}`]),
    ]), () => this.apply());
    this.root.append("Trigger", choice("trigger condition", [["off", "off"], ["rising", "rising edge"], ["falling", "falling edge"],
      ["above", "above level"], ["below", "below level"], ["bit", "fault appears"]], (value) => {
      this.condition = value as Condition;
      this.apply();
    }), this.source, this.bit, this.level, this.before, this.beforeText, choice("trigger sweep",
      [["normal", "normal"], ["single", "single"], ["auto", "auto"]], (value) => {
        this.sweep = value as Sweep;
        this.apply();
      }), this.arm, this.state);
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

  private showParts(): void {
    this.source.hidden = this.level.hidden = this.condition === "off" || this.condition === "bit";
    this.bit.hidden = this.condition !== "bit";
    this.before.hidden = this.beforeText.hidden = this.condition === "off";
    this.arm.disabled = this.condition === "off";
  }

  private apply(): void {
    this.showParts();
    const isBit = this.condition === "bit";
    const [axis, signal, bit] = (isBit ? this.bit : this.source).value.split(":");
    const level = isBit ? Number(bit) : numberIn(this.level.value);
    this.level.setAttribute("aria-invalid", String(Number.isNaN(level)));
    const before = Number(this.before.value) / 100;
    setText(this.beforeText, `${this.before.value} % before`);
    this.trigger.settings = { condition: this.condition, axis: Number(axis), signal, level, before, sweep: this.sweep };
    this.changed();
  }
}
