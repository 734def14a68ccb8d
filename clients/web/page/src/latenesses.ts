/** The latenesses of all ticks as a small chart: a bar for each octave of time. */
import { drawing } from "./dom";
import { withUnit } from "./numbers";

/** Entry n of Status.lateness_counts is below this times 2^n. [s] */
const kFirstEdgeS = 125e-9;
const [kWidth, kHeight] = [260, 46];

export interface Bar {
  /** The upper edge. [s] */
  belowS: number;
  count: number;
  /** 0 to 1; by the logarithm, so that one late tick among millions is seen. */
  height: number;
  /** Whether some of the ticks in it came after the next one was due. */
  isLate: boolean;
}

/** From the first octave with a tick to the last one; the bars in between may be empty. */
export function barsOf(counts: number[], periodS: number): Bar[] {
  const first = counts.findIndex((each) => each > 0);
  const last = counts.reduce((found, each, n) => (each > 0 ? n : found), -1);
  const scale = Math.log(1 + Math.max(...counts));
  return counts.slice(Math.max(first, 0), last + 1).map((count, n) => {
    const belowS = kFirstEdgeS * 2 ** (Math.max(first, 0) + n);
    return { belowS, count, height: count === 0 ? 0 : Math.log(1 + count) / scale, isLate: belowS > periodS };
  });
}

/** For a screen reader, and as a title. */
export function sentenceOf(bars: Bar[]): string {
  const parts = bars.filter((each) => each.count > 0).map((each) => `${each.count} below ${withUnit(each.belowS, "s")}`);
  return `lateness of the ticks, each octave by itself: ${parts.join(", ")}`;
}

export class Latenesses {
  readonly root = drawing("svg", { viewBox: `0 0 ${kWidth} ${kHeight}`, class: "latenesses", role: "img" });

  draw(counts: number[], periodS: number): void {
    const bars = barsOf(counts, periodS);
    this.root.setAttribute("aria-label", sentenceOf(bars));
    const width = kWidth / Math.max(bars.length, 1);
    const most = kHeight - 14;
    this.root.replaceChildren(...bars.flatMap((bar, n) => [
      drawing("rect", { class: bar.isLate ? "late" : "", x: n * width + 1, width: Math.max(width - 2, 1), y: most * (1 - bar.height),
        height: most * bar.height }, drawing("title", {}, `${bar.count} below ${withUnit(bar.belowS, "s")}`)),
      ...(n === 0 || n === bars.length - 1 ? [drawing("text", { x: n === 0 ? 1 : kWidth - 1, y: kHeight - 2,
        "text-anchor": n === 0 ? "start" : "end" }, `< ${withUnit(bar.belowS, "s")}`)] : []),
    ]));
  }
}
