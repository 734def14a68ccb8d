/** A drawing of the drive train of an axis, with values of the newest status and a rotor that turns. */
import { drawing } from "./dom";
import { withUnit } from "./numbers";
import { pb } from "./wire";

/** A rotor that turned faster would seem to stand or to run backwards between two pictures. */
const kFastestDrawn_rad_s = 2 * Math.PI;

/** The amplitude of the terminals: of three the length of their space vector, of two of the vector, of one the value itself. */
export function amplitude(values: number[]): number {
  if (values.length === 1) return values[0];
  if (values.length === 2) return Math.hypot(values[0], values[1]);
  const mean = values.reduce((sum, each) => sum + each, 0) / values.length;
  return Math.sqrt((2 / values.length) * values.reduce((sum, each) => sum + (each - mean) ** 2, 0));
}

/** How fast the drawn rotor turns, and what the drawing says if that is slower than the rotor does. */
export function drawnSpeed(speed_rad_s: number): { speed_rad_s: number; note: string } {
  const times = Math.abs(speed_rad_s) / kFastestDrawn_rad_s;
  if (!(times > 1)) return { speed_rad_s, note: "" };
  return { speed_rad_s: speed_rad_s / times, note: `drawn ${times < 10 ? times.toFixed(1) : Math.round(times)} times slower` };
}

export class DriveTrain {
  readonly root: SVGElement;
  private readonly rotor = drawing("g", { class: "rotor" },
    drawing("circle", { r: 17 }), drawing("path", { d: "M0 0 V-17" }), drawing("circle", { r: 3, class: "mark", cy: -12 }));
  private readonly bus = drawing("g", { class: "bus-part" });
  private readonly texts = new Map<string, SVGElement>();
  private angle_rad = 0;
  private speed_rad_s = 0;

  constructor(private readonly axis: pb.IAxisDescription) {
    const kind = (words: string) => words.replaceAll("_", " ");
    const box = (x: number, width: number, title: string) => [
      drawing("rect", { x, y: 22, width, height: 56, rx: 5 }),
      drawing("text", { x: x + width / 2, y: 14, class: "title" }, title),
    ];
    this.root = drawing("svg", { viewBox: "0 0 420 130", class: "train", role: "img", "aria-label": `drive train of axis ${axis.name}` },
      this.bus, drawing("path", { d: "M214 50 H242 M300 50 H344" }),
      ...box(112, 102, kind(axis.drive_kind as string)), this.text("voltage", 163, 46), this.text("current", 163, 64),
      drawing("text", { x: 271, y: 14, class: "title" }, kind(axis.machine_kind as string)),
      drawing("circle", { cx: 271, cy: 50, r: 29 }), drawing("g", { transform: "translate(271 50)" }, this.rotor),
      this.text("torque", 271, 94), this.text("speed", 271, 109), this.text("note", 271, 124),
      ...box(344, 72, "load"), this.text("load", 380, 54));
    this.bus.append(drawing("path", { d: "M86 50 H112" }), ...box(4, 82, "DC bus"), this.text("bus", 45, 54));
  }

  /** `pace`: seconds of the bench for each second of the clock; 0 while time stands still. */
  draw(sample: pb.Sample, pace: number): void {
    const value = (name: string) => (sample as unknown as Record<string, number>)[name];
    const terminals = ["a", "b", "c"].slice(0, this.axis.phases ?? 3);
    const bus_v = value("bus_voltage_v");
    this.bus.setAttribute("visibility", bus_v > 0 ? "visible" : "hidden"); // a drive from the line has none
    this.show("bus", withUnit(bus_v, "V"));
    this.show("voltage", `u ${withUnit(amplitude(terminals.map((each) => value(`u_${each}_v`))), "V")}`);
    this.show("current", `i ${withUnit(amplitude(terminals.map((each) => value(`i_${each}_a`))), "A")}`);
    this.show("torque", withUnit(value("torque_nm"), "N*m"));
    this.show("load", withUnit(value("load_nm"), "N*m"));
    this.show("speed", withUnit(value("speed_rad_s"), "rad/s"));
    const speed = value("speed_rad_s") * pace; // a recording may lack it
    const drawn = drawnSpeed(Number.isFinite(speed) ? speed : 0);
    this.show("note", drawn.note);
    this.speed_rad_s = drawn.speed_rad_s;
    if (this.speed_rad_s === 0) this.turnTo(value("angle_rad"));
  }

  /** Turns the rotor by what it does in this time. */
  turn(seconds: number): void {
    if (this.speed_rad_s !== 0) this.turnTo(this.angle_rad + this.speed_rad_s * seconds);
  }

  private turnTo(angle_rad: number): void {
    if (!Number.isFinite(angle_rad)) return;
    this.angle_rad = angle_rad % (2 * Math.PI);
    this.rotor.setAttribute("transform", `rotate(${((-this.angle_rad * 180) / Math.PI).toFixed(1)})`); // counterclockwise
  }

  private text(name: string, x: number, y: number): SVGElement {
    const made = drawing("text", { x, y, class: name });
    this.texts.set(name, made);
    return made;
  }

  private show(name: string, text: string): void {
    const node = this.texts.get(name) as SVGElement;
    if (node.textContent !== text) node.textContent = text;
  }
}
