/** The table below the panes: what the scope measures of each channel. */
import { signalOf, Source } from "./bench";
import { element } from "./dom";
import { measure } from "./measurements";
import { withUnit } from "./numbers";
import { Pane } from "./pane";
import { betweenCursors, valueAt, View } from "./view";

const kHeads = ["signal", "newest", "A", "B", "B − A", "minimum", "maximum", "mean", "rms", "peak to peak", "frequency"];

export class MeasurementTable {
  private readonly body = element("tbody");
  private readonly caption = element("caption");
  readonly root = element("div", { class: "table", tabindex: 0, role: "group", "aria-label": "Measurements" },
    element("table", { class: "measurements" }, this.caption,
      element("thead", {}, element("tr", {}, ...kHeads.map((each) => element("th", { scope: "col" }, each)))), this.body));

  constructor(private readonly source: Source) {}

  /** Measures between the cursors where both stand, else over the whole view. */
  draw(panes: Pane[], view: View, [a, b]: (number | null)[]): void {
    const periodS = this.source.description.period_s as number;
    const isBetween = a !== null && b !== null && a !== b;
    const window = betweenCursors(view, [a, b]);
    this.caption.textContent = isBetween
      ? `Between the cursors: B − A = ${withUnit((b - a) * periodS, "s")}, ${b - a} ticks, ${withUnit(1 / Math.abs((b - a) * periodS), "Hz")}`
      : "Of the whole window; click twice into a plot to set the cursors A and B, drag to zoom";
    const rows = panes.flatMap((pane) => pane.channels.map((channel, number) => {
      const unit = signalOf(this.source, channel.signal).unit as string;
      const { ticks, columns } = window.rows[channel.axis];
      const m = measure(columns.get(channel.signal) ?? new Float64Array(0), ticks, periodS);
      const [atA, atB] = [a, b].map((each) => (each === null ? NaN : valueAt(view, channel, each)));
      const cells = [valueAt(view, channel, Infinity), atA, atB, atB - atA, m.minimum, m.maximum, m.mean, m.rms, m.peakToPeak]
        .map((each) => withUnit(each, unit));
      return element("tr", {}, element("th", { scope: "row" }, element("span", { class: `swatch line-${number % 8}` }), pane.nameOf(channel)),
        ...[...cells, withUnit(m.frequency, "Hz")].map((each) => element("td", {}, each)));
    }));
    this.body.replaceChildren(...rows);
  }
}
