/** Drives axes open loop or with a reference controller: the page sets targets, the gateway sends the commands. */
import { axisName, Bench } from "./bench";
import { button, byId, choice, element, setText } from "./dom";
import { Field, fieldsOf, Gates, gatesOf, switchedOff, PresetTarget, Target, targetOf, unitOf, Wave, wavesOf } from "./drive_target";
import { Leases } from "./leases";
import { numberIn, withUnit } from "./numbers";
import { PresetRows } from "./preset_rows";
import { DriveReport, pb } from "./wire";

const kAliveMs = 500;
/** The gateway takes no others. */
const [kLargest, kLongestRamp_s] = [1e6, 3600];
const kWaveNames: Record<Wave, string> = { rotating: "V/f: a rotating vector", standing: "alpha, beta: a standing vector", terminals: "each terminal" };
const kPaces = [1, 0.3, 0.1, 0.03, 0.01, 0.001];

export class DrivePanel {
  private readonly answer = element("p", { class: "answer", role: "status" });
  private readonly targets = new Map<number, Target | PresetTarget>();
  private readonly shown = new Map<number, HTMLElement>();
  private readonly presets = new Map<number, PresetRows>();
  private readonly ended = new AbortController();
  private readonly timer: number;
  private pace = 1;
  private isPaused = false;
  private isDriving = false;
  private runs = 0;

  constructor(root: HTMLElement, private readonly bench: Bench, private readonly leases: Leases) {
    const axes = bench.description.axes;
    const isUsed = bench.mayChange && axes.some((axis) => gatesOf(axis).length > 0);
    root.hidden = !isUsed;
    root.replaceChildren();
    this.timer = window.setInterval(() => this.isDriving && this.bench.wire.order({ op: "alive" }), kAliveMs);
    this.setDriving(false);
    if (!isUsed) return;
    root.append(element("h2", {}, "Drive"), element("p", { class: "soft" }, explanation(bench)), this.answer);
    if (bench.isLockstep) root.append(this.timeRow());
    axes.forEach((axis, number) => root.append(this.axisRows(number, axis)));
    leases.watch((axis, sentence) => this.leaseChanged(axis, sentence));
    const { signal } = this.ended;
    byId("stop").addEventListener("click", () => this.stop(), { signal });
    document.addEventListener("keydown", (event) => event.key === "Escape" && this.stop(), { signal });
    bench.wire.order({ op: "presets" });
  }

  end(): void {
    clearInterval(this.timer);
    this.ended.abort();
    this.setDriving(false);
  }

  /** What the gateway says about its drive. */
  take(report: DriveReport): void {
    if (report.problem !== "") this.tell(report.problem, true);
    else if (report.state === "over" && this.isDriving) this.tell("the leases are given back");
    for (const [axis, place] of this.shown) {
      const now = report.axes.find((each) => each.axis === axis);
      setText(place, now === undefined || now.run !== undefined ? "" : nowText(now));
      this.presets.get(axis)?.show(now?.run);
    }
    if (report.presets !== undefined) return report.presets.forEach((presets, axis) => this.presets.get(axis)?.offer(presets));
    if (!this.isDriving || (report.state !== "over" && report.state !== "idle")) return;
    this.targets.clear();
    this.setDriving(false);
    if (report.state === "over") for (const axis of this.leases.held) this.leases.lost(axis, "");
  }

  private tell(text: string, isBad = false): void {
    setText(this.answer, text);
    this.answer.classList.toggle("bad", isBad);
  }

  private setDriving(isDriving: boolean): void {
    this.isDriving = isDriving;
    this.leases.areDriven = isDriving;
    byId("stop").hidden = !isDriving;
  }

  /** Lockstep waits for all axes whose leases the page holds: those without a target are off. */
  private send(): void {
    const axes = this.leases.held.map((axis) => this.targets.get(axis) ?? switchedOff(axis));
    this.bench.wire.order({ op: "drive", axes });
    this.setDriving(axes.length > 0);
  }

  private stop(): void {
    if (!this.isDriving) return;
    for (const axis of this.targets.keys()) this.targets.set(axis, switchedOff(axis));
    this.send();
    this.tell("stopped: the gates are off");
  }

  private async drive(axis: number, target: Target | PresetTarget): Promise<void> {
    try {
      await this.leases.acquire(axis);
      this.targets.set(axis, target);
      this.tell(`axis ${axisName(this.bench, axis)}: the gateway drives it`);
      this.send();
    } catch (problem) {
      this.tell(`lease: ${(problem as Error).message}`, true);
    }
  }

  /** The gateway switches the gates off and then gives all leases back. */
  private giveBack(): void {
    if (!this.isDriving) return;
    this.leases.areGivenBack = true;
    this.bench.wire.order({ op: "drive", axes: [] });
  }

  private leaseChanged(axis: number, sentence: string): void {
    if (sentence !== "") this.tell(sentence, true);
    if (!this.leases.holds(axis)) this.targets.delete(axis);
    if (this.isDriving) this.send();
  }

  private sendPace(): void {
    this.bench.wire.order({ op: "pace", pace: this.isPaused ? 0 : this.pace });
  }

  /** Lockstep: the time runs at a pace, stands still, or makes steps. */
  private timeRow(): HTMLElement {
    const pace = choice("pace of the time", kPaces.map((each) => [String(each), each === 1 ? "as the clock" : `${1 / each < 10 ? (1 / each).toFixed(1) : Math.round(1 / each)} times slower`]),
      (value) => {
        this.pace = Number(value);
        this.sendPace();
      });
    const pause = button("Hold the time", () => {
      this.isPaused = !this.isPaused;
      setText(pause, this.isPaused ? "Let the time run" : "Hold the time");
      step.disabled = !this.isPaused;
      this.sendPace();
    });
    const count = element("input", { "aria-label": "ticks of a step", value: "1", size: 5 });
    const step = button("Step", () => {
      const ticks = numberIn(count.value);
      const isGood = Number.isInteger(ticks) && ticks >= 1 && ticks <= 1e6;
      count.setAttribute("aria-invalid", String(!isGood));
      if (isGood) this.bench.wire.order({ op: "step", ticks });
      else this.tell(`ticks of a step: '${count.value}' is no whole number from 1 to 1000000`, true);
    }, { disabled: true });
    return element("div", { class: "bar" }, "Time", pace, pause, step, count, "ticks");
  }

  private axisRows(number: number, axis: pb.IAxisDescription): HTMLElement {
    const allowed = gatesOf(axis);
    const name = axis.name as string;
    if (allowed.length === 0) {
      return element("p", { class: "soft" }, axis.shares_amplifier_with ? `${name}: takes the voltages of axis ${axis.shares_amplifier_with}`
        : `${name}: its drive is a source, which takes no commands`);
    }
    const place = element("div", { class: "fields" });
    let fields: [Field, HTMLInputElement][] = [];
    const show = () => {
      const before = new Map(fields.map(([field, input]) => [field.name, input.value]));
      fields = fieldsOf(wave.value as Wave, gates.value as Gates, axis).map((field) =>
        [field, element("input", { "aria-label": `${field.label} (${name})`, value: before.get(field.name) ?? field.value, size: 7 })]);
      place.replaceChildren(...fields.map(([field, input]) => element("label", {}, `${field.label} `, input)));
    };
    const wave = choice(`wave of ${name}`, wavesOf(axis).map((each) => [each, kWaveNames[each]]), show);
    const gates = choice(`set-points of ${name}`, allowed.map((each) => [each, each]), () => {
      fields = []; // numbers of another unit
      show();
    });
    show();
    const now = element("span", { class: "value" });
    this.shown.set(number, now);
    const presets = new PresetRows(name, (preset) => void this.drive(number, { axis: number, preset, run: ++this.runs }), () => this.stop());
    this.presets.set(number, presets);
    const start = () => {
      const values: Record<string, number> = {};
      for (const [field, input] of fields) {
        values[field.name] = numberIn(input.value);
        const [least, most] = field.name === "ramp" ? [0, kLongestRamp_s] : [-kLargest, kLargest];
        const isGood = values[field.name] >= least && values[field.name] <= most;
        input.setAttribute("aria-invalid", String(!isGood));
        if (!isGood) return this.tell(`${field.label}: '${input.value}' is no number from ${least} to ${most}`, true);
      }
      void this.drive(number, targetOf(number, axis, wave.value as Wave, gates.value as Gates, values));
    };
    return element("details", { open: number === 0 }, element("summary", {}, name),
      element("form", { submit: (event) => {
        event.preventDefault();
        start();
      } }, element("div", { class: "bar" }, wave, gates), place,
      element("div", { class: "bar" }, element("button", { type: "submit", "aria-label": `drive ${name}` }, "Drive"),
        button("Stop", () => this.stop(), { "aria-label": `stop ${name}` }),
        button("Give back", () => this.giveBack(), { "aria-label": `give ${name} back` }), now)), presets.root);
  }
}

function nowText(now: DriveReport["axes"][number]): string {
  if (now.gates === "off") return "gates off";
  const size = withUnit(now.amplitude, unitOf(now.gates));
  return now.frequency_hz === 0 && now.amplitude === 0 ? now.gates : `${now.frequency_hz.toFixed(2)} Hz, ${size}`;
}

function explanation(bench: Bench): string {
  const common = "Escape stops: gates off. If the page falls silent for 5 s, the gateway ramps down, switches off and gives the lease back.";
  return bench.isLockstep ? `While the page drives, the gateway lets the time run. ${common}`
    : `The gateway sends a command each tick; the page sets the targets. ${common}`;
}
