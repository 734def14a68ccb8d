/** A pane of the scope: channels over one axis of time. */
import uPlot from "uplot";
import { Bench } from "./bench";
import { button, element } from "./dom";
import { envelope } from "./history";
import { Channel, View } from "./view";

export interface Cursors {
  a: number | null;
  b: number | null;
}

export interface PaneListener {
  changed(): void;
  removed(pane: Pane): void;
  clicked(time: number): void;
  selected(fromTime: number, toTime: number): void;
}

const kHeight = 190;
const kColours = 8;

function cssVariable(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export class Pane {
  readonly root = element("div", { class: "pane" });
  private readonly chips = element("div", { class: "chips" });
  private readonly plotPlace = element("div", { class: "plot" });
  private readonly add: HTMLSelectElement;
  private plot: uPlot | null = null;
  private times = [0, 1];
  private marks: number[] = [];

  constructor(private readonly bench: Bench, readonly channels: Channel[], private readonly listener: PaneListener) {
    this.add = element("select", { "aria-label": "add a signal to this pane", change: () => this.addChosen() });
    this.fillChoice();
    this.root.append(element("div", { class: "pane-head" }, this.chips, this.add,
      button("×", () => listener.removed(this), { class: "small", "aria-label": "remove this pane" })), this.plotPlace);
    this.rebuild();
    new ResizeObserver(() => this.resize()).observe(this.plotPlace);
  }

  /** The units of the channels, each once. */
  get units(): string[] {
    return [...new Set(this.channels.map((each) => this.bench.signal(each.signal).unit as string))];
  }

  /** Makes the plot anew, for other channels or another theme. */
  rebuild(): void {
    this.plot?.destroy();
    this.showChips();
    const ink = cssVariable("--ink-soft");
    const grid = { stroke: cssVariable("--grid"), width: 1 };
    const line = { stroke: ink, grid, ticks: grid, font: "12px system-ui", labelFont: "12px system-ui" };
    this.plot = new uPlot({
      width: Math.max(this.plotPlace.clientWidth, 100),
      height: kHeight,
      legend: { show: false },
      cursor: { sync: { key: "scope" }, drag: { x: true, y: false, setScale: false }, points: { show: false } },
      scales: { x: { time: false, range: () => [this.times[0], this.times[1]] } },
      axes: [{ ...line, label: "time [s]", labelSize: 16, size: 28, values: (_plot, ticks) => ticks.map((each) => String(Number(each.toPrecision(9)))) },
        { ...line, label: this.units.map((each) => `[${each}]`).join(" "), labelSize: 18, size: 62 }],
      series: [{}, ...this.channels.map((each) => ({
        label: each.signal, stroke: this.colourOf(each), width: 1.3, points: { show: false },
      }))],
      hooks: { draw: [(plot) => this.drawMarks(plot)], setSelect: [(plot) => this.select(plot)] },
    }, [[], ...this.channels.map(() => [])], this.plotPlace);
    this.plot.over.addEventListener("click", (event) => {
      this.listener.clicked(this.plot!.posToVal(event.offsetX, "x"));
    });
  }

  /** Draws a view; the marks are times. */
  draw(view: View, periodS: number, marks: number[]): void {
    if (this.plot === null) return;
    const count = Math.max(Math.floor(this.plot.over.clientWidth), 50);
    this.times = [(view.from - view.origin) * periodS, (view.to - view.origin) * periodS];
    this.marks = marks;
    const step = (this.times[1] - this.times[0]) / count;
    const times = Array.from({ length: 2 * count }, (_, i) => this.times[0] + ((i >> 1) + 0.5) * step);
    this.plot.setData([times, ...this.channels.map((each) =>
      envelope(view.rows[each.axis], each.signal, view.from, view.to, count))] as uPlot.AlignedData);
  }

  colourOf(channel: Channel): string {
    return cssVariable(`--line-${this.channels.indexOf(channel) % kColours}`);
  }

  nameOf(channel: Channel): string {
    return this.bench.histories.length > 1 ? `${this.bench.axisName(channel.axis)}.${channel.signal}` : channel.signal;
  }

  private drawMarks(plot: uPlot): void {
    const context = plot.ctx;
    context.save();
    context.setLineDash([4, 4]);
    context.lineWidth = 1;
    context.strokeStyle = cssVariable("--ink");
    for (const time of this.marks) {
      const x = Math.round(plot.valToPos(time, "x", true)) + 0.5;
      if (x < plot.bbox.left || x > plot.bbox.left + plot.bbox.width) continue;
      context.beginPath();
      context.moveTo(x, plot.bbox.top);
      context.lineTo(x, plot.bbox.top + plot.bbox.height);
      context.stroke();
    }
    context.restore();
  }

  private select(plot: uPlot): void {
    if (plot.select.width < 4) return;
    const from = plot.posToVal(plot.select.left, "x");
    const to = plot.posToVal(plot.select.left + plot.select.width, "x");
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.listener.selected(from, to);
  }

  private resize(): void {
    if (this.plotPlace.clientWidth > 0) this.plot?.setSize({ width: this.plotPlace.clientWidth, height: kHeight });
    this.listener.changed();
  }

  private showChips(): void {
    this.chips.replaceChildren(...this.channels.map((channel, i) => element("span", { class: "chip" },
      element("span", { class: `swatch line-${i % kColours}` }), this.nameOf(channel),
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
