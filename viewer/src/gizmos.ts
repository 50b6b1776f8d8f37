/** Handles that move the objects of a scene: arrows along the axes, a ring in the plane of the picture, and numbers. */

import { axes, diagonal, project } from "./camera.ts";
import type { Field } from "./field.ts";
import { element } from "./panel.ts";
import { add, scaled, type Vector } from "./vectors.ts";
import type { View } from "./view.ts";

const AXES: [Vector, string, string][] = [
  [[1, 0, 0], "x", "#d1402f"],
  [[0, 1, 0], "y", "#2f8f3e"],
  [[0, 0, 1], "z", "#2f62d1"],
];
const ARROW = 0.13; // of the scene's diagonal
const STEP = 0.02; // of a number's arrows, about, of the diagonal
const RIGHT = 0.7; // share of the picture from which on a name stands left of its object

function drawn<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Record<string, string>): SVGElementTagNameMap[K] {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
}

interface Handles {
  field: Field;
  ring: SVGCircleElement;
  name: SVGTextElement;
  arrows: { axis: Vector; seen: SVGLineElement; held: SVGLineElement }[];
  numbers: HTMLInputElement[];
}

export class Gizmos {
  readonly panel = element("fieldset", {}, element("legend", {}, "Objects"));
  private readonly picture = drawn("svg", { "aria-hidden": "true" });
  private readonly all: Handles[];

  constructor(
    overlay: HTMLElement,
    private readonly view: View,
  ) {
    overlay.append(this.picture);
    this.panel.append(element("div", { class: "place", "aria-hidden": "true" }, ...["", ...AXES.map(([, label]) => label)].map((label) => element("span", {}, label))));
    this.all = view.world.fields.map((field) => this.handles(field));
    this.update();
  }

  /** Power of ten of a number's step. */
  private get exponent(): number {
    return Math.round(Math.log10(STEP * diagonal(this.view.stage)));
  }

  /** What an object is called: with its number where several are of one field. */
  private called({ record }: Field): string {
    const same = this.view.world.fields.filter((other) => other.record.name === record.name);
    return same.length > 1 ? `${record.name} ${1 + same.findIndex((other) => other.record === record)}` : record.name;
  }

  /** Put the handles where the objects are seen, and their places into the numbers. */
  update(): void {
    const { camera, stage } = this.view;
    const digits = Math.max(0, 1 - this.exponent);
    for (const { field, ring, name, arrows, numbers } of this.all) {
      const at = middle(field);
      const seen = project(at, camera, stage);
      for (const part of [ring, name, ...arrows.flatMap(({ seen, held }) => [seen, held])]) {
        part.setAttribute("visibility", seen ? "visible" : "hidden");
      }
      if (!seen) continue;
      place(ring, { cx: seen[0], cy: seen[1] });
      place(name, { x: seen[0], y: seen[1], dx: seen[0] > RIGHT ? -0.02 : 0.02 });
      name.setAttribute("text-anchor", seen[0] > RIGHT ? "end" : "start");
      for (const { axis, seen: line, held } of arrows) {
        const tip = project(add(at, scaled(axis, ARROW * diagonal(stage))), camera, stage) ?? seen;
        for (const part of [line, held]) place(part, { x1: seen[0], y1: seen[1], x2: tip[0], y2: tip[1] });
      }
      numbers.forEach((input, index) => {
        const at = Number(field.record.world_from_mesh.translation[index]!.toFixed(digits)) + 0; // without -0
        if (document.activeElement !== input) input.value = at.toFixed(digits);
      });
    }
  }

  private handles(field: Field): Handles {
    const arrows = AXES.map(([axis, , stroke]) => ({
      axis,
      seen: drawn("line", { class: "arrow", stroke }),
      held: drawn("line", { class: "handle" }),
    }));
    const [ring, name] = [drawn("circle", { class: "handle", r: "8" }), drawn("text", { class: "name" })];
    name.textContent = this.called(field);
    for (const { axis, seen, held } of arrows) {
      this.picture.append(seen, held);
      this.drag(held, (by) => along(axis, by, field, this.view));
      this.drag(seen, (by) => along(axis, by, field, this.view));
    }
    this.picture.append(ring, name);
    this.drag(ring, (by) => this.inPlane(by, field));
    const numbers = AXES.map(([, label], index) => this.number(field, label, index));
    this.panel.append(element("div", { class: "place" }, element("span", {}, this.called(field)), ...numbers));
    return { field, ring, name, arrows, numbers };
  }

  private number(field: Field, label: string, index: number): HTMLInputElement {
    const input = element("input", { type: "number", step: `${10 ** this.exponent}`, "aria-label": `${this.called(field)}, ${label}` });
    input.addEventListener("input", () => {
      if (!Number.isFinite(input.valueAsNumber)) return;
      field.record.world_from_mesh.translation[index] = input.valueAsNumber;
      this.changed();
    });
    return input;
  }

  private inPlane([x, y]: [number, number], field: Field): Vector {
    const [right, up] = axes(this.view.camera, this.view.stage.up);
    return add(along(right, [x, 0], field, this.view), along(up, [0, y], field, this.view));
  }

  /** Dragging a part moves its object by what `towards` makes of shares of the picture. */
  private drag(part: SVGElement, towards: (by: [number, number]) => Vector): void {
    let last: [number, number] | null = null;
    const field = (): Field => this.all.find((one) => one.ring === part || one.arrows.some((a) => a.held === part || a.seen === part))!.field;
    part.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      part.setPointerCapture(event.pointerId);
      last = [event.clientX, event.clientY];
    });
    part.addEventListener("pointermove", (event) => {
      if (!last) return;
      event.stopPropagation();
      const { width, height } = this.picture.getBoundingClientRect();
      const by = towards([(event.clientX - last[0]) / width, (event.clientY - last[1]) / height]);
      last = [event.clientX, event.clientY];
      const map = field().record.world_from_mesh;
      map.translation = add(map.translation, by);
      this.changed();
    });
    for (const end of ["pointerup", "pointercancel"] as const) part.addEventListener(end, () => (last = null));
  }

  private changed(): void {
    this.update();
    this.view.refresh();
  }
}

/** The middle of a field's box, frame of the world. */
const middle = (field: Field): Vector => scaled(field.worldCorners.reduce(add), 1 / 8);

const place = (part: SVGElement, numbers: Record<string, number>): void => {
  for (const [name, value] of Object.entries(numbers)) part.setAttribute(name, `${100 * value}%`);
};

/** How far along a direction of the world a step over the picture goes, at the depth of the field. */
function along(axis: Vector, by: [number, number], field: Field, { camera, stage }: View): Vector {
  const at = middle(field);
  const step = 0.01 * diagonal(stage);
  const [here, there] = [project(at, camera, stage), project(add(at, scaled(axis, step)), camera, stage)];
  if (!here || !there) return [0, 0, 0];
  const [x, y] = [(there[0] - here[0]) / step, (there[1] - here[1]) / step];
  const square = x * x + y * y;
  return square < 1e-9 ? [0, 0, 0] : scaled(axis, (by[0] * x + by[1] * y) / square);
}
