/** A pane of the scope: its channels, and a plot of them of one of several kinds. */
import { Bench } from "./bench";
import { Curves, Kind, spectraOf, spectrumCurves, timeCurves, xyCurves } from "./curves";
import { button, choice, element, setText } from "./dom";
import { plain, withUnit } from "./numbers";
import { cssVariable, Dot, Plot } from "./plot";
import { peaksOf, Spectrum } from "./spectrum";
import { Channel, valueAt, View } from "./view";

export interface PaneListener {
  changed(): void;
  removed(pane: Pane): void;
  clicked(time: number): void;
  selected(fromTime: number, toTime: number): void;
}

const kHeights = { time: 190, xy: 320, spectrum: 190 };
const kColours = 8;
const kPeaks = 5;
/** Peaks below this part of the largest are not named. */
const kLeastPeak = 0.005;

export class Pane {
  readonly root = element("div", { class: "pane" });
  kind: Kind = "time";
  private readonly chips = element("div", { class: "chips" });
  private readonly plotPlace = element("div", { class: "plot" });
  private readonly peaks = element("p", { class: "soft peaks", hidden: true });
  private readonly add: HTMLSelectElement;
  private readonly highest: HTMLSelectElement;
  private plot: Plot | null = null;

  constructor(private readonly bench: Bench, readonly channels: Channel[], private readonly listener: PaneListener) {
    this.add = element("select", { "aria-label": "add a signal to this pane", change: () => this.addChosen() });
    this.fillChoice();
    this.highest = choice("highest frequency", frequenciesUpTo(0.5 / this.periodS).map((each) => [String(each), `to ${plain(each)} Hz`]),
      () => this.listener.changed());
    this.root.append(element("div", { class: "pane-head" }, this.chips,
      choice("kind of this pane", [["time", "over time"], ["xy", "XY"], ["spectrum", "spectrum"]], (kind) => {
        this.kind = kind as Kind;
        this.rebuild();
        this.listener.changed();
      }), this.highest, this.add,
      button("×", () => listener.removed(this), { class: "small", "aria-label": "remove this pane" })), this.plotPlace, this.peaks);
    this.rebuild();
    new ResizeObserver(() => {
      this.plot?.resize();
      this.listener.changed();
    }).observe(this.plotPlace);
  }

  /** What stands beside the axes. */
  get labels(): { x: string; y: string } {
    const units = (channels: Channel[]) => [...new Set(channels.map((each) => `[${this.unitOf(each)}]`))].join(" ");
    if (this.kind === "time") return { x: "time [s]", y: units(this.channels) };
    if (this.kind === "spectrum") return { x: "frequency [Hz]", y: `amplitude ${units(this.channels)}` };
    const [first, ...others] = this.channels;
    return { x: first === undefined ? "" : `${this.nameOf(first)} [${this.unitOf(first)}]`, y: units(others) };
  }

  /** Makes the plot anew, for other channels, another kind or another theme. */
  rebuild(): void {
    this.plot?.end();
    this.showChips();
    this.highest.hidden = this.peaks.hidden = this.kind !== "spectrum";
    const isOverTime = this.kind === "time";
    const { x: xLabel, y: yLabel } = this.labels;
    this.plot = new Plot(this.plotPlace, {
      height: kHeights[this.kind], xLabel, yLabel, isOverTime,
      colours: (this.kind === "xy" ? this.channels.slice(1) : this.channels).map((each) => this.colourOf(each)),
      isEqualScale: this.kind === "xy" && new Set(this.channels.map((each) => this.unitOf(each))).size === 1,
    }, {
      clicked: (time) => isOverTime && this.listener.clicked(time),
      selected: (from, to) => this.listener.selected(from, to),
    });
  }

  /** Draws a view. The cursors are ticks. */
  draw(view: View, cursors: (number | null)[]): void {
    if (this.kind === "spectrum") {
      const spectra = spectraOf(view, this.channels, this.periodS);
      setText(this.peaks, this.channels.map((each, i) => this.peaksText(each, spectra[i])).join("; "));
      this.plot?.draw(spectrumCurves(spectra, this.channels, Number(this.highest.value)), [], []);
    } else if (this.kind === "xy") {
      this.plot?.draw(xyCurves(view, this.channels), [], this.dotsOf(view, cursors));
    } else {
      const marks = cursors.filter((each) => each !== null).map((each) => (each! - view.origin) * this.periodS);
      if (view.origin !== 0) marks.push(0); // the trigger
      this.plot?.draw(timeCurves(view, this.channels, this.periodS, this.plot.columns), marks, []);
    }
  }

  /** What the pane draws of a view, for a file. */
  curvesOf(view: View, columns: number): Curves {
    if (this.kind === "xy") return xyCurves(view, this.channels);
    if (this.kind === "time") return timeCurves(view, this.channels, this.periodS, columns);
    return spectrumCurves(spectraOf(view, this.channels, this.periodS), this.channels, Number(this.highest.value));
  }

  colourOf(channel: Channel): string {
    return cssVariable(`--line-${this.channels.indexOf(channel) % kColours}`);
  }

  nameOf(channel: Channel): string {
    return this.bench.histories.length > 1 ? `${this.bench.axisName(channel.axis)}.${channel.signal}` : channel.signal;
  }

  private get periodS(): number {
    return this.bench.description.period_s as number;
  }

  private unitOf(channel: Channel): string {
    return this.bench.signal(channel.signal).unit as string;
  }

  /** Where the cursors stand, and the newest sample. */
  private dotsOf(view: View, [a, b]: (number | null)[]): Dot[] {
    const [first, ...others] = this.channels;
    const places: [number | null, string][] = [[view.to, ""], [a, "A"], [b, "B"]];
    return places.flatMap(([tick, text]) => tick === null ? [] : others.map((each) =>
      ({ x: valueAt(view, first, tick), y: valueAt(view, each, tick), text })));
  }

  private peaksText(channel: Channel, spectrum: Spectrum | null): string {
    if (spectrum === null) return `${this.nameOf(channel)}: too few samples`;
    const peaks = peaksOf(spectrum, kPeaks);
    const named = peaks.filter((each) => each.amplitude > kLeastPeak * peaks[0].amplitude)
      .map((each) => `${withUnit(each.amplitude, this.unitOf(channel))} at ${withUnit(each.frequency, "Hz")}`);
    return `${this.nameOf(channel)}: ${named.join(", ") || "no peak"}`;
  }

  private showChips(): void {
    this.chips.replaceChildren(...this.channels.map((channel, i) => element("span", { class: "chip" },
      this.kind === "xy" && i === 0 ? "X: " : element("span", { class: `swatch line-${i % kColours}` }), this.nameOf(channel),
      button("×", () => this.remove(channel), { class: "small", "aria-label": `remove ${this.nameOf(channel)}` }))));
  }

  private remove(channel: Channel): void {
    this.channels.splice(this.channels.indexOf(channel), 1);
    this.rebuild();
    this.listener.changed();
  }

  private fillChoice(): void {
    this.add.append(element("option", { value: "" }, "+ signal"));
    this.bench.description.axes.forEach((axis, number) => {
      this.add.append(element("optgroup", { label: axis.name as string }, ...this.bench.description.signals.map((signal) =>
        element("option", { value: `${number}:${signal.name}`, title: signal.meaning as string },
          `${signal.name} [${signal.unit}]`))));
    });
  }

  private addChosen(): void {
    const [axis, signal] = this.add.value.split(":");
    this.add.value = "";
    if (signal === undefined || this.channels.some((each) => each.axis === Number(axis) && each.signal === signal)) return;
    this.channels.push({ axis: Number(axis), signal });
    this.rebuild();
    this.listener.changed();
  }
}

/** A frequency and the round ones below it, down to 10 Hz. */
function frequenciesUpTo(highest: number): number[] {
  const round = [5000, 2000, 1000, 500, 200, 100, 50, 20, 10];
  return [highest, ...round.filter((each) => each < highest)];
}
