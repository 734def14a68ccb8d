/** What a report of `drivebench identify --json` says. The file may be any: nothing in it is trusted. */

export interface Parameter {
  name: string;
  unit: string;
  /** Null: the data do not see the parameter. */
  estimate: number | null;
  /** Half of the 95 % interval. */
  interval: number | null;
  truth: number | null;
  inside: boolean | null;
}

export interface Identification {
  motor: string;
  method: string;
  source: string;
  verdict: string;
  parameters: Parameter[];
  /** A sentence for each signal that was simulated again. */
  validation: string[];
  notes: string[];
}

type Fields = Record<string, unknown>;

const kMost = 200;

/** Null: the file is another one. */
export function identificationIn(report: unknown): Identification | null {
  const all = fieldsOf(report);
  if (all === null || textOf(all.motor) === "" || fieldsOf(all.parameters) === null) return null;
  const validation = fieldsOf(all.validation) ?? {};
  return {
    motor: textOf(all.motor), method: textOf(all.method), source: textOf(all.source), verdict: textOf(all.verdict),
    parameters: entriesOf(all.parameters).map(([name, each]) => ({
      name, unit: textOf(each.unit), estimate: valueOf(each.estimate), interval: valueOf(each.interval), truth: valueOf(each.truth),
      inside: typeof each.inside === "boolean" ? each.inside : null,
    })),
    validation: [...entriesOf(validation.signals).map(([name, each]) => signalText(name, each)), textOf(validation.problem)],
    notes: Array.isArray(all.notes) ? all.notes.slice(0, kMost).map(textOf) : [],
  };
}

function signalText(name: string, { rms_error: error, unit, normalised }: Fields): string {
  const share = valueOf(normalised);
  return `simulated again, ${name} differs by ${numberOf(valueOf(error))} ${textOf(unit)} rms${share === null ? "" : `, ${(100 * share).toPrecision(3)} % of it`}`;
}

function fieldsOf(value: unknown): Fields | null {
  return typeof value === "object" && value !== null && !Array.isArray(value) ? (value as Fields) : null;
}

function entriesOf(value: unknown): [string, Fields][] {
  return Object.entries(fieldsOf(value) ?? {}).slice(0, kMost).map(([name, each]) => [name, fieldsOf(each) ?? {}]);
}

function textOf(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function valueOf(value: unknown): number | null {
  return typeof value === "number" ? value : null;
}

/** `0.002000`; a dash for what is unknown. */
export function numberOf(value: number | null): string {
  return value === null ? "–" : value.toPrecision(4);
}

/** Whether the truth lies within the interval. */
export function isInside({ inside }: Parameter): string {
  if (inside === null) return "–";
  return inside ? "yes" : "no";
}
