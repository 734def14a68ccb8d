/** Elements of the page in one expression. */

type Properties = Record<string, string | number | boolean | ((event: Event) => void)>;

/** `element("button", { type: "button", click: act }, "Act")`: functions are listeners, the rest are attributes. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K, properties: Properties = {}, ...children: (Node | string)[]): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (typeof value === "function") made.addEventListener(name, value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false) made.setAttribute(name, String(value));
  }
  made.append(...children);
  return made;
}

/** The same for a part of a drawing (SVG). */
export function drawing(tag: string, attributes: Record<string, string | number> = {}, ...children: (Node | string)[]): SVGElement {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  made.append(...children);
  return made;
}

export function button(text: string, act: () => void, more: Properties = {}): HTMLButtonElement {
  return element("button", { type: "button", click: act, ...more }, text);
}

/** A choice of [value, text]. */
export function choice(label: string, options: [string, string][], change: (value: string) => void): HTMLSelectElement {
  return element("select", { "aria-label": label, change: (event) => change((event.target as HTMLSelectElement).value) },
    ...options.map(([value, text]) => element("option", { value }, text)));
}

export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  return document.getElementById(id) as T;
}

/** Changes the text only where it differs, so that a screen reader is not told the same again. */
export function setText(node: HTMLElement, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

export interface SavedFile {
  name: string;
  type: string;
  /** The parts, one after the other: a text of more than half a gigabyte is none. */
  content(): Promise<BlobPart[]>;
}

/** A button that offers a file, and the words beside it while the file is made or if it cannot be. */
export function saveButton(text: string, fileOf: () => SavedFile, more: Properties = {}): HTMLElement {
  const words = element("span", { class: "soft", role: "status" });
  let isBusy = false;
  const act = async () => {
    if (isBusy) return;
    isBusy = true;
    setText(words, "making the file");
    try {
      const { name, type, content } = fileOf();
      const url = URL.createObjectURL(new Blob(await content(), { type }));
      element("a", { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 1000);
      setText(words, "");
    } catch (problem) {
      setText(words, `the file cannot be made: ${(problem as Error).message}`);
    }
    isBusy = false;
  };
  return element("span", { class: "bar" }, button(text, () => void act(), more), words);
}
