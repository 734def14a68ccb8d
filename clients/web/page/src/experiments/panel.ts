/** The experiments of the bench: a form that queues one, the list of all, and their data in the player. */
import { Bench } from "../bench";
import { element, setText } from "../dom";
import { csvOfRows } from "../exports";
import { withUnit } from "../numbers";
import { recordedFile } from "../player/mcap";
import { Played, PlayerPlace } from "../player/player";
import { recordedRows } from "../player/recorded";
import { pb } from "../wire";
import { Fetched, fetchExperiment, hasEnded, kMostBytes } from "./fetch";
import { ExperimentForm } from "./form";
import { ExperimentList } from "./list";
import { identification } from "./request";
import { kStateNames } from "./states";

const [kBusyMs, kIdleMs] = [500, 3000];

export class ExperimentsPanel {
  private readonly answer = element("p", { class: "answer", role: "status" });
  private readonly owner = element("input", { type: "password", autocomplete: "off", "aria-label": "secret that opens the data", size: 14 });
  private readonly list: ExperimentList;
  private readonly ended = new AbortController();
  private fetching: AbortController | null = null;
  private timer = 0;
  /** Hidden where the bench keeps no experiments, or its user may not ask for one. */
  private readonly form = element("details", { hidden: true }, element("summary", {}, "New experiment"));
  /** Experiments of this page whose data it shows when they end. */
  private readonly awaited = new Set<number>();

  constructor(root: HTMLElement, private readonly bench: Bench, private readonly player: PlayerPlace) {
    this.list = new ExperimentList(bench, {
      show: (info) => this.play(info, false),
      play: (info) => this.play(info, true),
      cancel: (info) => void this.cancel(info),
    });
    this.owner.value = ownSecret();
    const file = element("input", { type: "file", accept: ".mcap", "aria-label": "recording to play", change: () => void this.open(file) });
    root.replaceChildren(element("h2", {}, "Experiments and recordings"),
      element("p", { class: "soft" }, "An experiment runs on a bench of its own, from rest at tick 0. It does not touch the bench above."),
      this.form, this.answer, this.list.root,
      element("div", { class: "bar" }, element("label", {}, "Play a recording of this computer ", file),
        element("form", { class: "bar", submit: (event) => {
          event.preventDefault();
          localStorage.setItem("owner", this.owner.value);
          this.ask();
        } }, "Secret", this.owner, element("button", { type: "submit", title: "drivebench experiment ... --owner SECRET, or DRIVEBENCH_OWNER" }, "Use the secret"))));
    if (bench.mayChange)
      this.form.append(new ExperimentForm(bench, (request) => void this.queue(request), (sentence) => this.tell(sentence, true)).root);
    root.hidden = false;
    this.ask();
  }

  end(): void {
    this.ended.abort();
    this.fetching?.abort();
    clearTimeout(this.timer);
  }

  private tell(text: string, isBad = false): void {
    setText(this.answer, text);
    this.answer.classList.toggle("bad", isBad);
  }

  /** Reads the list, now and again and again. */
  private ask(): void {
    clearTimeout(this.timer);
    void this.read().then((isBusy) => {
      if (!this.ended.signal.aborted) this.timer = window.setTimeout(() => this.ask(), isBusy ? kBusyMs : kIdleMs);
    });
  }

  /** Whether an experiment waits or runs. */
  private async read(): Promise<boolean> {
    try {
      const { experiment_list: list } = await this.bench.wire.ask({ list_experiments: { owner: this.owner.value } });
      const all = (list?.experiments ?? []) as pb.ExperimentInfo[];
      this.list.show(all);
      this.form.hidden = !this.bench.mayChange;
      const done = all.find((each) => this.awaited.has(each.id as number) && hasEnded(each.state));
      if (done !== undefined) {
        this.awaited.delete(done.id as number);
        this.play(done, false);
      }
      return all.some((each) => !hasEnded(each.state));
    } catch (problem) {
      this.list.refused((problem as Error).message);
      this.form.hidden = true;
      return false;
    }
  }

  private async queue(request: pb.IRunExperiment): Promise<void> {
    const key = crypto.randomUUID();
    try {
      const { experiment_info: info } = await this.bench.wire.ask({ run_experiment: { ...request, owner: this.owner.value,
        user: this.bench.welcome.subject || "browser", request_key: key } });
      this.awaited.add(info?.id as number);
      this.tell(`experiment ${info?.id} is queued`);
      this.ask();
    } catch (problem) {
      this.tell(`experiment: ${(problem as Error).message}`, true);
    }
  }

  private async cancel(info: pb.ExperimentInfo): Promise<void> {
    try {
      await this.bench.wire.ask({ cancel_experiment: { id: info.id, owner: this.owner.value } });
      this.tell(`experiment ${info.id} will end`);
      this.ask();
    } catch (problem) {
      this.tell(`experiment ${info.id}: ${(problem as Error).message}`, true);
    }
  }

  /** Fetches the rows or the recording of an experiment, and plays them. */
  private play({ id }: pb.ExperimentInfo, recording: boolean): void {
    this.fetching?.abort();
    const fetching = new AbortController();
    this.fetching = fetching;
    const what = `experiment ${id}`;
    this.tell(`${what}: the data come`);
    fetchExperiment(id as number, this.owner.value, recording, (part) => this.tell(`${what}: the data come, ${Math.floor(100 * part)} %`), fetching.signal)
      .then((fetched) => {
        const { info, isWhole } = fetched;
        this.player.open(recording ? this.recording(fetched) : this.rows(fetched));
        this.tell(isWhole ? `${what}: ${kStateNames[info.state]}` : `${what}: the page shows the first ${kMostBytes >> 20} MiB; drivebench experiment fetch ${id} has all`);
      })
      .catch((problem: Error) => fetching.signal.aborted || this.tell(`${what}: ${problem.message}`, true));
  }

  private rows(fetched: Fetched): Played {
    const recorded = recordedRows(this.bench.description, fetched.info, fetched.bytes);
    const name = `experiment-${fetched.info.id}.csv`;
    return { title: titleOf(fetched.info, "data"), recorded, axis: 0, facts: this.factsOf(fetched.info, "play its recording, save it"),
      file: { name, type: "text/csv", content: () => csvOfRows(recorded.histories[0], recorded.description.signals, fetched.info.signals, recorded.description.period_s as number) } };
  }

  private recording(fetched: Fetched): Played {
    const name = `experiment-${fetched.info.id}.mcap`;
    const recorded = recordedFile(this.bench.description, fetched.bytes);
    const own = this.bench.description.axes[fetched.info.axis as number].name;
    const axis = recorded.description.axes.findIndex((each) => each.name === own);
    return { title: titleOf(fetched.info, "recording"), recorded, axis: Math.max(axis, 0), facts: this.factsOf(fetched.info, "save it"),
      file: { name, type: "application/octet-stream", content: () => fetched.bytes } };
  }

  /** `first`: what its user does before the motor is identified. */
  private factsOf(info: pb.ExperimentInfo, first: string): [string, string][] {
    const axis = this.bench.description.axes[info.axis as number];
    const period = info.period_s as number;
    const command = identification(this.bench.description.axes, info.axis as number, `experiment-${info.id}.mcap`);
    return [
      ["state", `${kStateNames[info.state]}${info.reason ? `: ${info.reason}` : ""}`],
      ["axis", axis.name as string],
      ["length", `${withUnit((info.tick as number) * period, "s")} of ${withUnit((info.ticks as number) * period, "s")}, ${info.tick} ticks`],
      ["data", `${info.rows} rows of ${info.signals.length} signals, one every ${withUnit((info.decimation as number) * period, "s")}`],
      ["verdict", info.verdict?.sentence as string ?? ""],
      ["state hash", ((info.verdict?.state_hash ?? 0) as number | bigint).toString(16).padStart(16, "0")],
      ...(command === "" ? [] : [["identify", `${first}, then ${command}`] as [string, string]]),
    ];
  }

  /** Plays a recording that its user has. */
  private async open(field: HTMLInputElement): Promise<void> {
    const file = field.files?.[0];
    if (file === undefined) return;
    try {
      if (file.size > kMostBytes) throw new Error(`the page plays recordings of at most ${kMostBytes >> 20} MiB, and this one has ${Math.ceil(file.size / 2 ** 20)}`);
      const bytes = new Uint8Array(await file.arrayBuffer());
      this.player.open({ title: `Recording ${file.name}`, recorded: recordedFile(this.bench.description, bytes), axis: 0, facts: [],
        file: { name: file.name, type: "application/octet-stream", content: () => bytes } });
      this.tell(`${file.name} is open`);
    } catch (problem) {
      this.tell(`${file.name}: ${(problem as Error).message}`, true);
    }
    field.value = "";
  }
}

function titleOf(info: pb.ExperimentInfo, what: string): string {
  return `Experiment ${info.id}, ${what}${info.label ? `: ${info.label}` : ""}`;
}

/** The secret of this browser. */
function ownSecret(): string {
  const known = localStorage.getItem("owner");
  if (known !== null) return known;
  const made = [...crypto.getRandomValues(new Uint8Array(16))].map((each) => each.toString(16).padStart(2, "0")).join("");
  localStorage.setItem("owner", made);
  return made;
}
