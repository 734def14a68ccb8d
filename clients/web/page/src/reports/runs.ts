/** Suites and identifications that the gateway runs: what this page asks for, and how far all of them are. */
import { Bench } from "../bench";
import { button, choice, element, setText } from "../dom";
import { RunsAnswer } from "../wire";

const [kBusyMs, kIdleMs] = [500, 3000];
const kHeads = ["run", "what", "state", "cases", "result", ""];

interface Run {
  number: number;
  subject: string;
  state: "waits" | "runs" | "passed" | "failed" | "cancelled";
  /** Cases of a suite; `of` is 0 where there are none, or not yet. */
  done: number;
  of: number;
  /** Cases that neither passed nor were skipped. */
  bad: number;
  sentence: string;
  /** Empty: it has none. */
  report: string;
}

interface Listing {
  /** When the gateway began: another one numbers its runs anew. */
  begun_us: number;
  suites: string[];
  identifies: boolean;
  runs: Run[];
}

/** Of a gateway that runs nothing. */
const kNothing: Listing = { begun_us: 0, suites: [], identifies: false, runs: [] };

class Row {
  readonly root = element("tr");
  private readonly cells = kHeads.slice(1, -1).map(() => element("td"));
  private readonly cancel: HTMLButtonElement;

  constructor(number: number, cancel: () => void) {
    this.cancel = button("Cancel", cancel, { "aria-label": `Cancel run ${number}` });
    this.root.append(element("th", { scope: "row" }, String(number)), ...this.cells, element("td", {}, this.cancel));
  }

  draw(run: Run, mayChange: boolean): void {
    [run.subject, run.state, casesOf(run), run.sentence].forEach((text, i) => setText(this.cells[i], text));
    this.cells[1].className = run.state === "failed" ? "bad" : "";
    this.cancel.hidden = hasEnded(run) || !mayChange;
  }
}

export class RunsPanel {
  readonly root = element("div", { hidden: true });
  private readonly answer = element("p", { class: "answer", role: "status" });
  private readonly suites = element("span", { class: "bar" });
  private readonly body = element("tbody");
  private readonly table = element("div", { class: "table", tabindex: 0, role: "group", "aria-label": "List of runs", hidden: true },
    element("table", { class: "list" }, element("thead", {}, element("tr", {}, ...kHeads.map((each) =>
      each === "" ? element("td") : element("th", { scope: "col" }, each)))), this.body));
  private readonly rows = new Map<number, Row>();
  private listing = kNothing;
  private bench: Bench | null = null;
  private timer = 0;
  /** Of this page, until they end. */
  private readonly awaited = new Set<number>();

  /** `ended` is called when one has ended, with its report if this page asked for it and it has one. */
  constructor(private readonly ended: (report: string) => void) {
    this.root.append(this.suites, this.answer, this.table);
    this.ask();
  }

  /** A session with the bench, whose role decides what may be asked for; null: it is lost. */
  enter(bench: Bench | null): void {
    this.bench = bench;
    this.draw();
    if (bench !== null) this.ask(); // another gateway may have taken the place of the last one
  }

  told({ said, is_refusal: isRefusal, run }: RunsAnswer): void {
    if (!isRefusal) this.awaited.add(run);
    this.tell(said, isRefusal);
    this.ask();
  }

  private tell(text: string, isBad: boolean): void {
    setText(this.answer, text);
    this.answer.classList.toggle("bad", isBad);
  }

  get identifies(): boolean {
    return this.listing.identifies && this.mayChange;
  }

  identify(experiment: number, owner: string, axis: number, motor: string): void {
    this.bench?.wire.order({ op: "identify", experiment, owner, axis, motor });
  }

  private get mayChange(): boolean {
    return this.bench?.mayChange ?? false;
  }

  /** Reads the list, now and again and again, unless the gateway runs nothing. */
  private ask(): void {
    clearTimeout(this.timer);
    void this.read().then((waitMs) => {
      clearTimeout(this.timer);
      if (waitMs !== null) this.timer = window.setTimeout(() => this.ask(), waitMs);
    });
  }

  private async read(): Promise<number | null> {
    try {
      const listing = (await (await fetch("/runs")).json()) as Listing | null;
      if (listing?.begun_us !== this.listing.begun_us) this.forget();
      if (listing === null) return null;
      const wereBusy = new Set(this.listing.runs.filter((each) => !hasEnded(each)).map((each) => each.number));
      if (listing.suites.join() !== this.listing.suites.join()) this.offer(listing.suites);
      this.listing = listing;
      this.draw();
      for (const each of listing.runs.filter(hasEnded)) {
        const isOwn = this.awaited.delete(each.number);
        if (isOwn) this.tell(`run ${each.number}: ${each.state}${each.sentence === "" ? "" : `: ${each.sentence}`}`, each.state === "failed");
        if (isOwn || wereBusy.has(each.number)) this.ended(isOwn ? each.report : "");
      }
      return listing.runs.every(hasEnded) ? kIdleMs : kBusyMs;
    } catch {
      return kIdleMs; // a lost gateway is told elsewhere
    }
  }

  /** Another gateway answers. */
  private forget(): void {
    if (this.awaited.size > 0) this.tell(`run ${[...this.awaited].join(", ")}: the gateway has begun anew, and knows nothing of it`, true);
    this.awaited.clear();
    this.listing = kNothing;
    this.draw();
  }

  private offer(names: string[]): void {
    const suite = choice("suite to run", names.map((each) => [each, each]), () => undefined);
    this.suites.replaceChildren("Suite", suite, button("Run", () => this.bench?.wire.order({ op: "run_suite", suite: suite.value }), { "aria-label": "Run the suite" }));
  }

  private draw(): void {
    const { suites, identifies, runs } = this.listing;
    this.root.hidden = suites.length === 0 && !identifies;
    this.suites.hidden = suites.length === 0 || !this.mayChange;
    this.table.hidden = runs.length === 0;
    for (const run of [...runs].reverse()) {
      let row = this.rows.get(run.number);
      if (row === undefined) {
        row = new Row(run.number, () => this.bench?.wire.order({ op: "cancel_run", run: run.number }));
        this.rows.set(run.number, row);
        this.body.prepend(row.root);
      }
      row.draw(run, this.mayChange);
    }
    const numbers = new Set(runs.map((each) => each.number));
    for (const [number, row] of this.rows) {
      if (numbers.has(number)) continue;
      row.root.remove();
      this.rows.delete(number);
    }
  }
}

function hasEnded({ state }: Run): boolean {
  return state !== "waits" && state !== "runs";
}

function casesOf({ done, of, bad }: Run): string {
  return of === 0 ? "" : `${done} of ${of}${bad === 0 ? "" : `, ${bad} not passed`}`;
}
