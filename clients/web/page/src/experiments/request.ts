/** What an experiment asks of the bench, from the numbers of the page. */
import { pb } from "../wire";

/** Keys under which the bench takes a request once: one that was not answered keeps its key when it is made again, also in a new session. */
export class RequestKeys {
  private waiting: { text: string; key: string } | null = null;

  keyOf(request: pb.IRunExperiment): string {
    const text = JSON.stringify(request);
    if (this.waiting?.text !== text) this.waiting = { text, key: crypto.randomUUID() };
    return this.waiting.key;
  }

  /** The bench took the request or refused it. */
  answered(): void {
    this.waiting = null;
  }
}

export interface Field {
  name: string;
  label: string;
  value: string;
}

export type ShapeKind = "constant" | "ramp" | "sine" | "three_phase" | "chirp" | "prbs" | "multisine";
export type Values = Record<string, number>;

export const kInputs: [pb.InputKind, string][] = [
  [pb.InputKind.INPUT_KIND_NONE, "none: gates off"],
  [pb.InputKind.INPUT_KIND_SOURCE, "source: the line feeds the motor"],
  [pb.InputKind.INPUT_KIND_PHASE_VOLTAGES, "voltages of the terminals"],
  [pb.InputKind.INPUT_KIND_PHASE_CURRENTS, "currents of the terminals"],
  [pb.InputKind.INPUT_KIND_DQ_VOLTAGES, "dq voltages"],
];

export const kShapeNames: [ShapeKind, string][] = [["constant", "constant"], ["ramp", "ramp"], ["sine", "sine"], ["three_phase", "all phases: a rotating vector"],
  ["chirp", "chirp"], ["prbs", "PRBS: random steps"], ["multisine", "multisine"]];

/** The inputs that suit a drive, the usual one first. */
export function inputsOf(axis: pb.IAxisDescription): pb.InputKind[] {
  const { INPUT_KIND_NONE, INPUT_KIND_SOURCE, INPUT_KIND_PHASE_VOLTAGES, INPUT_KIND_PHASE_CURRENTS, INPUT_KIND_DQ_VOLTAGES } = pb.InputKind;
  if (axis.drive_kind === "source") return [INPUT_KIND_SOURCE];
  if (axis.shares_amplifier_with) return [INPUT_KIND_NONE];
  const rotates = axis.connection === "star" || axis.connection === "two_phase";
  return [INPUT_KIND_PHASE_VOLTAGES, ...(rotates ? [INPUT_KIND_DQ_VOLTAGES] : []),
    ...(axis.drive_kind === "current_amplifier" ? [INPUT_KIND_PHASE_CURRENTS] : []), INPUT_KIND_NONE];
}

/** The channels of an input by their names. */
export function channelsOf(input: pb.InputKind, axis: pb.IAxisDescription): [pb.Channel, string][] {
  const { CHANNEL_A, CHANNEL_B, CHANNEL_C, CHANNEL_F, CHANNEL_D, CHANNEL_Q } = pb.Channel;
  const all: [pb.Channel, string][] = input === pb.InputKind.INPUT_KIND_DQ_VOLTAGES ? [[CHANNEL_Q, "q"], [CHANNEL_D, "d"]]
    : ([[CHANNEL_A, "a"], [CHANNEL_B, "b"], [CHANNEL_C, "c"]] as [pb.Channel, string][]).slice(0, axis.phases as number);
  return axis.field_winding ? [...all, [CHANNEL_F, "f"]] : all;
}

export function takesShapes(input: pb.InputKind): boolean {
  return input !== pb.InputKind.INPUT_KIND_NONE && input !== pb.InputKind.INPUT_KIND_SOURCE;
}

/** The fields of a shape with their units. */
export function fieldsOfShape(kind: ShapeKind, input: pb.InputKind): Field[] {
  const unit = input === pb.InputKind.INPUT_KIND_PHASE_CURRENTS ? "A" : "V";
  const field = (name: string, label: string, value = "0"): Field => ({ name, label, value });
  const size = field("amplitude", `amplitude, ${unit}`, "1");
  return {
    constant: () => [field("value", `value, ${unit}`, "1")],
    ramp: () => [field("from", `from, ${unit}`), field("to", `to, ${unit}`, "1")],
    sine: () => [size, field("frequency_hz", "frequency, Hz", "10"), field("phase_rad", "phase, rad"), field("offset", `offset, ${unit}`)],
    three_phase: () => [size, field("frequency_hz", "frequency, Hz", "10"), field("phase_rad", "phase, rad"), field("rise_s", "rise of the amplitude, s")],
    chirp: () => [size, field("from_hz", "from, Hz", "1"), field("to_hz", "to, Hz", "100")],
    prbs: () => [size, field("order", "order, 3 to 20", "9"), field("bit_ticks", "ticks of a bit", "1"), field("seed", "position at the start")],
    multisine: () => [size, field("base_hz", "base frequency, Hz", "1"), field("harmonics", "number of harmonics, from the first on", "10")],
  }[kind]();
}

export function shapeOf(kind: ShapeKind, channel: pb.Channel, startS: number, endS: number, values: Values): pb.IShape {
  const time = { channel: kind === "three_phase" ? pb.Channel.CHANNEL_UNSPECIFIED : channel, start_s: startS, end_s: endS };
  if (kind !== "multisine") return { ...time, [kind]: values };
  const harmonics = Array.from({ length: Math.min(Math.max(Math.round(values.harmonics), 0), 1001) }, (_, i) => i + 1);
  return { ...time, multisine: { amplitude: values.amplitude, base_hz: values.base_hz, harmonics } };
}

/** What happens at a time: `load`, `bump`, `parameter:NAME` or `fault:NAME`. */
export function eventOf(what: string, atS: number, value: number, rampS: number): pb.IExperimentEvent {
  const time = { at_s: atS, ramp_s: rampS };
  if (what === "load") return { ...time, load_nm: value };
  if (what === "bump") return { ...time, bump_nms: value };
  const [kind, name] = what.split(":");
  return { ...time, [kind]: { name, value } };
}

/** The kind of a motor as `drivebench identify` names it; undefined: it knows no such machine. */
export function motorOf({ machine_kind: kind }: pb.IAxisDescription): string | undefined {
  return ({ induction: "im", pm_synchronous: "pm", pm_dc: "dc", bldc: "bldc" } as Record<string, string>)[kind as string];
}

/** How the program identifies the motor from the recording, which has all that it must know; empty: it knows no such machine. */
export function identification(axes: pb.IAxisDescription[], number: number, file: string): string {
  const axis = axes[number];
  const motor = motorOf(axis);
  return motor === undefined ? "" : `drivebench identify --motor ${motor} --from ${file}${axes.length > 1 ? ` --axis ${axis.name}` : ""}`;
}
