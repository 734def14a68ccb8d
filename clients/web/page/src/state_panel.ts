/** The state of the bench and of each axis. */
import { Bench, kStates, namesOfBits } from "./bench";
import { element } from "./dom";
import { DriveTrain } from "./drive_train";
import { Facts } from "./facts";
import { Latenesses } from "./latenesses";
import { plain, withUnit } from "./numbers";
import { Transports } from "./transports";
import { verdictOf } from "./verdict";
import { pb } from "./wire";

export class StatePanel {
  private readonly bench = new Facts();
  private readonly axes: Facts[];
  private readonly trains: DriveTrain[];
  private readonly stillness = matchMedia("(prefers-reduced-motion: reduce)");
  private drawn: { tick: number; at_ms: number } | null = null;
  private turned_ms = performance.now();
  private ended = false;
  private readonly notes = element("ul", { class: "notes" });
  private readonly transports = new Transports();
  private readonly latenesses = new Latenesses();

  constructor(root: HTMLElement, private readonly of: Bench, private readonly ownerOf: (axis: number) => number) {
    this.axes = of.description.axes.map(() => new Facts());
    this.trains = of.description.axes.map((axis) => new DriveTrain(axis));
    root.replaceChildren(element("h2", {}, "Bench"), this.bench.root, ...(of.isRealtime ? [this.latenesses.root] : []), this.transports.root, this.notes, ...this.axes.flatMap((facts, axis) => {
      const { name, machine, machine_kind: kind } = of.description.axes[axis];
      return [element("h2", {}, `Axis ${axis}: ${name}`), element("p", { class: "soft" }, `${machine}, ${kind}`), this.trains[axis].root, facts.root];
    }));
    this.turn();
  }

  end(): void {
    this.ended = true;
  }

  draw(status: pb.Status): void {
    const tick = status.tick as number;
    const pace = this.pace(tick);
    this.bench.set("tick", String(tick));
    this.bench.set("time", `${(tick * (this.of.description.period_s as number)).toFixed(3)} s`);
    if (status.mode === pb.Mode.MODE_REALTIME) {
      const late = status.late_ticks as number;
      this.bench.set("late ticks", late === 0 ? "none" : `${late}, worst ${withUnit(status.worst_lateness_s as number, "s")}`, late > 0 ? "warn" : "");
      this.latenesses.draw(status.lateness_counts as number[], this.of.description.period_s as number);
    }
    const verdict = verdictOf(status);
    this.bench.set("verdict", verdict.text, verdict.isGood ? "" : "warn");
    const hash = status.state_hash as number | bigint;
    if (this.of.isLockstep) this.bench.set("state hash", hash.toString(16).padStart(16, "0"), "mono");
    this.bench.set("sessions", String(status.sessions));
    this.bench.set("memory", `${((status.resident_bytes as number) / 2 ** 20).toFixed(0)} MiB`);
    this.bench.set("recording", recordingText(status), (status.recording_gaps as number) > 0 ? "warn" : "");
    this.transports.draw(status.transports);
    this.showNotes(status);
    for (const each of status.axes) {
      this.drawAxis(each.axis as number, each.sample as pb.Sample);
      this.trains[each.axis as number].draw(each.sample as pb.Sample, this.stillness.matches ? 0 : pace);
    }
  }

  /** Seconds of the bench for each second of the clock since the status before. */
  private pace(tick: number): number {
    const before = this.drawn;
    this.drawn = { tick, at_ms: performance.now() };
    if (before === null || tick < before.tick || this.drawn.at_ms === before.at_ms) return 0;
    return ((tick - before.tick) * (this.of.description.period_s as number)) / (1e-3 * (this.drawn.at_ms - before.at_ms));
  }

  /** Turns the rotors once for each picture of the browser. */
  private turn(): void {
    if (this.ended) return;
    const now_ms = performance.now();
    for (const train of this.trains) train.turn(1e-3 * (now_ms - this.turned_ms));
    this.turned_ms = now_ms;
    requestAnimationFrame(() => this.turn());
  }

  private drawAxis(axis: number, sample: pb.Sample): void {
    const { faults, injectable_faults: injectable } = this.of.description;
    const facts = this.axes[axis];
    const state = kStates[sample.state as number] ?? "unknown";
    facts.set("state", state, state === "fault" || state === "timeout" ? "bad" : state === "run" ? "good" : "");
    facts.set("controller", ownerText(sample.owner as number, this.ownerOf(axis)));
    const present = namesOfBits(faults, sample.faults as number);
    const latched = namesOfBits(faults.filter((each) => each.latched), sample.faults as number);
    facts.set("faults", present.map((each) => (latched.includes(each) ? `${each} (latched)` : each)).join(", ") || "none",
      present.length > 0 ? "bad" : "");
    facts.set("injected", namesOfBits(injectable, sample.injected as number).join(", ") || "none",
      sample.injected !== 0 ? "warn" : "");
    facts.set("speed", withUnit(sample.speed_rad_s as number, "rad/s"));
    facts.set("load", withUnit(sample.load_nm as number, "N*m"));
    facts.set("encoder", `${plain(sample.encoder_count as number)} counts`);
    facts.set("commands", `${sample.missed_commands} missed, ${sample.refused_commands} refused`);
  }

  private showNotes(status: pb.Status): void {
    const notes = [...status.notes];
    if (this.of.isLockstep && status.axes.every((each) => each.sample?.owner === 0)) {
      notes.push("lockstep: time stands still until a controller drives the bench: `drivebench control` for example, or Drive below");
    }
    if (this.notes.textContent !== notes.join("")) this.notes.replaceChildren(...notes.map((each) => element("li", {}, each)));
  }
}

function ownerText(owner: number, own: number): string {
  if (owner === 0) return "none";
  return owner === own ? "this page" : `session ${owner}`;
}

function recordingText(status: pb.Status): string {
  if (!status.recording) return "none";
  const file = (status.recording as string).split("/").pop() as string;
  const gaps = status.recording_gaps as number;
  return `${file}${gaps > 0 ? `, ${gaps} gaps` : ""}${status.recording_over ? ", ended" : ""}`;
}
