/** What the page says of its picture: a legend, a status line, and a sentence for those who do not see it. */

import { element } from "./panel.ts";
import { diverging, viridis } from "./shading.ts";
import { LINES_FROM, lineStep, position } from "./slice.ts";
import type { Shown, View } from "./view.ts";

export interface Words {
  picture: string;
  legend: (Node | string)[];
  status: string;
}

const short = (value: number): string => value.toPrecision(3);

function ramp(name: string): string {
  const stops = [0, 0.25, 0.5, 0.75, 1].map((level) => {
    const colour = name === "depth" || name === "udf" ? viridis(1 - level) : diverging(2 * level - 1);
    return `rgb(${colour.map(Math.round)})`;
  });
  return name === "visibility" ? "linear-gradient(90deg, white, rgb(33,43,64))" : `linear-gradient(90deg, ${stops})`;
}

/** A bar of colours between its ends. */
function scale(name: string, range: [number, number] | null): (Node | string)[] {
  if (!range) return [];
  const bar = element("i");
  bar.style.background = ramp(name);
  return [short(range[0]), bar, short(range[1])];
}

/** What a slice shows, and where it is. */
function sliced({ slice, stage, distances }: View, { slice: range, size }: Shown): { legend: (Node | string)[]; words: string } {
  const quantity = slice.quantity;
  if (!quantity) return { legend: [], words: "" };
  const lines = range && size >= LINES_FROM && (quantity.name === "udf" || quantity.name === "depth") ? `; lines every ${lineStep(range[1])}` : "";
  const where = `${slice.axis} = ${position(slice, stage).toFixed(2)}`;
  const note = quantity.note.replace("{hits}", distances.count.toLocaleString("en"));
  return {
    legend: [element("span", {}, "Slice: "), ...scale(quantity.name, range), element("span", {}, `${note}${lines}`)],
    words: `; a slice at ${where} shows ${quantity.label}${range ? `, ${short(range[0])} to ${short(range[1])}` : ""}`,
  };
}

export function summary(title: string, view: View, engine: string, what: Shown): Words {
  const { mode, camera } = view;
  const { size, answers, milliseconds, picture, evaluated } = what;
  const share = Math.round((100 * answers.seen) / (size * size));
  const from = `azimuth ${Math.round(camera.azimuth)}°, elevation ${Math.round(camera.elevation)}°`;
  const note = picture.approximate ? "while moving: normals from differences of depth" : mode.note;
  const slice = sliced(view, what);
  const legend = slice.legend.length ? slice.legend : [...scale(mode.name, picture.range), element("span", {}, note)];
  return {
    picture: `${title}, ${mode.label.toLowerCase()}, from ${from}: ${share} % of the picture shows the object${slice.words}`,
    legend,
    status:
      `${size} × ${size} pixels in ${Math.round(milliseconds)} ms; ` +
      `${evaluated.toLocaleString("en")} rays of ${(size * size).toLocaleString("en")} pixels evaluated by ${engine}`,
  };
}
