/** The reference controllers that fit an axis: which one, how far its run is, and the numbers of its end. */
import { button, choice, element, setText } from "./dom";
import { Preset, PresetRun } from "./wire";

export class PresetRows {
  readonly root = element("div", { class: "preset", hidden: true });
  private readonly source = element("p", { class: "soft" });
  private readonly progress = element("progress", { max: 1, value: 0 });
  private readonly words = element("span", { role: "status" });
  private readonly table = element("tbody");
  private readonly result = element("table", { class: "list", hidden: true }, element("caption"), this.table);
  private shown = "";
  private isOver = true;

  /** `run` starts the run of a preset, `stop` switches off. */
  constructor(private readonly axis: string, private readonly run: (preset: string) => void, private readonly stop: () => void) {
    this.progress.setAttribute("aria-label", `progress of ${axis}`);
  }

  /** The presets that the gateway offers for the axis. */
  offer(presets: Preset[]): void {
    this.root.hidden = presets.length === 0;
    const describe = (name: string) => {
      const preset = presets.find((each) => each.name === name);
      setText(this.source, preset === undefined ? "" : `${preset.source}. Expect: ${preset.expectation}`);
    };
    const names = choice(`preset of ${this.axis}`, presets.map(({ name }) => [name, name]), describe);
    if (presets.length > 0) describe(names.value);
    this.root.replaceChildren(element("div", { class: "bar" }, "Reference controller", names,
      button("Run", () => this.run(names.value), { "aria-label": `run the preset on ${this.axis}` }),
      button("Stop", () => this.stop(), { "aria-label": `stop the preset on ${this.axis}` })),
    this.source, element("div", { class: "bar" }, this.progress, this.words), this.result);
  }

  /** Undefined: nothing runs, or no longer. */
  show(run: PresetRun | undefined): void {
    if (run === undefined) {
      if (!this.isOver) setText(this.words, "stopped: the gates are off");
      this.isOver = true;
      return;
    }
    this.isOver = run.phase === "done" || run.phase === "failed";
    this.progress.value = run.progress;
    setText(this.words, wordsOf(run));
    this.words.className = run.phase === "failed" ? "bad" : "";
    const shown = `${run.number} ${run.numbers.length}`;
    if (shown === this.shown) return;
    this.shown = shown;
    this.result.hidden = run.numbers.length === 0;
    setText(this.result.caption as HTMLElement, run.preset);
    this.table.replaceChildren(...run.numbers.map(({ name, value, unit }) =>
      element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, `${value} ${unit}`.trim()))));
  }
}

export function wordsOf({ preset, phase, progress, failure }: PresetRun): string {
  if (phase === "failed") return `${preset} did not end: ${failure}`;
  if (phase === "resting") return `${preset}: gates off until the axis is at rest`;
  return phase === "done" ? `${preset}: done, the gates are off` : `${preset}: ${phase}, ${Math.floor(100 * progress)} %`;
}
