/** The experiments of the bench: a form that queues one, the list of all, and their data in the player. */
import { Bench } from "../bench";
import { element, setText } from "../dom";
import { csvOfRows } from "../exports";
import { recordedFile } from "../player/mcap";
import { Played, PlayerPlace } from "../player/player";
import { recordedRows } from "../player/recorded";
import { RunsPanel } from "../reports/runs";
import { pb, Refused } from "../wire";
import { Fetched, fetchExperiment, hasEnded, kMostBytes } from "./fetch";
import { ExperimentForm } from "./form";
import { ExperimentList } from "./list";
import { motorOf, RequestKeys } from "./request";
import { kStateNames } from "./states";
import { arrivalOf, factsOf, fileNameOf, titleOf } from "./words";

const [kBusyMs, kIdleMs] = [500, 3000];
// Both outlive the panel, which each session makes anew.
const kKeys = new RequestKeys();
/** Experiments of this page whose end it tells, and whose data it shows then unless its user looks at others. */
const kAwaited = new Set<number>();

export class ExperimentsPanel {
  private readonly answer = element("p", { class: "answer", role: "status" });
  private readonly progress = element("progress", { max: 1, "aria-label": "progress of the data", hidden: true });
  private readonly owner = element("input", { type: "password", autocomplete: "off", "aria-label": "secret that opens the data", size: 14 });
  private readonly list: ExperimentList;
  private readonly ended = new AbortController();
  private fetching: AbortController | null = null;
  private timer = 0;
  /** Hidden where the bench keeps no experiments, or its user may not ask for one. */
  private readonly form = element("details", { hidden: true }, element("summary", {}, "New experiment"));

  constructor(root: HTMLElement, private readonly bench: Bench, private readonly player: PlayerPlace, private readonly runs: RunsPanel) {
    this.list = new ExperimentList(bench, {
      show: (info) => this.play(info, false),
      play: (info) => this.play(info, true),
      cancel: (info) => void this.cancel(info),
      identify: (info) => this.identify(info),
      canIdentify: (info) => this.runs.identifies && this.motorOf(info) !== undefined,
    });
    this.owner.value = ownSecret();
    const file = element("input", { type: "file", accept: ".mcap", "aria-label": "recording to play", change: () => void this.open(file) });
    root.replaceChildren(element("h2", {}, "Experiments and recordings"),
      element("p", { class: "soft" }, "An experiment runs on a bench of its own, from rest at tick 0. It does not touch the bench above."),
      this.form, this.answer, this.progress, this.list.root,
      element("div", { class: "bar" }, element("label", {}, "Play a recording of this computer ", file),
        element("form", { class: "bar", submit: (event) => {
          event.preventDefault();
          localStorage.setItem("owner", this.owner.value);
          this.ask();
        } }, "Secret", this.owner, element("button", { type: "submit", title: "drivebench experiment ... --owner SECRET, or DRIVEBENCH_OWNER" }, "Use the secret"))));
    if (bench.mayChange)
      this.form.append(new ExperimentForm(bench, (request) => this.queue(request), (sentence) => this.tell(sentence, true)).root);
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
      for (const each of all) if (hasEnded(each.state) && kAwaited.delete(each.id as number)) this.over(each);
      const known = new Set(all.map((each) => each.id as number));
      for (const each of kAwaited) if (!known.has(each)) kAwaited.delete(each); // the bench has begun anew
      return all.some((each) => !hasEnded(each.state));
    } catch (problem) {
      this.list.refused((problem as Error).message);
      this.form.hidden = true;
      return false;
    }
  }

  /** One of this page has ended. */
  private over(info: pb.ExperimentInfo): void {
    if (info.rows !== 0 && this.fetching === null && !this.player.isOpen) this.play(info, false);
    else this.tell(`experiment ${info.id}: ${kStateNames[info.state]}${info.reason ? `: ${info.reason}` : ""}`);
  }

  private async queue(request: pb.IRunExperiment): Promise<void> {
    const wanted = { ...request, owner: this.owner.value, user: this.bench.welcome.subject || "browser" };
    try {
      const { experiment_info: info } = await this.bench.wire.ask({ run_experiment: { ...wanted, request_key: kKeys.keyOf(wanted) } });
      kKeys.answered();
      kAwaited.add(info?.id as number);
      this.tell(`experiment ${info?.id} is queued`);
      this.ask();
    } catch (problem) {
      if (problem instanceof Refused) kKeys.answered();
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

  private motorOf(info: pb.ExperimentInfo): string | undefined {
    return motorOf(this.bench.description.axes[info.axis as number]);
  }

  private identify(info: pb.ExperimentInfo): void {
    this.runs.identify(info.id as number, this.owner.value, info.axis as number, this.motorOf(info) as string);
    this.tell(`experiment ${info.id}: its motor is identified, see Reports`);
  }

  /** Fetches the rows or the recording of an experiment, and plays them. */
  private play({ id }: pb.ExperimentInfo, recording: boolean): void {
    this.fetching?.abort();
    const fetching = new AbortController();
    this.fetching = fetching;
    const what = `experiment ${id}`;
    const coming = `${what}: the data come`;
    this.tell(coming);
    this.progress.value = 0;
    this.progress.hidden = false;
    let isWaiting = false;
    const listener = {
      progress: (part: number) => {
        this.progress.value = part;
        if (isWaiting) this.tell(coming);
        isWaiting = false;
      },
      waits: (sentence: string) => {
        isWaiting = true;
        this.tell(`${what}: ${sentence}; trying again`, true);
      },
    };
    fetchExperiment(id as number, this.owner.value, recording, listener, fetching.signal)
      .then((fetched) => {
        this.player.open(recording ? this.recording(fetched) : this.rows(fetched));
        this.tell(arrivalOf(fetched));
      })
      .catch((problem: Error) => fetching.signal.aborted || this.tell(`${what}: ${problem.message}`, true))
      .finally(() => {
        if (this.fetching !== fetching) return;
        this.fetching = null;
        this.progress.hidden = true;
      });
  }

  private rows(fetched: Fetched): Played {
    const recorded = recordedRows(this.bench.description, fetched.info, fetched.bytes);
    return { title: titleOf(fetched.info, "data"), recorded, axis: 0, facts: factsOf(this.bench.description.axes, fetched, "play its recording, save it"),
      file: { name: fileNameOf(fetched, "csv"), type: "text/csv", content: () => csvOfRows(recorded.histories[0], recorded.description.signals, fetched.info.signals, recorded.description.period_s as number) } };
  }

  private recording(fetched: Fetched): Played {
    const recorded = recordedFile(this.bench.description, fetched.bytes);
    const own = this.bench.description.axes[fetched.info.axis as number].name;
    const axis = recorded.description.axes.findIndex((each) => each.name === own);
    return { title: titleOf(fetched.info, "recording"), recorded, axis: Math.max(axis, 0), facts: factsOf(this.bench.description.axes, fetched, "save it"),
      file: { name: fileNameOf(fetched, "mcap"), type: "application/octet-stream", content: () => Promise.resolve([fetched.bytes]) } };
  }

  /** Plays a recording that its user has. */
  private async open(field: HTMLInputElement): Promise<void> {
    const file = field.files?.[0];
    if (file === undefined) return;
    try {
      if (file.size > kMostBytes) throw new Error(`the page plays recordings of at most ${kMostBytes >> 20} MiB, and this one has ${Math.ceil(file.size / 2 ** 20)}`);
      const bytes = new Uint8Array(await file.arrayBuffer());
      this.player.open({ title: `Recording ${file.name}`, recorded: recordedFile(this.bench.description, bytes), axis: 0, facts: [],
        file: { name: file.name, type: "application/octet-stream", content: () => Promise.resolve([bytes]) } });
      this.tell(`${file.name} is open`);
    } catch (problem) {
      this.tell(`${file.name}: ${(problem as Error).message}`, true);
    }
    field.value = "";
  }
}

/** The secret of this browser. */
function ownSecret(): string {
  const known = localStorage.getItem("owner");
  if (known !== null) return known;
  const made = [...crypto.getRandomValues(new Uint8Array(16))].map((each) => each.toString(16).padStart(2, "0")).join("");
  localStorage.setItem("owner", made);
  return made;
}
