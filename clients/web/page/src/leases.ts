/** The leases that this page holds. An axis that shares an amplifier has the lease of the axis to which the amplifier belongs. */
import { Bench } from "./bench";
import { pb } from "./wire";

const { ACTION_ACQUIRE, ACTION_RELEASE, ACTION_RENEW } = pb.LeaseRequest.Action;

export class Leases {
  /** The numbers under which samples show this page as owner, by axis; 0: it holds no lease. */
  private readonly owners: number[];
  /** The axis whose lease is that of an axis. */
  private readonly leased: number[];
  /** How many actions of the page need the lease of an axis just now. */
  private readonly users: number[];
  /** The bench has given the lease of an axis, and the page has not given it back. */
  private readonly given: boolean[];
  private readonly listeners: ((axis: number, sentence: string) => void)[] = [];
  private readonly timer: number;
  /** The gateway commands the axes of all leases. */
  areDriven = false;
  /** The gateway gives all leases back, as the page has asked it to. */
  areGivenBack = false;

  constructor(private readonly bench: Bench) {
    const axes = bench.description.axes;
    this.owners = axes.map(() => 0);
    this.users = axes.map(() => 0);
    this.given = axes.map(() => false);
    this.leased = axes.map((axis, number) => (axis.shares_amplifier_with ? axes.findIndex((each) => each.name === axis.shares_amplifier_with) : number));
    this.timer = window.setInterval(() => this.renew(), ((bench.description.lease_s as number) * 1000) / 3);
  }

  end(): void {
    clearInterval(this.timer);
  }

  /** `change` is called with each lease that comes or goes, and with a sentence if the bench has taken it away. */
  watch(change: (axis: number, sentence: string) => void): void {
    this.listeners.push(change);
  }

  ownerOf(axis: number): number {
    return this.owners[this.leased[axis]];
  }

  holds(axis: number): boolean {
    return this.ownerOf(axis) !== 0;
  }

  /** The axes whose leases the page holds, without those that have the lease of another one. */
  get held(): number[] {
    return [...this.owners.keys()].filter((axis) => this.owners[axis] !== 0);
  }

  async acquire(axis: number): Promise<void> {
    if (this.holds(axis)) return;
    await this.use(axis, async ({ done }) => {
      this.areGivenBack = false;
      this.set(axis, done?.owner as number);
    });
  }

  async release(axis: number): Promise<void> {
    if (!this.holds(axis)) return;
    if (this.areDriven) throw new Error("the gateway drives the axis: give it back under Drive");
    if (this.users[this.leased[axis]] > 0) throw new Error("a change of the axis is under way, and what it has scheduled would end with the lease");
    await this.ask(axis, ACTION_RELEASE);
    this.given[this.leased[axis]] = false;
    this.set(axis, 0);
  }

  /** Acts under a lease, which the page borrows for so long if it holds none. */
  async under<T>(axis: number, act: () => Promise<T>): Promise<T> {
    return this.holds(axis) ? act() : this.use(axis, act);
  }

  /** Throws if the lease has run out meanwhile. */
  async confirm(axis: number): Promise<void> {
    await this.ask(axis, ACTION_RENEW);
  }

  /** The lease has gone, for the reason that the sentence gives. */
  lost(axis: number, sentence: string): void {
    this.set(axis, 0, sentence);
  }

  /** Acts with the lease. The last one that needs it gives it back, unless the page holds it. */
  private async use<T>(axis: number, act: (answer: pb.Envelope) => Promise<T>): Promise<T> {
    const leased = this.leased[axis];
    ++this.users[leased]; // counted before it asks: an action that ends meanwhile must not give the lease back
    try {
      const answer = await this.ask(axis, ACTION_ACQUIRE);
      this.given[leased] = true;
      return await act(answer);
    } finally {
      const isLast = --this.users[leased] === 0 && this.owners[leased] === 0;
      if (isLast && this.given[leased]) {
        this.given[leased] = false;
        await this.ask(axis, ACTION_RELEASE).catch(() => undefined); // the lease may have run out
      }
    }
  }

  private ask(axis: number, action: pb.LeaseRequest.Action): Promise<pb.Envelope> {
    return this.bench.wire.ask({ lease: { axis: this.leased[axis], action } });
  }

  private set(axis: number, owner: number, sentence = ""): void {
    const leased = this.leased[axis];
    this.owners[leased] = owner;
    this.leased.forEach((each, sharing) => {
      if (each === leased) for (const tell of this.listeners) tell(sharing, sharing === leased ? sentence : "");
    });
  }

  /** A renewal that comes after a lease was given back is refused, which is no news. */
  private renew(): void {
    for (const axis of this.users.keys()) {
      if (this.owners[axis] === 0 && this.users[axis] === 0) continue;
      this.ask(axis, ACTION_RENEW).catch((problem: Error) => {
        if (this.holds(axis) && !this.areGivenBack) this.lost(axis, `lease: ${problem.message}`);
      });
    }
  }
}
