/** Fetches the data of an experiment in a session of its own: much data delays no sample of the bench, and a slow browser ends the
 * fetch alone, which then goes on from where it was. */
import { pb, Refused, Wire } from "../wire";

/** The most that the page keeps of an experiment. */
export const kMostBytes = 128 * 2 ** 20;
const kFirstBytes = 2 ** 16;
/** Sessions that bring nothing, one a second, until it gives up. */
const kTries = 10;

export interface Fetched {
  info: pb.ExperimentInfo;
  bytes: Uint8Array<ArrayBuffer>;
  /** Not, where there is more than the page keeps. */
  isWhole: boolean;
}

/** Bytes that come in pieces, some of them perhaps twice. */
export class Pieces {
  private bytes = new Uint8Array(kFirstBytes);
  size = 0;

  take(at: number, piece: Uint8Array): void {
    if (at > this.size) throw new Error("the bench left out a piece of the data");
    const end = Math.min(at + piece.length, kMostBytes);
    if (end <= this.size) return;
    if (end > this.bytes.length) {
      const more = new Uint8Array(Math.min(Math.max(2 * this.bytes.length, end), kMostBytes));
      more.set(this.bytes);
      this.bytes = more;
    }
    this.bytes.set(piece.subarray(0, end - at), at);
    this.size = end;
  }

  get all(): Uint8Array<ArrayBuffer> {
    return this.bytes.subarray(0, this.size);
  }
}

export interface FetchListener {
  /** The part of the data that is there. */
  progress(part: number): void;
  /** It was not let in, or lost its session, and tries again. */
  waits(sentence: string): void;
}

/** The rows of an experiment that has ended, or its recording. `ended` gives up. */
export function fetchExperiment(id: number, owner: string, recording: boolean, listener: FetchListener, ended: AbortSignal): Promise<Fetched> {
  return new Promise((resolve, reject) => {
    const pieces = new Pieces();
    let info: pb.ExperimentInfo | null = null;
    let tries = 0;
    const bytesInStep = () => (recording ? 1 : (8 * (info as pb.ExperimentInfo).signals.length) / (info as pb.ExperimentInfo).decimation);
    const done = (act: () => void) => {
      wire.end();
      act();
    };
    const read = (answer: pb.Envelope): boolean => {
      tries = 0;
      if (answer.experiment_info) info = answer.experiment_info as pb.ExperimentInfo;
      if (info === null) return true;
      const { experiment_data: data } = answer;
      if (data) pieces.take(Math.round((data.first as number) * bytesInStep()), data.data as Uint8Array);
      const total = (recording ? info.recording_bytes : (info.rows as number) * 8 * info.signals.length) as number;
      listener.progress(total === 0 ? 1 : pieces.size / total);
      if (pieces.size < Math.min(total, kMostBytes) || !hasEnded(info.state)) return true;
      const fetched = { info, bytes: pieces.all, isWhole: pieces.size >= total };
      done(() => resolve(fetched));
      return false;
    };
    const take = (answer: pb.Envelope): boolean => {
      try {
        return read(answer);
      } catch (problem) {
        done(() => reject(problem as Error));
        return false;
      }
    };
    const lost = (sentence: string) => {
      if (++tries >= kTries) done(() => reject(new Error(`${sentence}; given up after ${kTries} tries`)));
      else listener.waits(sentence);
    };
    const begin = () => {
      const from = info === null ? 0 : Math.round(pieces.size / bytesInStep());
      wire.ask({ fetch_experiment: { id, owner, from, recording } }, take).catch((problem: Error) => {
        if (problem instanceof Refused) done(() => reject(problem)); // a lost session is replaced
      });
    };
    const wire = new Wire({
      welcome: begin,
      samples: () => undefined,
      triggered: () => undefined,
      notice: () => undefined,
      drive: () => undefined,
      runs: () => undefined,
      tokenWanted: (sentence) => done(() => reject(new Error(sentence))),
      lost,
    }, false);
    ended.addEventListener("abort", () => done(() => reject(new Error("given up"))));
    wire.connect();
  });
}

export function hasEnded(state: pb.ExperimentState): boolean {
  return state > pb.ExperimentState.EXPERIMENT_STATE_RUNNING;
}
