/** Parts of the page's controls. */

/** An element with attributes and content. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, string> = {},
  ...content: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...content);
  return made;
}

export const byId = (id: string): HTMLElement => document.getElementById(id)!;

/** A group of radio buttons, one of them chosen. */
export function choices<T extends { name: string; label: string; key?: string }>(
  title: string,
  kind: string,
  list: readonly T[],
  chosen: T,
  choose: (entry: T) => void,
): HTMLFieldSetElement {
  const labels = list.map((entry) => {
    const input = element("input", { type: "radio", name: kind, value: entry.name });
    input.checked = entry === chosen;
    input.addEventListener("change", () => choose(entry));
    return element("label", {}, input, element("span", {}, entry.label), ...(entry.key ? [element("kbd", {}, entry.key)] : []));
  });
  return element("fieldset", { class: kind }, element("legend", {}, title), ...labels);
}

export function button(label: string, act: () => void): HTMLButtonElement {
  const made = element("button", { type: "button" }, label);
  made.addEventListener("click", act);
  return made;
}

export function select(label: string, entries: [string, string][], chosen: string, choose: (value: string) => void): HTMLLabelElement {
  const made = element("select", { "aria-label": label }, ...entries.map(([value, text]) => element("option", { value }, text)));
  made.value = chosen;
  made.addEventListener("change", () => choose(made.value));
  return element("label", {}, element("span", {}, label), made);
}

/** A slider of shares from 0 to 1. */
export function slider(label: string, value: number, choose: (value: number) => void): HTMLLabelElement {
  const made = element("input", { type: "range", min: "0", max: "1", step: "0.01", value: `${value}`, "aria-label": label });
  made.addEventListener("input", () => choose(made.valueAsNumber));
  return element("label", {}, element("span", {}, label), made);
}

export function check(label: string, choose: (on: boolean) => void): HTMLLabelElement {
  const made = element("input", { type: "checkbox" });
  made.addEventListener("change", () => choose(made.checked));
  return element("label", {}, made, element("span", {}, label));
}

/** Give the user a file. */
export function download(data: Blob, name: string): void {
  const address = URL.createObjectURL(data);
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
