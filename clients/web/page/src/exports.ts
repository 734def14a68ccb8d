/** Files of what the scope shows. */
import { envelope, lowerBound } from "./history";
import { plain } from "./numbers";
import { Channel, View } from "./view";

/** All samples of the view at full rate: a row for each tick, empty where an axis has none. */
export function csvOf(channels: (Channel & { title: string })[], view: View, periodS: number): string {
  const axes = [...new Set(channels.map((each) => each.axis))];
  const ticks = [...new Set(axes.flatMap((axis) => [...view.rows[axis].ticks]))].filter(Number.isInteger).sort((a, b) => a - b);
  const lines = [["tick", "time_s", ...channels.map((each) => each.title)].join(",")];
  for (const tick of ticks) {
    const cells = channels.map(({ axis, signal }) => {
      const row = lowerBound(view.rows[axis].ticks, tick);
      const value = view.rows[axis].ticks[row] === tick ? view.rows[axis].columns.get(signal)?.[row] : undefined;
      return value === undefined || Number.isNaN(value) ? "" : String(value);
    });
    lines.push([tick, tick * periodS, ...cells].join(","));
  }
  return lines.join("\n") + "\n";
}

interface SvgPane {
  units: string;
  lines: (Channel & { title: string; colour: string })[];
}

const kWidth = 1000;
const kHeight = 220;
const kLeft = 70;
const kParts = 1200;

/** The panes one below the other. */
export function svgOf(panes: SvgPane[], view: View, periodS: number): string {
  const start = (view.from - view.origin) * periodS;
  const end = (view.to - view.origin) * periodS;
  const bodies = panes.map((pane, i) => `<g transform="translate(0 ${i * kHeight})">${paneSvg(pane, view, start, end)}</g>`);
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${kWidth}" height="${panes.length * kHeight}" `
    + `font-family="sans-serif" font-size="12">\n<rect width="100%" height="100%" fill="white"/>\n${bodies.join("\n")}\n</svg>\n`;
}

function paneSvg(pane: SvgPane, view: View, start: number, end: number): string {
  const points = pane.lines.map((line) => envelope(view.rows[line.axis], line.signal, view.from, view.to, kParts));
  let [low, high] = [Infinity, -Infinity];
  for (const value of points.flat()) {
    if (value === null || value === undefined) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  if (!(low <= high)) [low, high] = [0, 1];
  if (low === high) [low, high] = [low - 1, high + 1];
  const [top, bottom, right] = [24, kHeight - 30, kWidth - 12];
  const yOf = (value: number) => bottom - ((value - low) / (high - low)) * (bottom - top);
  const grid = [0, 0.25, 0.5, 0.75, 1].map((share) => {
    const y = bottom - share * (bottom - top);
    const x = kLeft + share * (right - kLeft);
    return `<path d="M${kLeft} ${y}H${right}M${x} ${top}V${bottom}" stroke="#ccc"/>`
      + `<text x="${kLeft - 6}" y="${y + 4}" text-anchor="end">${plain(low + share * (high - low))}</text>`
      + `<text x="${x}" y="${bottom + 16}" text-anchor="middle">${plain(start + share * (end - start))} s</text>`;
  });
  const lines = pane.lines.map((line, i) => `<path d="${pathOf(points[i], yOf, right)}" fill="none" stroke="${line.colour}"/>`
    + `<text x="${kLeft + 150 * i}" y="16" fill="${line.colour}">${escaped(line.title)}</text>`);
  return `${grid.join("")}<text x="4" y="16">${escaped(pane.units)}</text>${lines.join("")}`;
}

function pathOf(points: (number | null | undefined)[], yOf: (value: number) => number, right: number): string {
  let path = "";
  let isUp = true;
  points.forEach((value, i) => {
    if (value === null) isUp = true;
    if (value === null || value === undefined) return;
    const x = kLeft + (((i >> 1) + 0.5) / kParts) * (right - kLeft);
    path += `${isUp ? "M" : "L"}${x.toFixed(1)} ${yOf(value).toFixed(1)}`;
    isUp = false;
  });
  return path;
}

function escaped(text: string): string {
  return text.replace(/&/g, "&amp;").replace(/</g, "&lt;");
}
