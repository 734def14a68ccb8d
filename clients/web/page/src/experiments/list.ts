/** The list of all experiments, the newest first. Its rows change in place, so that the focus stays. */
import { Bench } from "../bench";
import { button, element, setText } from "../dom";
import { withUnit } from "../numbers";
import { pb } from "../wire";
import { hasEnded } from "./fetch";
import { kStateNames } from "./states";

const kHeads = ["number", "title", "user", "state", "length", "rows", ""];

interface ListListener {
  show(info: pb.ExperimentInfo): void;
  play(info: pb.ExperimentInfo): void;
  cancel(info: pb.ExperimentInfo): void;
  identify(info: pb.ExperimentInfo): void;
  /** Whether the gateway can, and this session may ask for it. */
  canIdentify(info: pb.ExperimentInfo): boolean;
}

class Row {
  readonly root = element("tr");
  private readonly cells = kHeads.slice(1, -1).map(() => element("td"));
  private readonly progress = element("progress", { max: 1 });
  private readonly buttons: { show: HTMLButtonElement; play: HTMLButtonElement; identify: HTMLButtonElement; cancel: HTMLButtonElement };
  private info: pb.ExperimentInfo;

  constructor(info: pb.ExperimentInfo, private readonly bench: Bench, private readonly listener: ListListener) {
    this.info = info;
    const act = (words: keyof ListListener, text: string) =>
      button(text, () => listener[words](this.info), { "aria-label": `${text} experiment ${info.id}` });
    this.buttons = { show: act("show", "Show data"), play: act("play", "Play recording"), identify: act("identify", "Identify"), cancel: act("cancel", "Cancel") };
    this.progress.setAttribute("aria-label", `progress of experiment ${info.id}`);
    this.root.append(element("th", { scope: "row" }, String(info.id)), ...this.cells, element("td", {}, this.progress, ...Object.values(this.buttons)));
  }

  draw(info: pb.ExperimentInfo): void {
    this.info = info;
    const period = info.period_s as number;
    const isOpen = period > 0; // the server says nothing of those whose data it does not open
    const state = kStateNames[info.state] + ((info.position as number) > 0 ? `, ${info.position} in the queue` : "");
    [isOpen ? info.label as string : "(another owner's)", info.user as string, state, isOpen ? withUnit((info.ticks as number) * period, "s") : "",
      isOpen ? String(info.rows) : ""].forEach((text, i) => setText(this.cells[i], text));
    this.cells[2].title = info.reason as string;
    this.progress.value = isOpen && (info.ticks as number) > 0 ? (info.tick as number) / (info.ticks as number) : 0;
    const isDone = hasEnded(info.state);
    this.progress.hidden = !isOpen || isDone;
    this.buttons.show.hidden = !isOpen || !isDone || info.rows === 0;
    this.buttons.play.hidden = !isOpen || !isDone || info.recording_bytes === 0;
    this.buttons.identify.hidden = this.buttons.play.hidden || !this.listener.canIdentify(info);
    this.buttons.cancel.hidden = !isOpen || isDone || !this.bench.mayChange;
  }
}

export class ExperimentList {
  private readonly body = element("tbody");
  private readonly note = element("p", { class: "soft" });
  private readonly table = element("table", { class: "list" }, element("thead", {}, element("tr", {}, ...kHeads.map((each) =>
    each === "" ? element("td") : element("th", { scope: "col" }, each)))), this.body);
  readonly root = element("div", { class: "table", tabindex: 0, role: "group", "aria-label": "List of experiments" }, this.note, this.table);
  private readonly rows = new Map<number, Row>();

  constructor(private readonly bench: Bench, private readonly listener: ListListener) {
    this.table.hidden = true;
  }

  show(all: pb.ExperimentInfo[]): void {
    setText(this.note, all.length === 0 ? "There is no experiment yet." : "");
    this.table.hidden = all.length === 0;
    for (const info of all) {
      const id = info.id as number;
      let row = this.rows.get(id);
      if (row === undefined) {
        row = new Row(info, this.bench, this.listener);
        this.rows.set(id, row);
        this.body.prepend(row.root);
      }
      row.draw(info);
    }
    const ids = new Set(all.map((each) => each.id as number));
    for (const [id, row] of this.rows) {
      if (ids.has(id)) continue;
      row.root.remove();
      this.rows.delete(id);
    }
  }

  /** The bench does not tell its experiments. */
  refused(sentence: string): void {
    setText(this.note, sentence);
    this.table.hidden = true;
  }
}
