/** Numbers for people. */

const kPrefixes: [number, string][] = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];

/** Units without prefixes: counts, words and ratios. */
function isPlain(unit: string): boolean {
  return ["", "1", "bits", "enum", "counts", "ticks", "rad", "rad/s", "K"].includes(unit);
}

/** `12.3 mA`; what is smaller than a billionth is 0. */
export function withUnit(value: number, unit: string): string {
  if (!Number.isFinite(value)) return "–";
  const shown = unit === "1" || unit === "bits" || unit === "enum" ? "" : unit;
  if (isPlain(unit)) return `${plain(value)} ${shown}`.trim();
  const size = Math.abs(value);
  if (size < 1e-9) return `0 ${shown}`;
  const [factor, prefix] = kPrefixes.find(([least]) => size >= least * 0.9999995) ?? [1e-9, "n"];
  return `${(value / factor).toPrecision(4)} ${prefix}${shown}`;
}

export function plain(value: number): string {
  if (!Number.isFinite(value)) return "–";
  if (Number.isInteger(value)) return String(value);
  if (Math.abs(value) < 1e-9) return "0";
  return String(Number(value.toPrecision(5)));
}

/** The number that the whole text spells; NaN for any other. */
export function numberIn(text: string): number {
  return /^\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*$/.test(text) ? Number(text) : NaN;
}
