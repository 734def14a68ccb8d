/** What an operator changes of an axis: parameters, load, bumps, faults, the lease. The server judges each request. */
import { Bench } from "./bench";
import { button, choice, element, setText } from "./dom";
import { Changes } from "./changes";
import { Leases } from "./leases";
import { numberIn, plain } from "./numbers";
import { pb } from "./wire";

const kReadMs = 2000;

export class Knobs {
  private readonly answer = element("p", { class: "answer", role: "status" });
  private readonly values = new Map<string, HTMLElement>();
  private readonly leaseButtons: HTMLButtonElement[] = [];
  private readonly changes: Changes;
  private timer = 0;

  constructor(root: HTMLElement, private readonly bench: Bench, private readonly leases: Leases) {
    this.changes = new Changes(bench.wire, leases, bench.description.period_s as number);
    root.hidden = !bench.mayChange;
    root.replaceChildren();
    if (!bench.mayChange) return;
    root.append(element("h2", {}, "Knobs"), element("p", { class: "soft" }, leaseText(bench)), this.answer,
      ...bench.description.axes.map((axis, number) => element("details", { open: number === 0 },
        element("summary", {}, axis.name as string), this.leaseRow(number), this.loadRows(number), this.faultRows(number),
        this.parameterRows(number))));
    this.timer = window.setInterval(() => this.readParameters(), kReadMs);
    leases.watch((axis, sentence) => this.leaseChanged(axis, sentence));
  }

  end(): void {
    clearInterval(this.timer);
  }

  private leaseChanged(axis: number, sentence: string): void {
    setText(this.leaseButtons[axis], this.leases.holds(axis) ? "Release the lease" : "Take the lease");
    if (sentence !== "") this.tell(sentence, true);
  }

  private tell(text: string, isBad = false): void {
    setText(this.answer, text);
    this.answer.classList.toggle("bad", isBad);
  }

  /** Asks and shows the answer. */
  private async change(axis: number, what: string, requests: (start: number) => pb.IEnvelope[],
    underLease = this.bench.changesUnderLease): Promise<void> {
    try {
      const ticks = await this.changes.make(axis, requests, underLease);
      this.tell(`${what}: done at tick ${ticks.join(" and ")}`);
    } catch (problem) {
      this.tell(`${what}: ${(problem as Error).message}`, true);
    }
  }

  /** Reads a field; a text that is no number is told, and nothing is sent. */
  private number(field: HTMLInputElement): number | null {
    const value = numberIn(field.value);
    field.setAttribute("aria-invalid", String(Number.isNaN(value)));
    if (!Number.isNaN(value)) return value;
    this.tell(`${field.getAttribute("aria-label")}: '${field.value}' is not a number`, true);
    return null;
  }

  private ticks(seconds: number): number {
    return Math.max(0, Math.round(seconds / (this.bench.description.period_s as number)));
  }

  private leaseRow(axis: number): HTMLElement {
    const toggle = button("Take the lease", async () => {
      try {
        const isOwner = this.leases.holds(axis);
        await (isOwner ? this.leases.release(axis) : this.leases.acquire(axis));
        this.tell(isOwner ? "the lease is released" : "this page holds the lease; other controllers are refused");
      } catch (problem) {
        this.tell(`lease: ${(problem as Error).message}`, true);
      }
    });
    this.leaseButtons[axis] = toggle;
    const clear = button("Clear faults", () => this.change(axis, "clear", () => [{ clear_faults: { axis } }], true));
    return element("div", { class: "bar" }, toggle, clear);
  }

  private loadRows(axis: number): HTMLElement {
    const field = (label: string, value: string) => element("input", { "aria-label": label, value, size: 7 });
    const [load, ramp, impulse] = [field("load torque, N*m", "0"), field("ramp of the load, s", "0"), field("impulse, N*m*s", "0")];
    return element("div", {},
      element("form", { class: "bar", submit: (event) => {
        event.preventDefault();
        const [loadNm, rampS] = [this.number(load), this.number(ramp)];
        if (loadNm === null || rampS === null) return;
        void this.change(axis, "load", () => [{ set_load: { axis, load_nm: loadNm, ramp_ticks: this.ticks(rampS) } }]);
      } }, "Load", load, "N*m in", ramp, "s", element("button", { type: "submit" }, "Set load")),
      element("form", { class: "bar", submit: (event) => {
        event.preventDefault();
        const impulseNms = this.number(impulse);
        if (impulseNms !== null) void this.change(axis, "bump", () => [{ shaft_bump: { axis, impulse_nms: impulseNms } }]);
      } }, "Bump", impulse, "N*m*s", element("button", { type: "submit" }, "Bump")));
  }

  private faultRows(axis: number): HTMLElement {
    const all = this.bench.description.injectable_faults;
    const meaning = element("p", { class: "soft" });
    const value = element("input", { "aria-label": "value of the fault", value: "1", size: 5 });
    const length = element("input", { "aria-label": "ticks that the fault lasts; 0: until it is ended", value: "0", size: 5 });
    const select = choice("fault", all.map((each) => [each.name as string, each.name as string]), () => explain());
    const chosen = () => all.find((each) => each.name === select.value) as pb.InjectableFaultDescription;
    const explain = () => {
      const { meaning: text, minimum, maximum, unit, integer } = chosen();
      setText(meaning, `${text}; ${plain(minimum as number)} to ${plain(maximum as number)} ${unit === "1" ? "" : unit}${integer ? " (whole)" : ""}`);
    };
    explain();
    const inject = (size: number | null, ticks: number | null) => {
      if (size === null || ticks === null) return;
      const name = select.value;
      const put = (value: number, atTick: number) => ({ inject_fault: { axis, name, value, at_tick: atTick } });
      if (ticks === 0) void this.change(axis, `fault ${name}`, () => [put(size, 0)]);
      // Both instants in the same future, so that the fault lasts exactly so long.
      else void this.change(axis, `fault ${name} for ${ticks} ticks`, (start) => [put(size, start), put(0, start + ticks)]);
    };
    return element("div", {}, element("form", { class: "bar", submit: (event) => {
      event.preventDefault();
      inject(this.number(value), this.number(length));
    } }, "Fault", select, value, "for", length, "ticks", element("button", { type: "submit" }, "Inject"),
    button("End", () => inject(0, 0))), meaning);
  }

  private parameterRows(axis: number): HTMLElement {
    const live = this.bench.description.axes[axis].parameters?.filter((each) => each.live) ?? [];
    return element("ul", { class: "parameters", "aria-label": "Parameters" },
      ...live.map((each) => this.parameterRow(axis, each as pb.ParameterDescription)));
  }

  private parameterRow(axis: number, parameter: pb.ParameterDescription): HTMLElement {
    const name = parameter.name as string;
    const words = parameter.words;
    const unit = parameter.unit === "1" ? "" : ` ${parameter.unit}`;
    const shown = element("b", { class: "value" }, valueText(parameter));
    this.values.set(`${axis}:${name}`, shown);
    const field = words.length > 0
      ? element("select", { "aria-label": name }, ...words.map((word, i) => element("option", { value: String(i) }, word)))
      : element("input", { "aria-label": name, value: plain(parameter.value as number), size: 9 });
    const ramp = element("input", { "aria-label": `ramp of ${name}, s`, value: "0", size: 4 });
    const range = words.length > 0 ? "" : `${plain(parameter.minimum as number)} to ${plain(parameter.maximum as number)}${unit}`;
    return element("li", { title: parameter.meaning as string },
      element("div", { class: "parameter" }, element("span", {}, name), element("span", {}, shown, unit)),
      element("form", { class: "bar", submit: (event) => {
        event.preventDefault();
        const value = field instanceof HTMLSelectElement ? Number(field.value) : this.number(field);
        const rampS = this.number(ramp);
        if (value === null || rampS === null) return;
        void this.change(axis, name, () => [{ write_parameter: { axis, name, value, ramp_ticks: this.ticks(rampS) } }])
          .then(() => this.readParameters());
      } }, field, "in", ramp, "s", element("button", { type: "submit", "aria-label": `set ${name}` }, "Set"),
      element("span", { class: "soft range" }, range)));
  }

  private async readParameters(): Promise<void> {
    for (let axis = 0; axis < this.bench.histories.length; ++axis) {
      try {
        const answer = await this.bench.wire.ask({ read_parameters: { axis } });
        for (const each of answer.parameter_values?.parameters ?? []) {
          const shown = this.values.get(`${axis}:${each.name}`);
          if (shown !== undefined) setText(shown, valueText(each as pb.ParameterDescription));
        }
      } catch {
        return; // a lost connection is told elsewhere
      }
    }
  }
}

function leaseText(bench: Bench): string {
  if (!bench.changesUnderLease) return "Load, bump, faults and parameters act beside a controller that drives.";
  return "Each change takes the lease for a moment: while a controller drives, it is refused.";
}

function valueText(parameter: pb.ParameterDescription): string {
  return parameter.words[parameter.value as number] ?? plain(parameter.value as number);
}
