/** The transports of the bench: their state, and what they have counted. */
import { element, setText } from "./dom";
import { pb } from "./wire";

export class Transports {
  readonly root = element("details", { hidden: true });
  private readonly summary = element("summary");
  private readonly places = new Map<string, { state: HTMLElement; counts: HTMLElement }>();
  private readonly list = element("dl");

  constructor() {
    this.root.append(this.summary, this.list);
  }

  draw(transports: pb.ITransportStatus[]): void {
    this.root.hidden = transports.length === 0;
    setText(this.summary, summaryOf(transports));
    this.summary.className = transports.every(isUp) ? "" : "bad";
    for (const each of transports) {
      const place = this.placeOf(each.name as string);
      setText(place.state, each.state as string);
      place.state.className = isUp(each) ? "good" : "bad";
      setText(place.counts, countsOf(each));
    }
  }

  private placeOf(name: string): { state: HTMLElement; counts: HTMLElement } {
    let place = this.places.get(name);
    if (place === undefined) {
      place = { state: element("span"), counts: element("div", { class: "soft" }) };
      this.places.set(name, place);
      this.list.append(element("dt", {}, name), element("dd", {}, place.state, place.counts));
    }
    return place;
  }
}

function isUp(transport: pb.ITransportStatus): boolean {
  return transport.state === "up";
}

export function summaryOf(transports: pb.ITransportStatus[]): string {
  const down = transports.filter((each) => !isUp(each)).length;
  return `Transports: ${transports.length}, ${down === 0 ? "all up" : `${down} not up`}`;
}

export function countsOf(transport: pb.ITransportStatus): string {
  return (transport.counts ?? []).map(({ name, value }) => `${name} ${value}`).join(", ");
}
