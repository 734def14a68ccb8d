/** Curves in a picture with axes. uPlot draws the axes and the cursor of the mouse. */
import uPlot from "uplot";
import { Curves, eachPoint, extentOf, Line, Logarithms, logRange, shareOf } from "./curves";

export interface Look {
  height: number;
  xLabel: string;
  yLabel: string;
  colours: string[];
  /** Both axes have the same unit, and a circle is a circle. */
  isEqualScale: boolean;
  logarithmic: Logarithms;
  /** The cursor of the mouse may select, and is one for all plots over time with this word; null: a plot of something else. */
  cursorOf: string | null;
}

/** A dot with a letter. */
export interface Dot {
  x: number;
  y: number;
  text: string;
}

export interface PlotListener {
  clicked(x: number): void;
  selected(from: number, to: number): void;
}

export function cssVariable(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export class Plot {
  private readonly plot: uPlot;
  private readonly ink = cssVariable("--ink");
  private curves: Curves = { x: [0, 1], lines: [] };
  private marks: number[] = [];
  private dots: Dot[] = [];

  constructor(private readonly place: HTMLElement, private readonly look: Look, listener: PlotListener) {
    const soft = cssVariable("--ink-soft");
    const grid = { stroke: cssVariable("--grid"), width: 1 };
    const line = { stroke: soft, grid, ticks: grid, font: "12px system-ui", labelFont: "12px system-ui" };
    const range = (index: number) => (plot: uPlot): [number, number] => [plot.data[index][0] as number, plot.data[index][1] as number];
    this.plot = new uPlot({
      width: this.width,
      height: look.height,
      legend: { show: false },
      cursor: {
        ...(look.cursorOf === null ? {} : { sync: { key: look.cursorOf } }),
        drag: { x: look.cursorOf !== null, y: false, setScale: false }, points: { show: false },
      },
      scales: { x: { time: false, range: range(0), ...scaleKind(look.logarithmic.x) }, y: { range: range(1), ...scaleKind(look.logarithmic.y) } },
      axes: [{ ...line, label: look.xLabel, labelSize: 16, size: 28, values: (_plot, ticks) => ticks.map((each) => (each === null ? "" : String(Number(each.toPrecision(9))))) },
        { ...line, label: look.yLabel, labelSize: 18, size: 62, ...(look.logarithmic.y ? { values: (_plot, ticks) => ticks.map((each) => (each === null ? "" : each.toExponential(0))) } : {}) }],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: {
        draw: [(plot) => this.paint(plot)],
        setSelect: [(plot) => {
          if (plot.select.width < 4) return;
          const [from, to] = [plot.select.left, plot.select.left + plot.select.width].map((each) => plot.posToVal(each, "x"));
          plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          listener.selected(from, to);
        }],
      },
    }, [emptyRange(look.logarithmic.x), emptyRange(look.logarithmic.y)], place);
    this.plot.over.addEventListener("click", (event) => listener.clicked(this.plot.posToVal(event.offsetX, "x")));
  }

  /** The pixels from side to side. */
  get columns(): number {
    return Math.max(Math.floor(this.plot.over.clientWidth), 50);
  }

  resize(): void {
    if (this.place.clientWidth > 0) this.plot.setSize({ width: this.width, height: this.look.height });
  }

  /** uPlot keeps a plot, and what it draws, until this is called. */
  end(): void {
    this.plot.destroy();
  }

  /** The marks are upright lines. */
  draw(curves: Curves, marks: number[], dots: Dot[]): void {
    [this.curves, this.marks, this.dots] = [curves, marks, dots];
    let x = curves.x ?? padded(extentOf(curves.lines.map((each) => each.x)));
    const heights = extentOf(curves.lines.map((each) => each.y));
    let y = this.look.logarithmic.y ? logRange("y", heights) : padded(heights);
    if (this.look.isEqualScale) [x, y] = equalScale(x, y, this.plot.over.clientWidth, this.plot.over.clientHeight);
    this.plot.setData([x, y]);
  }

  private get width(): number {
    return Math.max(this.place.clientWidth, 100);
  }

  private paint(plot: uPlot): void {
    const { ctx: context, bbox } = plot;
    const ratio = devicePixelRatio;
    const { x: isLogX, y: isLogY } = this.look.logarithmic;
    const [xOf, yOf] = [scaleOf(plot, "x", isLogX), scaleOf(plot, "y", isLogY)];
    context.save();
    context.beginPath();
    context.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    context.clip();
    context.lineWidth = 1; // wider ones chromium paints as polygons: 4 redraws per second instead of 24, without a GPU
    this.curves.lines.forEach((line, i) => {
      context.strokeStyle = this.look.colours[i];
      stroke(context, line, xOf, yOf);
    });
    context.strokeStyle = context.fillStyle = this.ink;
    context.font = `${12 * ratio}px system-ui`;
    for (const { x, y, text } of this.dots) {
      context.beginPath();
      context.arc(xOf(x), yOf(y), 3.5 * ratio, 0, 2 * Math.PI);
      context.fill();
      context.fillText(text, xOf(x) + 6 * ratio, yOf(y) - 6 * ratio);
    }
    context.setLineDash([4, 4]);
    context.lineWidth = 1;
    for (const mark of this.marks) {
      const x = Math.round(xOf(mark)) + 0.5;
      context.beginPath();
      context.moveTo(x, bbox.top);
      context.lineTo(x, bbox.top + bbox.height);
      context.stroke();
    }
    context.restore();
  }
}

/** Draws a line; points less than half a pixel away from the last one are left out. */
function stroke(context: CanvasRenderingContext2D, line: Line, xOf: (value: number) => number, yOf: (value: number) => number): void {
  context.beginPath();
  let lastX = 0;
  let lastY = 0;
  eachPoint(line, (x, y, begins) => {
    const atX = xOf(x);
    const atY = yOf(y);
    if (begins) context.moveTo(atX, atY);
    else if (Math.abs(atX - lastX) < 0.5 && Math.abs(atY - lastY) < 0.5) return;
    else context.lineTo(atX, atY);
    [lastX, lastY] = [atX, atY];
  });
  context.stroke();
}

/** From values to pixels of the canvas. */
function scaleOf(plot: uPlot, scale: "x" | "y", isLog: boolean): (value: number) => number {
  const { min = 0, max = 1 } = plot.scales[scale];
  const start = plot.valToPos(min, scale, true);
  const size = plot.valToPos(max, scale, true) - start;
  if (isLog) return (value) => start + shareOf(value, [min, max], true) * size;
  const perUnit = size / (max - min);
  return (value) => start + (value - min) * perUnit;
}

/** Of an axis before its first curves: a logarithmic one has no 0. */
function emptyRange(isLog: boolean): [number, number] {
  return isLog ? [1, 10] : [0, 1];
}

function scaleKind(isLog: boolean): uPlot.Scale {
  return isLog ? { distr: 3, log: 10 } : {};
}

function padded([low, high]: [number, number]): [number, number] {
  return uPlot.rangeNum(low, high, 0.1, true) as [number, number];
}

/** Widens the range that has more pixels for its unit. */
function equalScale(x: [number, number], y: [number, number], width: number, height: number): [[number, number], [number, number]] {
  const perPixel = Math.max((x[1] - x[0]) / width, (y[1] - y[0]) / height);
  const widened = ([low, high]: [number, number], pixels: number): [number, number] => {
    const more = (perPixel * pixels - (high - low)) / 2;
    return [low - more, high + more];
  };
  return [widened(x, width), widened(y, height)];
}
