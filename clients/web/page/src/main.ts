/** The page of `drivebench web`. */
import { Bench, usualPanes } from "./bench";
import { byId, setText } from "./dom";
import { DrivePanel } from "./drive_panel";
import { ExperimentsPanel } from "./experiments/panel";
import { Knobs } from "./knobs";
import { Leases } from "./leases";
import { PlayerPlace } from "./player/player";
import { ReportsPanel } from "./reports/panel";
import { Scope } from "./scope";
import { StatePanel } from "./state_panel";
import { pb, Refused, Wire } from "./wire";

const kStatusMs = 500;
const kThemes = ["system", "light", "dark"];
const kModes = ["?", "real time", "lockstep", "free"];
const kRoles = ["?", "viewer", "operator", "admin", "conductor"];

class Page {
  private readonly wire: Wire;
  private bench: Bench | null = null;
  private scope: Scope | null = null;
  private panel: StatePanel | null = null;
  private leases: Leases | null = null;
  private knobs: Knobs | null = null;
  private drive: DrivePanel | null = null;
  private experiments: ExperimentsPanel | null = null;
  private readonly player = new PlayerPlace(byId("player"));
  private readonly reports = new ReportsPanel(byId("reports"));
  private subscribed: string[] = [];

  constructor() {
    this.wire = new Wire({
      welcome: (welcome, conducts) => this.welcome(welcome, conducts),
      samples: (samples) => this.take(samples),
      triggered: (triggered) => this.scope?.triggered(triggered),
      notice: (notice) => this.alert(notice),
      drive: (report) => this.drive?.take(report),
      runs: (answer) => this.reports.runs.told(answer),
      tokenWanted: (sentence) => this.wantToken(sentence),
      lost: (sentence) => this.lost(sentence),
    });
    byId("token-form").addEventListener("submit", (event) => {
      event.preventDefault();
      sessionStorage.setItem("token", byId<HTMLInputElement>("token").value);
      byId("token-form").hidden = true;
      this.wire.connect();
    });
    this.theme();
    this.wire.connect();
    setInterval(() => this.askStatus(), kStatusMs);
  }

  private welcome(welcome: pb.Welcome, conducts: boolean): void {
    this.scope?.end();
    this.scope = null;
    this.endPanels();
    const bench = new Bench(this.wire, welcome, conducts);
    this.bench = bench;
    this.subscribed = [];
    const { name, mode, period_s: period } = bench.description;
    document.title = `${name} – drivebench`;
    setText(byId("bench-name"), name as string);
    setText(byId("bench-facts"), `${kModes[mode as number]}, ${Number((1 / (period as number)).toPrecision(6))} Hz, role ${kRoles[welcome.role as number]}`
      + (welcome.subject ? `, user ${welcome.subject}` : ""));
    this.showLink("connected", "good");
    byId("alert").hidden = true;
    const leases = new Leases(bench);
    this.leases = leases;
    this.knobs = new Knobs(byId("knobs"), bench, leases);
    this.drive = new DrivePanel(byId("drive"), bench, leases);
    this.panel = new StatePanel(byId("state"), bench, (axis) => leases.ownerOf(axis));
    this.scope = new Scope(byId("scope"), bench, usualPanes(bench.description.axes[0]), () => this.subscribe());
    this.experiments = new ExperimentsPanel(byId("experiments"), bench, this.player, this.reports.runs);
    this.reports.runs.enter(bench);
    this.subscribe();
    this.askStatus();
  }

  /** Subscribes to what the scope shows, where that has changed. */
  private subscribe(): void {
    const { bench, scope } = this;
    if (bench === null || scope === null) return; // the scope is being made
    bench.histories.forEach((history, axis) => {
      const signals = [...scope.signalsOf(axis)].sort();
      const wanted = signals.join();
      if (this.subscribed[axis] === wanted) return;
      this.subscribed[axis] = wanted;
      // Samples that come before the answer have the signals of before.
      const answered = () => {
        history.choose(signals);
        return false;
      };
      this.wire.ask({ subscribe: { axis, decimation: 1, signals } }, answered).catch((problem) => problem instanceof Refused && this.showAlert(problem.message));
    });
  }

  private take(samples: pb.Samples): void {
    const axis = samples.axis as number;
    const history = this.bench?.histories[axis];
    if (history === undefined) return;
    let lost = samples.dropped as number;
    this.bench!.dropped += lost;
    for (const sample of samples.samples) {
      history.push(sample as unknown as Record<string, number>, lost > 0);
      lost = 0;
    }
    this.scope?.see();
  }

  private async askStatus(): Promise<void> {
    const bench = this.bench;
    if (bench === null) return;
    try {
      bench.status = (await this.wire.ask({ status_request: {} })).status as pb.Status;
      this.panel?.draw(bench.status);
    } catch {
      // a lost connection is told elsewhere
    }
  }

  private alert(notice: pb.Notice): void {
    this.showAlert(notice.message as string);
    if (notice.kind === pb.Notice.Kind.KIND_LEASE_TAKEN) this.leases?.lost(notice.axis as number, notice.message as string);
  }

  private lost(sentence: string): void {
    this.bench = null;
    this.endPanels();
    this.showLink("lost, looking for it", "bad");
    this.showAlert(sentence);
    byId("knobs").hidden = true;
    byId("drive").hidden = true;
    byId("experiments").hidden = true;
  }

  private endPanels(): void {
    this.reports.runs.enter(null);
    this.leases?.end();
    this.knobs?.end();
    this.drive?.end();
    this.panel?.end();
    this.experiments?.end();
  }

  private wantToken(sentence: string): void {
    sessionStorage.removeItem("token");
    this.showLink("not let in", "bad");
    this.showAlert(sentence);
    byId("token-form").hidden = false;
    byId("token").focus();
  }

  private showLink(text: string, kind: string): void {
    setText(byId("link-state"), text);
    byId("link-state").className = kind;
  }

  private showAlert(text: string): void {
    setText(byId("alert"), text);
    byId("alert").hidden = false;
  }

  private theme(): void {
    const recolour = () => {
      this.scope?.recolour();
      this.player.recolour();
    };
    const show = (theme: string) => {
      setText(byId("theme"), `theme: ${theme}`);
      if (theme === "system") delete document.documentElement.dataset.theme;
      else document.documentElement.dataset.theme = theme;
      recolour();
    };
    let theme = localStorage.getItem("theme") ?? "system";
    show(theme);
    byId("theme").addEventListener("click", () => {
      theme = kThemes[(kThemes.indexOf(theme) + 1) % kThemes.length];
      localStorage.setItem("theme", theme);
      show(theme);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  }
}

new Page();
