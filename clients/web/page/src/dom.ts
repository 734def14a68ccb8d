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

/** Offers a text or bytes as a file. */
export function save(name: string, type: string, content: string | Uint8Array<ArrayBuffer>): void {
  const url = URL.createObjectURL(new Blob([content], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}
