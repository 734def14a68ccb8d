/** The wire to the bench: frames of bench.proto in a WebSocket, which the gateway passes on; texts are for its drive and its runs. */
import { Reader } from "protobufjs/minimal.js";
import { drivebench } from "./bench_messages.js";

export import pb = drivebench.v1;

// Hashes have 64 bits; a number holds 53 of them.
Reader.prototype.fixed64 = function (this: Reader) {
  const low = this.fixed32();
  return ((BigInt(this.fixed32()) << 32n) | BigInt(low)) as unknown as ReturnType<Reader["fixed64"]>;
};

/** The bench refused a request, in its own words. */
export class Refused extends Error {
  constructor(readonly refusal: pb.Refusal) {
    super(refusal.field ? `${refusal.message} (${refusal.field})` : refusal.message);
  }
}

/** What the gateway says about the axes that it drives for the page. */
export interface DriveReport {
  state: "idle" | "drives" | "ends" | "over";
  problem: string;
  axes: { axis: number; gates: "off" | "voltage" | "current" | "duty"; frequency_hz: number; amplitude: number; run?: PresetRun }[];
  /** For each axis, in a report that answers `presets`. */
  presets?: Preset[][];
}

/** What the gateway answers when the page asks for a run, or cancels one. */
export interface RunsAnswer {
  said: string;
  is_refusal: boolean;
  /** Its number; 0 in a refusal. */
  run: number;
}

/** A reference controller with its move. */
export interface Preset {
  name: string;
  source: string;
  expectation: string;
}

/** The run of a preset on an axis. */
export interface PresetRun {
  number: number;
  preset: string;
  phase: "resting" | "preparing" | "moving" | "holding" | "done" | "failed";
  progress: number;
  failure: string;
  /** Of a run that is over. */
  numbers: { name: string; value: string; unit: string }[];
}

export interface Listener {
  /** `conducts`: the session may change axes that other sessions hold. */
  welcome(welcome: pb.Welcome, conducts: boolean): void;
  samples(samples: pb.Samples): void;
  triggered(triggered: pb.Triggered): void;
  notice(notice: pb.Notice): void;
  drive(report: DriveReport): void;
  runs(answer: RunsAnswer): void;
  /** The bench turned the page away: it wants another token. */
  tokenWanted(sentence: string): void;
  lost(sentence: string): void;
}

interface Waiting {
  /** Whether more answers follow this one. */
  goesOn(answer: pb.Envelope): boolean;
  resolve(answer: pb.Envelope): void;
  reject(problem: Error): void;
}

const kRetryMs = 1000;

/** One session after the other: a lost one is replaced until one answers. What comes late from a session that is replaced counts no more. */
export class Wire {
  private socket: WebSocket | null = null;
  private waiting = new Map<number, Waiting>();
  private lastId = 0;
  private rest = new Uint8Array(0);
  private isOver = false;

  /** `mayConduct`: a session whose role allows it asks for the right to conduct. */
  constructor(private readonly listener: Listener, private readonly mayConduct = true) {}

  /** A role is known only after its hello, and a hello beyond its role ends the session: so the first hello asks for nothing. */
  connect(conducts = false): void {
    const socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/bench`);
    socket.binaryType = "arraybuffer";
    const waiting = new Map<number, Waiting>();
    this.socket?.close();
    this.socket = socket;
    this.waiting = waiting;
    this.rest = new Uint8Array(0);
    let isToken = false;
    let refusal = "";
    let mayConduct = false;
    socket.onopen = async () => {
      try {
        const hello = { protocol_min: 1, protocol_max: 1, client: "browser", token: sessionStorage.getItem("token") ?? "", conducts };
        const welcome = (await this.ask({ hello })).welcome as pb.Welcome;
        mayConduct = this.mayConduct && !conducts && isConductor(welcome.role);
        if (mayConduct) socket.close();
        else this.listener.welcome(welcome, conducts);
      } catch (problem) {
        if (!(problem instanceof Refused)) return;
        refusal = problem.message;
        if (problem.refusal.code !== pb.RefusalCode.REFUSAL_UNAUTHENTICATED) return socket.close();
        isToken = true;
        this.listener.tokenWanted(refusal);
      }
    };
    socket.onmessage = ({ data }) => {
      if (this.socket !== socket) return;
      if (typeof data === "string") this.hear(data);
      else this.take(new Uint8Array(data as ArrayBuffer));
    };
    socket.onclose = (event) => {
      for (const each of waiting.values()) each.reject(new Error("the connection to the bench is lost"));
      waiting.clear();
      if (this.socket !== socket) return;
      this.socket = null;
      if (isToken || this.isOver) return;
      if (mayConduct) return this.connect(true);
      this.listener.lost(refusal || event.reason || `the gateway does not answer (${event.code})`);
      setTimeout(() => this.isOver || this.connect(), kRetryMs);
    };
  }

  /** Ends the session; no other follows. */
  end(): void {
    this.isOver = true;
    this.socket?.close();
  }

  /** The answer, the last one where several come; throws Refused, or Error when the connection ends first. */
  ask(kind: pb.IEnvelope, goesOn: (answer: pb.Envelope) => boolean = () => false): Promise<pb.Envelope> {
    const id = ++this.lastId;
    const payload = pb.Envelope.encode({ ...kind, id } as pb.Envelope).finish();
    const frame = new Uint8Array(4 + payload.length);
    new DataView(frame.buffer).setUint32(0, payload.length);
    frame.set(payload, 4);
    return new Promise((resolve, reject) => {
      if (this.socket?.readyState !== WebSocket.OPEN) {
        reject(new Error("there is no connection to the bench"));
        return;
      }
      this.waiting.set(id, { goesOn, resolve, reject });
      this.socket.send(frame);
    });
  }

  /** Orders the gateway's drive or a run; what came of it is told by reports and answers. */
  order(order: object): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(order));
  }

  private hear(text: string): void {
    const told = JSON.parse(text) as DriveReport | { runs: RunsAnswer };
    if ("runs" in told) this.listener.runs(told.runs);
    else this.listener.drive(told);
  }

  private take(message: Uint8Array): void {
    let bytes = message;
    if (this.rest.length > 0) {
      bytes = new Uint8Array(this.rest.length + message.length);
      bytes.set(this.rest);
      bytes.set(message, this.rest.length);
    }
    let at = 0;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    while (bytes.length - at >= 4) {
      const size = view.getUint32(at);
      if (bytes.length - at - 4 < size) break;
      this.dispatch(pb.Envelope.decode(bytes.subarray(at + 4, at + 4 + size)) as pb.Envelope);
      at += 4 + size;
    }
    this.rest = bytes.slice(at);
  }

  private dispatch(envelope: pb.Envelope): void {
    if (envelope.samples) return this.listener.samples(envelope.samples as pb.Samples);
    if (envelope.triggered) return this.listener.triggered(envelope.triggered as pb.Triggered);
    if (envelope.notice) return this.listener.notice(envelope.notice as pb.Notice);
    const waiting = this.waiting.get(envelope.id as number);
    if (!envelope.refusal && waiting?.goesOn(envelope)) return;
    this.waiting.delete(envelope.id as number);
    if (envelope.refusal) waiting?.reject(new Refused(envelope.refusal as pb.Refusal));
    else waiting?.resolve(envelope);
  }
}

function isConductor(role: pb.Role): boolean {
  return role === pb.Role.ROLE_CONDUCTOR || role === pb.Role.ROLE_ADMIN;
}
