/** The reports in the folder of the gateway: those of tests in a tab of their own, those of identifications here; and its runs. */
import { button, element, setText } from "../dom";
import { Identification, identificationIn, isInside, numberOf } from "./identification";
import { RunsPanel } from "./runs";

interface Report {
  name: string;
  modified_s: number;
  bytes: number;
  is_too_large: boolean;
}

export class ReportsPanel {
  readonly runs = new RunsPanel((report) => void this.ended(report));
  private readonly answer = element("p", { class: "answer", role: "status" });
  private readonly rows = element("tbody");
  private readonly shown = element("div");
  /** The number of the report that was asked for last: an older one that comes later is not shown. */
  private asked = 0;

  constructor(private readonly root: HTMLElement) {
    root.replaceChildren(element("h2", {}, "Reports"), this.runs.root, element("div", { class: "bar" }, button("Look again", () => void this.list())), this.answer,
      element("div", { class: "table", tabindex: 0, role: "group", "aria-label": "List of reports" }, element("table", { class: "list" }, element("thead", {}, element("tr", {},
        ...["report", "changed", ""].map((each) => element("th", { scope: "col" }, each)))), this.rows)), this.shown);
    void this.list();
  }

  /** A run has ended: its report is new, and shown if it is an identification. */
  private async ended(report: string): Promise<void> {
    await this.list();
    if (report.endsWith(".json")) await this.show(report, report.replace(/\.json$/, ".svg"));
  }

  /** A gateway without a folder of reports has null in the place of a list. */
  private async list(): Promise<void> {
    try {
      const reports = (await (await fetch("/reports")).json()) as Report[] | null;
      this.root.hidden = reports === null;
      if (reports === null) return;
      this.rows.replaceChildren(...reports.map((each) => this.row(each, reports)));
      setText(this.answer, reports.length === 0 ? "the folder has no reports" : "");
    } catch (problem) {
      setText(this.answer, `the reports cannot be listed: ${(problem as Error).message}`);
    }
  }

  private row(report: Report, all: Report[]): HTMLElement {
    const { name, modified_s: modified, bytes, is_too_large: isTooLarge } = report;
    const date = `${new Date(1000 * modified).toISOString().slice(0, 16).replace("T", " ")} UTC`;
    const plot = all.find((each) => each.name === name.replace(/\.json$/, ".svg") && !each.is_too_large)?.name;
    const open = isTooLarge ? `too large: ${Math.round(bytes / 2 ** 20)} MiB`
      : name.endsWith(".json") ? button("Show", () => void this.show(name, plot), { "aria-label": `show ${name}` })
        : element("a", { href: `/reports/${name}`, target: "_blank", rel: "noopener", "aria-label": `open ${name}` }, "Open");
    return element("tr", {}, element("th", { scope: "row" }, name), element("td", {}, date), element("td", {}, open));
  }

  private async show(name: string, plot: string | undefined): Promise<void> {
    const asked = ++this.asked;
    this.shown.replaceChildren();
    try {
      const answer = await fetch(`/reports/${name}`);
      if (!answer.ok) throw new Error((await answer.text()).trim());
      const found = identificationIn((await answer.json()) as unknown);
      if (found === null) throw new Error("it is no report of `drivebench identify --json`");
      if (asked !== this.asked) return;
      this.shown.replaceChildren(...this.identification(name, found, plot));
      setText(this.answer, "");
    } catch (problem) {
      if (asked === this.asked) setText(this.answer, `${name}: ${(problem as Error).message}`);
    }
  }

  private identification(name: string, found: Identification, plot: string | undefined): HTMLElement[] {
    const head = element("thead", {}, element("tr", {}, ...["parameter", "estimate", "± 95 %", "unit", "truth", "inside"].map((each) =>
      element("th", { scope: "col" }, each))));
    const body = element("tbody", {}, ...found.parameters.map((each) => element("tr", {}, element("th", { scope: "row" }, each.name),
      ...[numberOf(each.estimate), numberOf(each.interval), each.unit, numberOf(each.truth), isInside(each)].map((cell) => element("td", {}, cell)))));
    const lines = [`${found.motor}: ${found.method}`, found.source, found.verdict, ...found.validation, ...found.notes].filter((each) => each !== "");
    return [element("h3", {}, name), ...lines.map((each) => element("p", {}, each)),
      element("div", { class: "table" }, element("table", {}, element("caption", {}, `Parameters of ${name}`), head, body)),
      ...(plot === undefined ? [] : [element("img", { src: `/reports/${plot}`, alt: `Measured and re-simulated signals of ${name}` })])];
  }
}
