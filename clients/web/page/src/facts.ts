/** A list of names and values, whose values change in place. */
import { element, setText } from "./dom";

export class Facts {
  readonly root = element("dl");
  private readonly values = new Map<string, HTMLElement>();

  set(name: string, text: string, kind = ""): void {
    let value = this.values.get(name);
    if (value === undefined) {
      value = element("dd");
      this.values.set(name, value);
      this.root.append(element("dt", {}, name), value);
    }
    setText(value, text);
    value.className = kind;
  }
}
