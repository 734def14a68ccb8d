/** A pane of the scope: its channels, and a plot of them of one of several kinds. */
import { axisName, signalOf, Source } from "./bench";
import { Curves, Kind, Logarithms, spectraOf, spectrumCurves, timeCurves, xyCurves } from "./curves";
import { button, choice, element, setText } from "./dom";
import { numberIn, plain, withUnit } from "./numbers";
import { cssVariable, Dot, Plot } from "./plot";
import { amplitudeAt, peaksOf, Spectrum } from "./spectrum";
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
  private readonly scales = choice("axes of the spectrum", [["", "linear"], ["y", "log amplitude"], ["xy", "log both"]], () => this.look());
  /** Arrows move it by a step of the spectrum. */
  private readonly cursor = element("input", { type: "number", min: 0, "aria-label": "cursor of the spectrum, Hz", placeholder: "cursor, Hz", input: () => this.listener.changed() });
  private plot: Plot | null = null;
  private readonly resized = new ResizeObserver(() => {
    this.plot?.resize();
    this.listener.changed();
  });

  /** `cursorOf`: a word that the panes of one scope share. */
  constructor(private readonly source: Source, readonly channels: Channel[], private readonly cursorOf: string, private readonly listener: PaneListener) {
    this.add = element("select", { "aria-label": "add a signal to this pane", change: () => this.addChosen() });
    this.fillChoice();
    this.highest = choice("highest frequency", frequenciesUpTo(0.5 / source.sampleS).map((each) => [String(each), `to ${plain(each)} Hz`]),
      () => this.listener.changed());
    this.root.append(element("div", { class: "pane-head" }, this.chips,
      choice("kind of this pane", [["time", "over time"], ["xy", "XY"], ["spectrum", "spectrum"]], (kind) => {
        this.kind = kind as Kind;
        this.rebuild();
        this.listener.changed();
      }), this.highest, this.scales, this.cursor, this.add,
      button("×", () => listener.removed(this), { class: "small", "aria-label": "remove this pane" })), this.plotPlace, this.peaks);
    this.rebuild();
    this.resized.observe(this.plotPlace);
  }

  /** Gives its plot and its samples back. */
  end(): void {
    this.resized.disconnect();
    this.plot?.end();
    this.plot = null;
    this.root.remove();
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
    this.highest.hidden = this.scales.hidden = this.cursor.hidden = this.peaks.hidden = this.kind !== "spectrum";
    const { x: xLabel, y: yLabel } = this.labels;
    this.plot = new Plot(this.plotPlace, {
      height: kHeights[this.kind], xLabel, yLabel, cursorOf: this.kind === "time" ? this.cursorOf : null, logarithmic: this.logarithms,
      colours: (this.kind === "xy" ? this.channels.slice(1) : this.channels).map((each) => this.colourOf(each)),
      isEqualScale: this.kind === "xy" && new Set(this.channels.map((each) => this.unitOf(each))).size === 1,
    }, {
      clicked: (x) => this.clicked(x),
      selected: (from, to) => this.listener.selected(from, to),
    });
  }

  /** Which axes are logarithmic: of a spectrum as its user likes. */
  get logarithms(): Logarithms {
    const chosen = this.kind === "spectrum" ? this.scales.value : "";
    return { x: chosen.includes("x"), y: chosen.includes("y") };
  }

  /** Draws a view. The cursors are ticks. */
  draw(view: View, cursors: (number | null)[]): void {
    if (this.kind === "spectrum") {
      const spectra = spectraOf(view, this.channels, this.source.sampleS);
      const known = spectra.find((each) => each !== null);
      if (known) this.cursor.step = String(Number(known.stepHz.toPrecision(9)));
      const at = numberIn(this.cursor.value);
      setText(this.peaks, [...(at >= 0 ? [this.cursorText(at, spectra)] : []), ...this.channels.map((each, i) => this.peaksText(each, spectra[i]))].join("; "));
      this.plot?.draw(spectrumCurves(spectra, this.channels, Number(this.highest.value), this.logarithms.x), at >= 0 ? [at] : [], []);
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
    return spectrumCurves(spectraOf(view, this.channels, this.source.sampleS), this.channels, Number(this.highest.value), this.logarithms.x);
  }

  colourOf(channel: Channel): string {
    return cssVariable(`--line-${this.channels.indexOf(channel) % kColours}`);
  }

  nameOf(channel: Channel): string {
    return this.source.histories.length > 1 ? `${axisName(this.source, channel.axis)}.${channel.signal}` : channel.signal;
  }

  private get periodS(): number {
    return this.source.description.period_s as number;
  }

  private unitOf(channel: Channel): string {
    return signalOf(this.source, channel.signal).unit as string;
  }

  /** Where the cursors stand, and the newest sample. */
  private dotsOf(view: View, [a, b]: (number | null)[]): Dot[] {
    const [first, ...others] = this.channels;
    const places: [number | null, string][] = [[view.to, ""], [a, "A"], [b, "B"]];
    return places.flatMap(([tick, text]) => tick === null ? [] : others.map((each) =>
      ({ x: valueAt(view, first, tick), y: valueAt(view, each, tick), text })));
  }

  /** A click puts the cursor: in a spectrum that of the pane, over time one of all panes. */
  private clicked(x: number): void {
    if (this.kind === "time") this.listener.clicked(x);
    if (this.kind !== "spectrum") return;
    const step = Number(this.cursor.step) || 1;
    this.cursor.value = String(Number((Math.round(x / step) * step).toPrecision(9)));
    this.listener.changed();
  }

  private look(): void {
    this.rebuild();
    this.listener.changed();
  }

  private cursorText(at: number, spectra: (Spectrum | null)[]): string {
    const values = this.channels.map((channel, i) => {
      const spectrum = spectra[i];
      return `${this.nameOf(channel)} ${spectrum === null ? "–" : withUnit(amplitudeAt(spectrum, at), this.unitOf(channel))}`;
    });
    return `at ${withUnit(at, "Hz")}: ${values.join(", ")}`;
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
    this.source.description.axes.forEach((axis, number) => {
      this.add.append(element("optgroup", { label: axis.name as string }, ...this.source.description.signals.map((signal) =>
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
