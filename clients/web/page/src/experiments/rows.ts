/** Rows of a form that its user adds and removes. */
import { button, element } from "../dom";
import { numberIn } from "../numbers";

/** Reads the numbers of a form; the first wrong one ends the reading with a sentence. */
export class NotANumber extends Error {}

export function numberOf(field: HTMLInputElement): number {
  const value = numberIn(field.value);
  field.setAttribute("aria-invalid", String(Number.isNaN(value)));
  if (Number.isNaN(value)) throw new NotANumber(`${field.getAttribute("aria-label")}: '${field.value}' is not a number`);
  return value;
}

export function input(label: string, value: string, size = 7): HTMLInputElement {
  return element("input", { "aria-label": label, value, size });
}

/** A list whose rows `make` builds; each gives its part of the request. */
export class RowList<T> {
  readonly root: HTMLElement;
  private readonly list = element("ul", { class: "parameters" });
  private readonly rows: { root: HTMLElement; read(): T }[] = [];
  private readonly addButton: HTMLButtonElement;
  private made = 0;

  constructor(title: string, private readonly what: string, private readonly make: (number: number) => { nodes: (Node | string)[]; read(): T }) {
    this.addButton = button(`Add ${what}`, () => this.add());
    this.root = element("div", { role: "group", "aria-label": title }, this.list, this.addButton);
  }

  add(): void {
    const number = ++this.made;
    const { nodes, read } = this.make(number);
    const row = { root: element("li", {}, element("div", { class: "bar" }, ...nodes,
      button("×", () => {
        this.rows.splice(this.rows.indexOf(row), 1);
        row.root.remove();
        this.addButton.focus();
      }, { class: "small", "aria-label": `remove ${this.what} ${number}` }))), read };
    this.rows.push(row);
    this.list.append(row.root);
  }

  clear(): void {
    this.rows.length = 0;
    this.list.replaceChildren();
  }

  read(): T[] {
    return this.rows.map((each) => each.read());
  }
}
