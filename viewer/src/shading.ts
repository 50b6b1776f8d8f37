/** Colours of what is seen, those of `ddf.pictures.field_pictures`; nothing is seen where the page shows through. */

import { type Camera, type Stage, axes, type Rays } from "./camera.ts";
import type { Output } from "./engine.ts";
import type { Answers } from "./field.ts";

export interface Mode {
  key: string; // of the keyboard
  name: string;
  label: string;
  outputs: Output[];
  moving: Output[]; // what is asked for while the camera moves
  note: string;
}

/** Normals come from differences of depth while the camera moves, and from the network's own gradient at rest. */
export const MODES: Mode[] = [
  { key: "1", name: "shaded", label: "Shaded", outputs: ["depth", "normals"], moving: ["depth"], note: "light from the camera" },
  { key: "2", name: "depth", label: "Depth d", outputs: ["depth"], moving: ["depth"], note: "along the ray, mesh units: near yellow, far violet" },
  { key: "3", name: "normals", label: "Normals n", outputs: ["depth", "normals"], moving: ["depth"], note: "axes of the mesh as red, green, blue" },
  { key: "4", name: "visibility", label: "Visibility ξ", outputs: ["visibility"], moving: ["visibility"], note: "0 to 1; 1/2 and more counts as seen" },
  { key: "5", name: "mean_curvature", label: "Mean curvature", outputs: ["depth", "mean_curvature"], moving: ["depth"], note: "κ₁ + κ₂ per mesh unit: blue convex, red concave" },
  { key: "6", name: "weight_1", label: "Weight w₁", outputs: ["depth", "weight_1"], moving: ["depth", "weight_1"], note: "which component gives the depth: red d₁, blue d₂" },
  { key: "7", name: "normals_2", label: "See-through n₂", outputs: ["depth", "normals_2"], moving: ["depth"], note: "normals of component 2, which may show what lies behind" },
];

export type Colour = readonly [number, number, number];

const VIRIDIS: Colour[] = [
  [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140],
  [34, 168, 132], [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37],
];
const [NEGATIVE, ZERO, POSITIVE]: [Colour, Colour, Colour] = [[33, 82, 171], [222, 222, 217], [191, 56, 33]];
export const DARK: Colour = [33, 43, 64];
const CLAY: Colour = [214, 201, 182];

export const mixed = (a: Colour, b: Colour, share: number): Colour => [
  a[0] + share * (b[0] - a[0]),
  a[1] + share * (b[1] - a[1]),
  a[2] + share * (b[2] - a[2]),
];

export function viridis(level: number): Colour {
  const at = Math.min(Math.max(level, 0), 1) * (VIRIDIS.length - 1);
  const low = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return mixed(VIRIDIS[low]!, VIRIDIS[low + 1]!, at - low);
}

export const diverging = (level: number): Colour => mixed(ZERO, level < 0 ? NEGATIVE : POSITIVE, Math.min(Math.abs(level), 1));

/** The values at some shares of all finite ones; zeros where there are none. */
export function quantiles(values: ArrayLike<number>, shares: number[]): number[] {
  const known = Float64Array.from(Array.from(values).filter(Number.isFinite)).sort();
  return shares.map((share) => known[Math.round(share * (known.length - 1))] ?? 0);
}

export interface Picture {
  pixels: ImageData;
  range: [number, number] | null; // of the colours, in the mode's unit
  approximate: boolean; // normals by differences
}

/** A picture of size x size rays; in one row, of any rays at rest, by the range of a picture that is `known`. */
export function picture(mode: Mode, rays: Rays, found: Answers, camera: Camera, stage: Stage, known?: Picture["range"]): Picture {
  const size = known === undefined ? Math.round(Math.sqrt(rays.count)) : rays.count;
  const pixels = new ImageData(size, known === undefined ? size : 1);
  const seen = (i: number): boolean => found.nearest[i]! >= 0;
  const exact = mode.outputs.every((name) => found.values[name]);
  const normals = found.values.normals ?? (exact ? undefined : byDifferences(rays, found, size));
  let range: [number, number] | null = null;
  let colour: (i: number) => Colour | null;
  const lit = (n: Float32Array | undefined, i: number): Colour => {
    const towards = n ? -(n[3 * i]! * rays.directions[3 * i]! + n[3 * i + 1]! * rays.directions[3 * i + 1]! + n[3 * i + 2]! * rays.directions[3 * i + 2]!) : 1;
    const sky = n ? n[3 * i]! * top[0] + n[3 * i + 1]! * top[1] + n[3 * i + 2]! * top[2] : 0;
    return mixed([24, 26, 32], CLAY, Math.min(1, 0.18 + 0.7 * Math.max(towards, 0) + 0.12 * (0.5 + 0.5 * sky)));
  };
  const top = axes(camera, stage.up)[1];
  const scalar = found.values[mode.name as Output];
  if (mode.name === "visibility") {
    colour = (i) => mixed([255, 255, 255], DARK, scalar![i]!);
    range = [0, 1];
  } else if (mode.name === "depth") {
    const [near, far] = known ?? (quantiles(found.depth, [0.01, 0.99]) as [number, number]);
    range = [near, far];
    colour = (i) => (seen(i) ? viridis(1 - (found.depth[i]! - near) / Math.max(far - near, 1e-12)) : null);
  } else if (mode.name === "weight_1" && scalar) {
    range = [0, 1];
    colour = (i) => (seen(i) ? diverging(2 * scalar[i]! - 1) : null);
  } else if (mode.name === "mean_curvature" && scalar) {
    const full = known?.[1] ?? quantiles(Array.from(scalar, (value, i) => (seen(i) ? Math.abs(value) : NaN)), [0.95])[0]!;
    range = [-full, full];
    colour = (i) => (seen(i) ? diverging(scalar[i]! / (full || 1)) : null);
  } else if (mode.name === "normals" || mode.name === "normals_2") {
    const shown = exact ? found.values[mode.name as "normals" | "normals_2"] : normals;
    colour = (i) => (seen(i) ? (shown!.subarray(3 * i, 3 * i + 3) as unknown as number[]).map((n) => 127.5 * (n + 1)) as unknown as Colour : null);
  } else {
    colour = (i) => (seen(i) ? lit(normals, i) : null);
  }
  for (let i = 0; i < rays.count; i++) {
    const rgb = colour(i);
    if (rgb) pixels.data.set([rgb[0], rgb[1], rgb[2], 255], 4 * i);
  }
  return { pixels, range, approximate: !exact };
}

/** Pixels that differ from a neighbour by more than a shade: what stairs are seen at. */
export function edges({ data, width, height }: ImageData, shade = 20): number[] {
  const rough = new Uint8Array(width * height);
  const compare = (i: number, j: number): void => {
    if ([0, 1, 2, 3].some((c) => Math.abs(data[4 * i + c]! - data[4 * j + c]!) > shade)) rough[i] = rough[j] = 1;
  };
  for (let i = 0; i < rough.length; i++) {
    if ((i + 1) % width) compare(i, i + 1);
    if (i + width < rough.length) compare(i, i + width);
  }
  return [...rough.keys()].filter((i) => rough[i]);
}

/** Give some pixels of a picture the mean of the four colours that follow each other for each. */
export function smooth(pixels: ImageData, which: readonly number[], four: ImageData): void {
  which.forEach((pixel, at) => {
    const sum = [0, 0, 0, 0];
    for (let part = 16 * at; part < 16 * at + 16; part += 4) {
      for (let c = 0; c < 4; c++) sum[c]! += (c < 3 ? four.data[part + c]! : 1) * four.data[part + 3]!;
    }
    const [r, g, b, alpha] = sum as [number, number, number, number];
    pixels.data.set(alpha ? [r / alpha, g / alpha, b / alpha, alpha / 4] : [0, 0, 0, 0], 4 * pixel);
  });
}

/** Unit normals that face back, from differences of the points that neighbouring pixels see. */
function byDifferences(rays: Rays, found: Answers, size: number): Float32Array {
  const { positions: p, directions: v } = rays;
  const normals = new Float32Array(3 * rays.count);
  const seen = (i: number): boolean => found.nearest[i]! >= 0;
  const point = (i: number): number[] => [0, 1, 2].map((axis) => p[3 * i + axis]! + found.depth[i]! * v[3 * i + axis]!);
  const step = (i: number, by: number, left: boolean, right: boolean): number[] | null => {
    const [a, b] = [right && seen(i + by) ? i + by : i, left && seen(i - by) ? i - by : i];
    if (a === b) return null;
    const [one, other] = [point(a), point(b)];
    return one.map((value, axis) => value - other[axis]!);
  };
  for (let row = 0, i = 0; row < size; row++) {
    for (let column = 0; column < size; column++, i++) {
      if (!seen(i)) continue;
      const across = step(i, 1, column > 0, column < size - 1);
      const down = step(i, size, row > 0, row < size - 1);
      let n = [-v[3 * i]!, -v[3 * i + 1]!, -v[3 * i + 2]!];
      if (across && down) {
        n = [0, 1, 2].map((k) => down[(k + 1) % 3]! * across[(k + 2) % 3]! - down[(k + 2) % 3]! * across[(k + 1) % 3]!);
        const long = Math.hypot(n[0]!, n[1]!, n[2]!) || 1;
        const sign = n[0]! * v[3 * i]! + n[1]! * v[3 * i + 1]! + n[2]! * v[3 * i + 2]! > 0 ? -1 : 1;
        n = n.map((value) => (sign * value) / long);
      }
      normals.set(n, 3 * i);
    }
  }
  return normals;
}
