/** What the page asks of an axis that it drives. */
import { pb } from "./wire";

export type Gates = "off" | "voltage" | "current" | "duty";
export type Wave = "rotating" | "standing" | "terminals";

/** An axis of the gateway's order; clients/web/gateway/drive/orders.hpp has its meaning. */
export interface Target {
  axis: number;
  gates: Gates;
  constant: [number, number, number, number];
  boost: number;
  per_hz: number;
  frequency_hz: number;
  ramp_s: number;
}

/** An axis that the reference controller of a preset drives; another number is another run. */
export interface PresetTarget {
  axis: number;
  preset: string;
  run: number;
}

export interface Field {
  name: string;
  label: string;
  value: string;
}

const kUnits: Record<Gates, string> = { off: "", voltage: "V", current: "A", duty: "" };

export function unitOf(gates: Gates): string {
  return kUnits[gates];
}

/** The gates that suit a drive; a source takes no commands. */
export function gatesOf(axis: pb.IAxisDescription): Gates[] {
  if (axis.drive_kind === "source" || axis.shares_amplifier_with) return [];
  return axis.drive_kind === "current_amplifier" ? ["current", "voltage", "duty"] : ["voltage", "duty"];
}

/** The waves that suit the terminals, the usual one first. */
export function wavesOf(axis: pb.IAxisDescription): Wave[] {
  if (axis.connection === "star" || axis.connection === "two_phase") return ["rotating", "standing", "terminals"];
  return (axis.phases as number) > 1 ? ["rotating", "terminals"] : ["terminals"];
}

/** The fields of a wave with their units. */
export function fieldsOf(wave: Wave, gates: Gates, axis: pb.IAxisDescription): Field[] {
  const unit = unitOf(gates) === "" ? "" : `, ${unitOf(gates)}`;
  const field = (name: string, label: string, value = "0") => ({ name, label, value });
  const fields = {
    rotating: () => [field("frequency", "target frequency, Hz", "5"), field("amplitude", `amplitude at the target${unit}`),
      field("boost", `boost: amplitude at standstill${unit}`)],
    standing: () => [field("alpha", `alpha${unit}`), field("beta", `beta${unit}`)],
    terminals: () => ["a", "b", "c"].slice(0, axis.phases as number).map((each) => field(each, `terminal ${each}${unit}`, String(middleOf(gates, axis)))),
  }[wave]();
  if (axis.field_winding) fields.push(field("f", `field winding${unit}`));
  return [...fields, field("ramp", "ramp, s", "1")];
}

/** The duty of a leg of a star that gives no voltage. */
function middleOf(gates: Gates, axis: pb.IAxisDescription): number {
  return gates === "duty" && axis.connection === "star" ? 0.5 : 0;
}

/** Power-invariant, as everywhere: a vector of length 1 is an amplitude of sqrt(2/3) in a star. */
function terminalsOf(alpha: number, beta: number, axis: pb.IAxisDescription): [number, number, number] {
  if (axis.connection === "two_phase") return [alpha, beta, 0];
  const [along, across] = [Math.sqrt(2 / 3) * alpha, Math.sqrt(1 / 2) * beta];
  return [along, across - along / 2, -across - along / 2];
}

/** The order for these numbers of the fields. */
export function targetOf(number: number, axis: pb.IAxisDescription, wave: Wave, gates: Gates, values: Record<string, number>): Target {
  const { frequency = 0, amplitude = 0, boost = 0, alpha = 0, beta = 0, f = 0, ramp = 0 } = values;
  const middle = middleOf(gates, axis);
  const [a, b, c] = wave === "terminals" ? [values.a ?? 0, values.b ?? 0, values.c ?? 0]
    : terminalsOf(alpha, beta, axis).map((each) => each + middle);
  const perHz = frequency === 0 ? 0 : (amplitude - boost) / Math.abs(frequency);
  return { axis: number, gates, constant: [a, b, c, f], boost, per_hz: perHz, frequency_hz: frequency, ramp_s: ramp };
}

export function switchedOff(axis: number): Target {
  return { axis, gates: "off", constant: [0, 0, 0, 0], boost: 0, per_hz: 0, frequency_hz: 0, ramp_s: 0 };
}
