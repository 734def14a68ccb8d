/** The scope: panes, time base, trigger, cursors and measurements. */
import { signalOf, Source } from "./bench";
import { Captured, withCapture } from "./capture";
import { button, choice, element, SavedFile, saveButton, setText } from "./dom";
import { csvOf, kColumns, svgOf } from "./exports";
import { mcapOf } from "./mcap_export";
import { MeasurementTable } from "./measurement_table";
import { Pane } from "./pane";
import { Trigger } from "./trigger";
import { TriggerBar } from "./trigger_bar";
import { betweenCursors, frozen, part, rollingView, View, viewOf } from "./view";
import { pb } from "./wire";

const kWindows_s = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 30];
const kFrameMs = 15;
/** Drawing takes at most a third of the time, so that a slow computer still reads its samples and obeys its user. */
const kDrawShare = 3;
const kTableMs = 200;
const kAutoMs = 500;

/** Of the bench, or of something that is played: without trigger, and its pause is the player's. */
export class Scope {
  private readonly panes: Pane[] = [];
  private readonly place = element("div", { class: "panes", tabindex: 0, role: "group",
    "aria-label": "Plots. Space pauses; a and b choose a cursor, the arrows move it, Escape removes cursors and zoom." });
  private readonly trigger: Trigger;
  private readonly bar: TriggerBar;
  private readonly table: MeasurementTable;
  private readonly pauseButton = button("Pause", () => this.togglePause());
  private readonly time: HTMLSelectElement;
  private readonly note = element("span", { class: "note" });
  private windowS = 2;
  private held: View | null = null; // by pause or trigger
  private zoom: [number, number] | null = null;
  private isPaused = false;
  private cursors: (number | null)[] = [null, null]; // ticks
  private active = 0;
  private isDirty = true;
  private nextDraw = 0;
  private isTableDirty = true;
  private nextTable = 0;
  private autoShown = 0;
  private isOver = false;

  /** `subscribe` is called when other signals are needed. */
  constructor(root: HTMLElement, private readonly source: Source, panes: string[][], private readonly subscribe: () => void,
    private readonly played?: { lengthS: number; axis: number; togglePause(): void }) {
    this.trigger = new Trigger(source.wire, () => { this.isDirty = true; });
    this.bar = new TriggerBar(source, this.trigger, () => this.arm());
    this.table = new MeasurementTable(source);
    const windows = kWindows_s.filter((each) => played === undefined || each < played.lengthS)
      .map((each): [string, string] => [String(each), each < 1 ? `${each * 1000} ms` : `${each} s`]);
    if (played !== undefined) {
      this.windowS = played.lengthS;
      windows.unshift([String(played.lengthS), "all"]);
    }
    this.time = choice(played === undefined ? "window" : "window of the player", windows, (value) => this.setWindow(Number(value)));
    this.time.value = String(this.windowS);
    root.replaceChildren(element("div", { class: "bar" }, "Window", this.time, ...(played === undefined ? [this.pauseButton] : []),
      button("Add pane", () => this.addPane([])), saveButton("CSV", () => this.csv()), saveButton("SVG", () => this.svg()), saveButton("MCAP", () => this.mcap()),
      this.note), ...(played === undefined ? [this.bar.root] : []), this.place, this.table.root);
    for (const signals of panes) this.addPane(signals, played?.axis);
    this.place.addEventListener("keydown", (event) => this.key(event));
    this.frame();
  }

  /** Ends the drawing and gives the plots back, for a page that gets another bench or a player that closes. */
  end(): void {
    this.isOver = true;
    for (const pane of this.panes) pane.end();
  }

  signalsOf(axis: number): Set<string> {
    const signals = new Set(["tick", "state", "faults", "injected"]);
    for (const pane of this.panes) {
      for (const channel of pane.channels) if (channel.axis === axis) signals.add(channel.signal);
    }
    const trigger = this.bar.signalOf(axis);
    if (trigger !== null) signals.add(trigger);
    return signals;
  }

  /** Something that is played stands at another tick. */
  moved(): void {
    this.isDirty = true;
  }

  /** New samples have come. */
  see(): void {
    this.isDirty ||= this.held === null || this.trigger.isArmed;
  }

  triggered(triggered: pb.Triggered): void {
    this.trigger.take(triggered);
  }

  /** Draws in the colours of another theme. */
  recolour(): void {
    for (const pane of this.panes) pane.rebuild();
    this.isDirty = true;
  }

  private get periodS(): number {
    return this.source.description.period_s as number;
  }

  private get windowTicks(): number {
    return Math.max(this.windowS / this.periodS, 2);
  }

  private addPane(signals: string[], axis = 0): void {
    const pane = new Pane(this.source, signals.map((signal) => ({ axis, signal })), this.played === undefined ? "bench" : "player", {
      changed: () => this.channelsChanged(),
      removed: (gone) => {
        this.panes.splice(this.panes.indexOf(gone), 1);
        gone.end();
        this.channelsChanged();
      },
      clicked: (time) => this.putCursor(time),
      selected: (from, to) => this.zoomTo(from, to),
    });
    this.panes.push(pane);
    this.place.append(pane.root);
    this.channelsChanged();
  }

  private channelsChanged(): void {
    this.isDirty = true;
    this.nextTable = 0;
    this.subscribe();
    if (this.trigger.isArmed) this.armTrigger();
  }

  private setWindow(windowS: number): void {
    this.windowS = windowS;
    this.zoom = null;
    if (!this.isPaused) this.held = null;
    if (this.trigger.isArmed) this.armTrigger();
    this.isDirty = true;
  }

  private armTrigger(): void {
    this.trigger.arm(this.panes.flatMap((pane) => pane.channels).filter((each, i, all) =>
      all.findIndex(({ axis, signal }) => axis === each.axis && signal === each.signal) === i), this.windowTicks);
  }

  private arm(): void {
    this.armTrigger();
    this.held = null;
    this.zoom = null;
    this.isPaused = false;
    this.autoShown = performance.now();
    setText(this.pauseButton, "Pause");
    this.subscribe();
    this.isDirty = true;
  }

  private togglePause(): void {
    if (this.played !== undefined) return this.played.togglePause();
    this.isPaused = !this.isPaused;
    setText(this.pauseButton, this.isPaused ? "Run" : "Pause");
    if (this.isPaused) {
      this.held ??= frozen(rollingView(this.source, this.windowTicks));
      this.trigger.end();
    } else {
      this.held = null;
      this.zoom = null;
      this.armTrigger();
    }
    this.isDirty = true;
  }

  private frame(): void {
    if (this.isOver) return;
    requestAnimationFrame(() => this.frame());
    const now = performance.now();
    if (this.isDirty && now > this.nextDraw) {
      this.isDirty = false;
      this.sweep();
      const view = this.view();
      for (const pane of this.panes) if (pane.kind !== "spectrum") pane.draw(view, this.cursors);
      this.isTableDirty = true;
      this.nextDraw = now + Math.max(kFrameMs, kDrawShare * (performance.now() - now));
    }
    if (this.isTableDirty && now > this.nextTable) {
      this.isTableDirty = false;
      const view = this.view();
      this.table.draw(this.panes, view, this.cursors);
      const window = betweenCursors(view, this.cursors);
      for (const pane of this.panes) if (pane.kind === "spectrum") pane.draw(window, this.cursors);
      this.nextTable = now + Math.max(kTableMs, kDrawShare * (performance.now() - now));
      setText(this.note, this.source.dropped === 0 ? "" : `${this.source.dropped} samples lost: the browser reads too slowly`);
    }
  }

  private view(): View {
    const view = this.held ?? rollingView(this.source, this.windowTicks);
    return this.zoom === null ? view : part(view, ...this.zoom);
  }

  /** Shows the window of an event as it fills, and then as the server has kept it. */
  private sweep(): void {
    const { settings, firedTick, captured, problem } = this.trigger;
    if (settings.condition === "off" || this.isPaused) {
      this.bar.show(settings.condition === "off" ? "off" : "paused");
    } else if (problem !== "") {
      this.bar.show(problem);
    } else if (captured !== null) {
      this.trigger.captured = null;
      this.hold(captured.tick, captured);
    } else if (firedTick !== null) {
      this.hold(firedTick, null);
    } else if (this.trigger.isArmed) {
      this.bar.show(this.trigger.holdsOff(this.source.histories[settings.axis].lastTick) ? "hold-off" : "armed");
      if (settings.sweep === "auto" && performance.now() - this.autoShown > kAutoMs) this.held = null;
      else if (this.held === null && settings.sweep !== "auto") this.held = frozen(viewOf(this.source, 0, -1, 0));
    }
  }

  private hold(tick: number, captured: Captured | null): void {
    const from = tick - this.trigger.settings.before * this.windowTicks;
    const view = viewOf(this.source, from, from + this.windowTicks, tick);
    this.held = captured === null ? frozen(view) : withCapture(frozen(view), captured);
    this.autoShown = performance.now();
    this.bar.show(`triggered at tick ${tick}`);
    this.bar.showLoss(this.trigger.missedEvents, this.trigger.lostTicks);
  }

  private ticksAt(time: number): number {
    return Math.round(time / this.periodS) + this.view().origin;
  }

  private putCursor(time: number): void {
    this.cursors[this.active] = this.ticksAt(time);
    this.active = 1 - this.active;
    this.nextTable = 0;
    this.isDirty = true;
  }

  private zoomTo(fromTime: number, toTime: number): void {
    if (this.held === null && this.played === undefined) this.togglePause();
    const [from, to] = [this.ticksAt(fromTime), this.ticksAt(toTime)];
    if (to - from >= 2) this.zoom = [from, to];
    this.isDirty = true;
  }

  private key(event: KeyboardEvent): void {
    if (event.target !== this.place) return;
    const view = this.view();
    const step = event.shiftKey ? 1 : (view.to - view.from) / 100;
    const moved = (sign: number) => {
      this.cursors[this.active] = Math.round((this.cursors[this.active] ?? (view.from + view.to) / 2) + sign * step);
    };
    if (event.key === " ") this.togglePause();
    else if (event.key === "a" || event.key === "b") this.active = event.key === "a" ? 0 : 1;
    else if (event.key === "ArrowLeft") moved(-1);
    else if (event.key === "ArrowRight") moved(1);
    else if (event.key === "Escape") [this.cursors, this.zoom] = [[null, null], null];
    else return;
    event.preventDefault();
    this.nextTable = 0;
    this.isDirty = true;
  }

  private csv(): SavedFile {
    const channels = this.panes.flatMap((pane) => pane.channels.map((each) => ({
      ...each, title: `${pane.nameOf(each)} [${signalOf(this.source, each.signal).unit}]` })));
    const view = this.played === undefined ? frozen(this.view()) : this.view(); // the bench goes on
    return { name: `${this.source.description.name}.csv`, type: "text/csv", content: () => csvOf(channels, view, this.periodS) };
  }

  private mcap(): SavedFile {
    const channels = this.panes.flatMap((pane) => pane.channels);
    const view = this.played === undefined ? frozen(this.view()) : this.view();
    return { name: `${this.source.description.name}.mcap`, type: "application/octet-stream",
      content: () => mcapOf(this.source, channels, view) };
  }

  private svg(): SavedFile {
    const view = this.view();
    const window = betweenCursors(view, this.cursors);
    const panes = this.panes.map((pane) => {
      const { x, lines } = pane.curvesOf(pane.kind === "spectrum" ? window : view, kColumns);
      return { x, labels: pane.labels, logarithmic: pane.logarithms, lines: lines.map((each) => ({ ...each, title: pane.nameOf(each.channel), colour: pane.colourOf(each.channel) })) };
    });
    return { name: `${this.source.description.name}.svg`, type: "image/svg+xml", content: () => Promise.resolve([svgOf(panes)]) };
  }
}
