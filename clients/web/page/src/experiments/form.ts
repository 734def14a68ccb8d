/** A form that asks for an experiment. The server judges the request. */
import { Bench, usualPanes } from "../bench";
import { button, choice, element, setText } from "../dom";
import { plain } from "../numbers";
import { pb } from "../wire";
import { channelsOf, eventOf, fieldsOfShape, inputsOf, kInputs, kShapeNames, ShapeKind, shapeOf, takesShapes, Values } from "./request";
import { input, NotANumber, numberOf, RowList } from "./rows";

const kDefaultS = "1";

export class ExperimentForm {
  readonly root: HTMLElement;
  private readonly label = element("input", { "aria-label": "title of the experiment", maxlength: 100, size: 24 });
  private readonly axis: HTMLSelectElement;
  private readonly pace = choice("pace of the experiment", [[String(pb.Mode.MODE_FREE), "as fast as possible"], [String(pb.Mode.MODE_REALTIME), "in real time"]], () => undefined);
  private readonly length = input("length of the experiment, s", kDefaultS);
  private readonly decimation = input("every how many ticks a row of data", "1", 4);
  private readonly shared = element("input", { type: "checkbox" });
  private readonly chips = element("div", { class: "chips" });
  private readonly addSignal = element("select", { "aria-label": "add a signal to the data", change: () => this.chooseSignal() });
  private readonly inputKind = choice("input of the experiment", [], () => this.inputChanged());
  private readonly angle = choice("angle of the transform", [[String(pb.AngleSource.ANGLE_SOURCE_TRUE), "true angle"], [String(pb.AngleSource.ANGLE_SOURCE_MEASURED), "measured angle"]], () => undefined);
  private readonly emf = input("back EMF added to u_q, V*s", "0");
  private readonly dq = element("div", { class: "bar" }, "Angle", this.angle, "back EMF", this.emf, "V·s");
  private readonly shapes = new RowList<pb.IShape>("Shapes of the input", "shape", (number) => this.shapeRow(number));
  private readonly settings = new RowList<pb.INamedValue>("Parameters of the experiment", "parameter", (number) => this.settingRow(number));
  private readonly events = new RowList<pb.IExperimentEvent>("Events", "event", (number) => this.eventRow(number));
  private readonly speed = input("speed at the start, rad/s", "0");
  private readonly limits = { current_a: input("stop above this current, A; 0: no limit", "0"), speed_rad_s: input("stop above this speed, rad/s; 0: no limit", "0"),
    angle_rad: input("stop beyond this angle, rad; 0: no limit", "0") };
  private readonly submit = element("button", { type: "submit" }, "Queue the experiment");
  private signals: string[] = [];

  /** `queue` gets the request without what belongs to the user, and ends with its answer; `tell` a sentence about a wrong field. */
  constructor(private readonly bench: Bench, private readonly queue: (request: pb.IRunExperiment) => Promise<void>, tell: (sentence: string) => void) {
    this.axis = choice("axis of the experiment", bench.description.axes.map((axis, number) => [String(number), axis.name as string]), () => this.axisChanged());
    const row = (...nodes: (Node | string)[]) => element("div", { class: "bar" }, ...nodes);
    this.root = element("form", { class: "experiment", submit: (event) => {
      event.preventDefault();
      try {
        void this.ask(this.request());
      } catch (problem) {
        if (!(problem instanceof NotANumber)) throw problem;
        tell(problem.message);
      }
    } },
    row("Title", this.label, "axis", this.axis, "for", this.length, "s", this.pace, element("label", {}, this.shared, " every client may read it")),
    row("Data: every", this.decimation, "ticks of", this.chips, this.addSignal),
    row("Input", this.inputKind), this.dq, this.shapes.root,
    element("h3", {}, "Other than the bench"), row("Speed at the start", this.speed, "rad/s"), this.settings.root,
    element("h3", {}, "Events"), this.events.root,
    element("h3", {}, "Limits, whose first breach ends it (0: none)"),
    row("current", this.limits.current_a, "A, speed", this.limits.speed_rad_s, "rad/s, angle", this.limits.angle_rad, "rad"),
    row(this.submit));
    this.addSignal.append(element("option", { value: "" }, "+ signal"), ...bench.description.signals.map((signal) =>
      element("option", { value: signal.name as string, title: signal.meaning as string }, `${signal.name} [${signal.unit}]`)));
    this.axisChanged();
  }

  /** One request at a time. */
  private async ask(request: pb.IRunExperiment): Promise<void> {
    const hasFocus = document.activeElement === this.submit;
    this.submit.disabled = true;
    await this.queue(request);
    this.submit.disabled = false;
    if (hasFocus && (document.activeElement === null || document.activeElement === document.body)) this.submit.focus();
  }

  private get axisOf(): pb.IAxisDescription {
    return this.bench.description.axes[Number(this.axis.value)];
  }

  private get input(): pb.InputKind {
    return Number(this.inputKind.value);
  }

  /** Another axis has other terminals and parameters. */
  private axisChanged(): void {
    this.signals = [...usualPanes(this.axisOf).flat(), "angle_rad", "encoder_count"];
    this.showSignals();
    const inputs = inputsOf(this.axisOf);
    this.inputKind.replaceChildren(...inputs.map((each) =>
      element("option", { value: String(each) }, (kInputs.find(([kind]) => kind === each) as [pb.InputKind, string])[1])));
    this.settings.clear();
    this.inputChanged();
  }

  private inputChanged(): void {
    this.dq.hidden = this.input !== pb.InputKind.INPUT_KIND_DQ_VOLTAGES;
    this.shapes.root.hidden = !takesShapes(this.input);
    this.shapes.clear();
    if (takesShapes(this.input)) this.shapes.add();
  }

  private showSignals(): void {
    this.chips.replaceChildren(...this.signals.map((name) => element("span", { class: "chip" }, name, button("×", () => {
      this.signals = this.signals.filter((each) => each !== name);
      this.showSignals();
      this.addSignal.focus();
    }, { class: "small", "aria-label": `leave ${name} out of the data` }))));
  }

  private chooseSignal(): void {
    const name = this.addSignal.value;
    this.addSignal.value = "";
    if (name !== "" && !this.signals.includes(name)) this.signals.push(name);
    this.showSignals();
  }

  private shapeRow(number: number) {
    const of = (words: string) => `${words} (shape ${number})`;
    const channel = choice(of("channel"), channelsOf(this.input, this.axisOf).map(([value, name]) => [String(value), name]), () => undefined);
    const place = element("span", { class: "bar" });
    const [start, end] = [input(of("start, s"), "0", 5), input(of("end, s; 0: that of the experiment"), "0", 5)];
    let fields: [string, HTMLInputElement][] = [];
    const isDq = this.input === pb.InputKind.INPUT_KIND_DQ_VOLTAGES;
    const kinds = kShapeNames.filter(([kind]) => kind !== "three_phase" || (!isDq && (this.axisOf.phases as number) > 1));
    const kind = choice(of("kind"), kinds, () => show());
    const show = () => {
      channel.hidden = kind.value === "three_phase";
      fields = fieldsOfShape(kind.value as ShapeKind, this.input).map(({ name, label, value }) => [name, input(of(label), value)]);
      place.replaceChildren(...fields.flatMap(([, field]) => [(field.getAttribute("aria-label") as string).replace(/ \(shape \d+\)/, ""), field]));
    };
    if (!isDq && kinds.some(([each]) => each === "three_phase")) kind.value = "three_phase";
    show();
    const read = () => {
      const values: Values = {};
      for (const [name, field] of fields) values[name] = numberOf(field);
      return shapeOf(kind.value as ShapeKind, Number(channel.value), numberOf(start), numberOf(end), values);
    };
    return { nodes: [channel, kind, place, "from", start, "s to", end, "s"], read };
  }

  private settingRow(number: number) {
    const parameters = this.axisOf.parameters ?? [];
    const value = input(`value of parameter ${number}`, "", 9);
    const range = element("span", { class: "soft" });
    const name = choice(`parameter ${number}`, parameters.map((each) => [each.name as string, each.name as string]), () => show());
    const show = () => {
      const { value: now, minimum, maximum, unit, words, meaning } = parameters.find((each) => each.name === name.value) as pb.ParameterDescription;
      value.value = plain(now as number);
      name.title = meaning as string;
      setText(range, words.length > 0 ? words.map((each, i) => `${i}: ${each}`).join(", ")
        : `${plain(minimum as number)} to ${plain(maximum as number)}${unit === "1" ? "" : ` ${unit}`}`);
    };
    if (parameters.length > 0) show();
    return { nodes: [name, value, range], read: () => ({ name: name.value, value: numberOf(value) }) };
  }

  private eventRow(number: number) {
    const [at, value, ramp] = [input(`time of event ${number}, s`, "0.5", 5), input(`value of event ${number}`, "0"), input(`ramp of event ${number}, s`, "0", 5)];
    const unit = element("span", { class: "soft" });
    const live = (this.axisOf.parameters ?? []).filter((each) => each.live);
    const faults = this.bench.description.injectable_faults;
    const units = new Map([["load", "N*m"], ["bump", "N*m*s"], ...live.map((each): [string, string] => [`parameter:${each.name}`, each.unit as string]),
      ...faults.map((each): [string, string] => [`fault:${each.name}`, each.unit as string])]);
    const what = choice(`event ${number}`, [...units.keys()].map((each) => [each, each.replace(":", " ")]), () => show());
    const show = () => setText(unit, units.get(what.value) === "1" ? "" : units.get(what.value) as string);
    show();
    return { nodes: ["at", at, "s", what, "to", value, unit, "in", ramp, "s"], read: () => eventOf(what.value, numberOf(at), numberOf(value), numberOf(ramp)) };
  }

  private request(): pb.IRunExperiment {
    const { current_a: current, speed_rad_s: speed, angle_rad: angle } = this.limits;
    const isDq = this.input === pb.InputKind.INPUT_KIND_DQ_VOLTAGES;
    return {
      label: this.label.value, shared: this.shared.checked, mode: Number(this.pace.value), axis: Number(this.axis.value),
      duration_s: numberOf(this.length), decimation: Math.max(Math.round(numberOf(this.decimation)), 0), signals: this.signals,
      settings: this.settings.read(), initial: { speed_rad_s: numberOf(this.speed) },
      input: { kind: this.input, ...(isDq ? { angle: Number(this.angle.value), back_emf_vs: numberOf(this.emf) } : {}),
        shapes: takesShapes(this.input) ? this.shapes.read() : [] },
      events: this.events.read(),
      stop: { current_a: numberOf(current), speed_rad_s: numberOf(speed), angle_rad: numberOf(angle) },
    };
  }
}
