/** What the page says of its picture: a legend, a status line, and a sentence for those who do not see it. */

import type { Camera } from "./camera.ts";
import { element } from "./panel.ts";
import { diverging, viridis, type Mode } from "./shading.ts";
import type { Shown } from "./view.ts";

export interface Words {
  picture: string;
  legend: (Node | string)[];
  status: string;
}

const short = (value: number): string => value.toPrecision(3);

function ramp(mode: Mode): string {
  const stops = [0, 0.25, 0.5, 0.75, 1].map((level) => {
    const colour = mode.name === "depth" ? viridis(1 - level) : diverging(2 * level - 1);
    return `rgb(${colour.map(Math.round)})`;
  });
  return mode.name === "visibility" ? "linear-gradient(90deg, white, rgb(33,43,64))" : `linear-gradient(90deg, ${stops})`;
}

export function summary(title: string, mode: Mode, camera: Camera, engine: string, what: Shown): Words {
  const { size, answers, milliseconds, picture } = what;
  const share = Math.round((100 * answers.seen) / (size * size));
  const from = `azimuth ${Math.round(camera.azimuth)}°, elevation ${Math.round(camera.elevation)}°`;
  const legend: (Node | string)[] = [];
  if (picture.range) {
    const bar = element("i");
    bar.style.background = ramp(mode);
    legend.push(short(picture.range[0]), bar, short(picture.range[1]));
  }
  const note = picture.approximate ? "while moving: normals from differences of depth" : mode.note;
  legend.push(element("span", {}, note));
  return {
    picture: `${title}, ${mode.label.toLowerCase()}, from ${from}: ${share} % of the picture shows the object`,
    legend,
    status:
      `${size} × ${size} pixels in ${Math.round(milliseconds)} ms; ` +
      `${answers.evaluated.toLocaleString("en")} of ${(size * size).toLocaleString("en")} rays evaluated by ${engine}`,
  };
}
