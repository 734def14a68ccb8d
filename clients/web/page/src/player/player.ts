/** Plays samples that stay: a slider of time, pause, speed; the scope and the drawings of the drive trains follow. */
import { usualPanes } from "../bench";
import { button, choice, element, SavedFile, saveButton, setText } from "../dom";
import { DriveTrain } from "../drive_train";
import { Facts } from "../facts";
import { withUnit } from "../numbers";
import { Scope } from "../scope";
import { pb } from "../wire";
import { Recorded } from "./recorded";

const kSpeeds = [0.001, 0.01, 0.1, 0.3, 1, 3, 10];
const kDrawMs = 100;
const kMostPanes = 6;

export interface Played {
  title: string;
  recorded: Recorded;
  /** The axis whose signals it shows first. */
  axis: number;
  /** What is told beside the samples. */
  facts: [string, string][];
  /** The file that Save offers. */
  file: SavedFile;
}

class Player {
  private readonly scope: Scope;
  private readonly trains: DriveTrain[];
  private readonly slider: HTMLInputElement;
  private readonly time = element("output", { "aria-label": "time of the player", "aria-live": "off", class: "value" });
  private readonly playButton = button("Play", () => this.toggle());
  private readonly periodS: number;
  private readonly firstTick: number;
  private readonly endTick: number;
  private position: number;
  private speed = 1;
  private isPlaying = false;
  private isOver = false;
  private turnedMs = performance.now();
  private drawnMs = 0;

  constructor(root: HTMLElement, private readonly played: Played, closed: () => void) {
    const { title, recorded, axis, facts, file } = played;
    const { histories, description } = recorded;
    this.periodS = description.period_s as number;
    this.firstTick = recorded.firstTick;
    this.endTick = Math.max(...histories.map((each) => each.endTick), this.firstTick);
    this.position = this.endTick;
    this.slider = element("input", { type: "range", "aria-label": "tick of the player", min: this.firstTick, max: this.endTick, step: 1,
      value: this.endTick, input: () => this.seek(Number(this.slider.value)) });
    this.trains = description.axes.map((axis) => new DriveTrain(axis));
    const list = new Facts();
    for (const [name, text] of facts) list.set(name, text);
    const place = element("div");
    root.replaceChildren(element("h2", {}, title), list.root,
      element("div", { class: "bar" }, this.playButton,
        choice("speed of the player", kSpeeds.map((each) => [String(each), each === 1 ? "as the clock" : each < 1 ? `${Math.round(1 / each)} times slower` : `${each} times faster`]),
          (value) => { this.speed = Number(value); this.drawTrains(); }),
        this.time, saveButton("Save", () => file, { "aria-label": `save ${file.name}`, title: file.name }),
        button("Close", () => closed(), { "aria-label": "close the player" })),
      this.slider, element("div", { class: "trains" }, ...this.trains.map((each) => each.root)), place);
    (root.querySelector('[aria-label="speed of the player"]') as HTMLSelectElement).value = "1";
    root.hidden = false;
    let scope: Scope | null = null; // its panes ask for their signals while it is being made
    const subscribe = () => scope !== null && histories.forEach((track, axis) => track.choose([...(scope as Scope).signalsOf(axis)]));
    scope = new Scope(place, recorded, panesOf(recorded, axis), subscribe,
      { lengthS: Math.max((this.endTick - this.firstTick) * this.periodS, 2 * recorded.sampleS), axis, togglePause: () => this.toggle() });
    this.scope = scope;
    try {
      subscribe();
      this.seek(this.endTick);
    } catch (problem) {
      scope.end();
      throw problem;
    }
    this.frame();
  }

  end(): void {
    this.isOver = true;
    this.scope.end();
  }

  recolour(): void {
    this.scope.recolour();
  }

  private toggle(): void {
    this.isPlaying = !this.isPlaying;
    if (this.isPlaying && this.position >= this.endTick) this.seek(this.firstTick);
    setText(this.playButton, this.isPlaying ? "Pause the player" : "Play");
    this.drawTrains();
  }

  private seek(tick: number): void {
    this.position = Math.min(Math.max(tick, this.firstTick), this.endTick);
    for (const track of this.played.recorded.histories) track.lastTick = Math.floor(this.position);
    this.slider.value = String(Math.floor(this.position));
    const shown = `${(Math.floor(this.position) * this.periodS).toFixed(4)} s`;
    this.slider.setAttribute("aria-valuetext", shown);
    setText(this.time, `${shown} of ${withUnit(this.endTick * this.periodS, "s")}`);
    this.scope.moved();
    if (!this.isPlaying) this.drawTrains();
  }

  private frame(): void {
    if (this.isOver) return;
    const now = performance.now();
    const seconds = 1e-3 * (now - this.turnedMs);
    this.turnedMs = now;
    if (this.isPlaying) {
      this.seek(this.position + (seconds * this.speed) / this.periodS);
      if (this.position >= this.endTick) this.toggle();
      else if (now - this.drawnMs > kDrawMs) this.drawTrains();
      for (const each of this.trains) each.turn(seconds);
    }
    requestAnimationFrame(() => this.frame());
  }

  private drawTrains(): void {
    this.drawnMs = performance.now();
    const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.played.recorded.histories.forEach((track, axis) => {
      const sample = track.sample();
      if (sample !== null) this.trains[axis].draw(sample as unknown as pb.Sample, this.isPlaying && !isStill ? this.speed : 0);
    });
  }
}

/** Where the page plays, one thing after the other; it plays on while the bench is away. */
export class PlayerPlace {
  private player: Player | null = null;

  constructor(private readonly root: HTMLElement) {}

  get isOpen(): boolean {
    return this.player !== null;
  }

  /** Throws Error with a sentence where the samples cannot be shown; it is closed then. */
  open(played: Played): void {
    this.close();
    try {
      this.player = new Player(this.root, played, () => this.close());
    } catch (problem) {
      this.empty();
      throw problem;
    }
    this.root.scrollIntoView({ block: "nearest" });
  }

  recolour(): void {
    this.player?.recolour();
  }

  private close(): void {
    this.player?.end();
    this.player = null;
    this.empty();
  }

  private empty(): void {
    this.root.hidden = true;
    this.root.replaceChildren();
  }
}

/** The usual signals of an axis where they were recorded; else a pane for each unit. */
function panesOf({ description }: Recorded, axis: number): string[][] {
  const signals = description.signals.filter((each) => each.kind !== pb.SignalDescription.Kind.KIND_STATUS);
  const names = new Set(signals.map((each) => each.name as string));
  const usual = usualPanes(description.axes[axis]);
  if (usual.every((pane) => pane.every((each) => names.has(each)))) return usual;
  const panes = new Map<string, string[]>();
  for (const { name, unit } of signals) panes.set(unit as string, [...(panes.get(unit as string) ?? []), name as string]);
  return [...panes.values()].slice(0, kMostPanes);
}
