/** Requests that change an axis, at instants that the bench has not passed. */
import { Leases } from "./leases";
import { pb, Wire } from "./wire";

/** A bench that goes on reaches another tick in so long. */
const kPatienceMs = 1500;
const kAskAgainMs = 50;
/** How far ahead scheduled requests act: each time later, as long as the bench passes them on a slow way. */
const kAheads_s = [0.5, 2, 8];

export class Changes {
  constructor(private readonly wire: Pick<Wire, "ask">, private readonly leases: Pick<Leases, "holds" | "under" | "confirm">, private readonly periodS: number) {}

  /**
   * Sends the requests together and gives the ticks at which the bench acted. They may be scheduled: `start` is a tick that lies
   * ahead. If they need a lease and the page holds none, it takes one until all have acted.
   */
  async make(axis: number, requests: (start: number) => pb.IEnvelope[], underLease: boolean): Promise<number[]> {
    if (!underLease) return (await this.inTime(requests)).ticks;
    const borrows = !this.leases.holds(axis);
    return this.leases.under(axis, async () => {
      const { ticks, last } = await this.inTime(requests);
      if (borrows && last > 0) {
        await this.reach(last);
        await this.leases.confirm(axis).catch((problem: Error) => {
          throw new Error(`the lease has run out, and with it ended what was scheduled: ${problem.message}`);
        });
      }
      return ticks;
    });
  }

  /** Requests that the bench has passed act at once, all in the same tick: then none has had an effect, and they are made anew. */
  private async inTime(requests: (start: number) => pb.IEnvelope[]): Promise<{ ticks: number[]; last: number }> {
    for (const ahead of kAheads_s) {
      const made = requests(await this.tick() + Math.round(ahead / this.periodS) + 1);
      const answers = await Promise.all(made.map((each) => this.wire.ask(each)));
      const scheduled = made.map((each) => (each.inject_fault?.at_tick ?? 0) as number);
      const ticks = scheduled.map((each, i) => Math.max(each, answers[i].done?.tick as number));
      if (made.length === 1 || ticks.some((each) => each !== ticks[0])) return { ticks, last: Math.max(...scheduled) };
    }
    throw new Error("the bench was past the end of the fault before it heard of it: the way to it is too slow for so short a fault");
  }

  /** Waits until the bench has done a tick: what is scheduled ends with the lease. */
  private async reach(tick: number): Promise<void> {
    let now = await this.tick();
    for (let end = performance.now() + kPatienceMs; now <= tick; ) {
      if (performance.now() > end) throw new Error(`the bench stands at tick ${now}: what was to act at tick ${tick} has ended with the lease`);
      await new Promise((done) => setTimeout(done, kAskAgainMs));
      const before = now;
      now = await this.tick();
      if (now !== before) end = performance.now() + kPatienceMs;
    }
  }

  private async tick(): Promise<number> {
    return (await this.wire.ask({ status_request: {} })).status?.tick as number;
  }
}
