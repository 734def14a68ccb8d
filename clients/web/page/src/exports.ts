/** Files of what the scope shows. */
import { eachPoint, extentOf, Line, Logarithms, logRange, shareOf, valueOf } from "./curves";
import { lowerBound } from "./history";
import { plain } from "./numbers";
import { Track } from "./player/recorded";
import { Channel, View } from "./view";
import { pb } from "./wire";

/** Cells of a table that are written in one go: some ten milliseconds. */
const kCellsAtOnce = 1 << 17;

/** A table in parts. Between them the page does the rest of its work: it must be heard while it drives an axis. */
async function tableOf(heads: string[], rows: number, rowOf: (row: number) => (string | number)[]): Promise<string[]> {
  const parts = [heads.join(",") + "\n"];
  const atOnce = Math.ceil(kCellsAtOnce / heads.length);
  for (let from = 0; from < rows; from += atOnce) {
    const lines = Array.from({ length: Math.min(atOnce, rows - from) }, (_, i) => rowOf(from + i).join(","));
    parts.push(lines.join("\n") + "\n");
    await new Promise((done) => setTimeout(done));
  }
  return parts;
}

/** All samples of a view that stays, at full rate: a row for each tick, empty where an axis has none. */
export function csvOf(channels: (Channel & { title: string })[], view: View, periodS: number): Promise<string[]> {
  const axes = [...new Set(channels.map((each) => each.axis))];
  const ticks = [...new Set(axes.flatMap((axis) => [...view.rows[axis].ticks]))].filter(Number.isInteger).sort((a, b) => a - b);
  return tableOf(["tick", "time_s", ...channels.map((each) => each.title)], ticks.length, (place) => {
    const tick = ticks[place];
    const cells = channels.map(({ axis, signal }) => {
      const row = lowerBound(view.rows[axis].ticks, tick);
      const value = view.rows[axis].ticks[row] === tick ? view.rows[axis].columns.get(signal)?.[row] : undefined;
      return value === undefined || Number.isNaN(value) ? "" : String(value);
    });
    return [tick, tick * periodS, ...cells];
  });
}

/** The rows of a track as `drivebench experiment fetch` writes them. */
export function csvOfRows(track: Track, descriptions: pb.ISignalDescription[], signals: string[], periodS: number): Promise<string[]> {
  const heads = signals.map((each) => `${each} [${descriptions.find(({ name }) => name === each)?.unit}]`);
  return tableOf(["tick", "time_s", ...heads], track.ticks.length, (row) => {
    const values = track.read(row);
    return [track.ticks[row], (track.ticks[row] * periodS).toFixed(9), ...signals.map((each) => values[each])];
  });
}

interface SvgPane {
  /** null: as wide as the lines. */
  x: [number, number] | null;
  labels: { x: string; y: string };
  logarithmic: Logarithms;
  lines: (Line & { title: string; colour: string })[];
}

/** Columns of a plot over time. */
export const kColumns = 1200;
const kWidth = 1000;
const kHeight = 236;
const kLeft = 70;

/** The panes one below the other. */
export function svgOf(panes: SvgPane[]): string {
  const bodies = panes.map((pane, i) => `<g transform="translate(0 ${i * kHeight})">${paneSvg(pane)}</g>`);
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${kWidth}" height="${panes.length * kHeight}" `
    + `font-family="sans-serif" font-size="12">\n<rect width="100%" height="100%" fill="white"/>\n${bodies.join("\n")}\n</svg>\n`;
}

function paneSvg({ x, labels, logarithmic, lines }: SvgPane): string {
  const across = x ?? visible(extentOf(lines.map((each) => each.x)));
  const heights = extentOf(lines.map((each) => each.y));
  const up = logarithmic.y ? logRange("y", heights) : visible(heights);
  const [top, bottom, right] = [24, kHeight - 46, kWidth - 12];
  const xOf = (value: number) => kLeft + shareOf(value, across, logarithmic.x) * (right - kLeft);
  const yOf = (value: number) => bottom - shareOf(value, up, logarithmic.y) * (bottom - top);
  const grid = [0, 0.25, 0.5, 0.75, 1].map((share) => {
    const gridY = bottom - share * (bottom - top);
    const gridX = kLeft + share * (right - kLeft);
    return `<path d="M${kLeft} ${gridY}H${right}M${gridX} ${top}V${bottom}" stroke="#ccc"/>`
      + `<text x="${kLeft - 6}" y="${gridY + 4}" text-anchor="end">${plain(valueOf(share, up, logarithmic.y))}</text>`
      + `<text x="${gridX}" y="${bottom + 16}" text-anchor="middle">${plain(valueOf(share, across, logarithmic.x))}</text>`;
  });
  const drawn = lines.map((line, i) => `<path d="${pathOf(line, xOf, yOf)}" fill="none" stroke="${line.colour}"/>`
    + `<text x="${kLeft + 150 * (i + 1)}" y="16" fill="${line.colour}">${escaped(line.title)}</text>`);
  return `${grid.join("")}<text x="4" y="16">${escaped(labels.y)}</text>`
    + `<text x="${(kLeft + right) / 2}" y="${bottom + 34}" text-anchor="middle">${escaped(labels.x)}</text>${drawn.join("")}`;
}

function pathOf(line: Line, xOf: (value: number) => number, yOf: (value: number) => number): string {
  let path = "";
  eachPoint(line, (x, y, begins) => path += `${begins ? "M" : "L"}${xOf(x).toFixed(1)} ${yOf(y).toFixed(1)}`);
  return path;
}

/** A range of some width. */
function visible([low, high]: [number, number]): [number, number] {
  return low === high ? [low - 1, high + 1] : [low, high];
}

function escaped(text: string): string {
  return text.replace(/&/g, "&amp;").replace(/</g, "&lt;");
}
