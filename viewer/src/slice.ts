/** A plane across the box that shows what a field says at its points; what lies between the camera and it is cut away. */

import { axes, type Camera, type Rays, type Stage } from "./camera.ts";
import type { Distances } from "./distances.ts";
import { query, type Starts, type World } from "./field.ts";
import { DARK, mixed, quantiles, viridis, type Colour } from "./shading.ts";
import { scaled, type Vector } from "./vectors.ts";

export interface Quantity {
  name: string;
  label: string;
  note: string;
}

export const QUANTITIES: Quantity[] = [
  { name: "depth", label: "Depth d along v", note: "from the slice along v, near yellow; clear where v meets nothing" },
  { name: "visibility", label: "Visibility ξ along v", note: "whether v meets something: 0 white, 1 dark" },
  { name: "udf", label: "Distance UDF", note: "to the surest of {hits} hits, near yellow" },
  { name: "closest", label: "Direction v*", note: "to the surest of {hits} hits, axes as red, green, blue" },
];
export const AXES = ["x", "y", "z"] as const;
export const WAYS = ["x", "-x", "y", "-y", "z", "-z", "look"] as const; // the last: as the camera looks
export const LINES_FROM = 128; // pixels a side of the smallest picture with lines of equal values

/** Which slice is asked for. */
export class Slice {
  quantity: Quantity | null = null;
  axis: (typeof AXES)[number]; // that is normal to it
  at = 0.5; // between the two sides of the box
  way: (typeof WAYS)[number]; // v

  /** Across the axis that a camera looks along most, and v within it. */
  constructor(camera: Camera, stage: Stage) {
    const back = axes(camera, stage.up)[2].map(Math.abs);
    this.axis = AXES[back.indexOf(Math.max(...back))]!;
    this.way = this.axis === "x" ? "z" : "x";
  }
}

/** What a slice shows to the rays of a picture. */
export interface Sliced {
  starts: Starts; // of rays that go on behind it
  index: Int32Array; // of the rays that meet it within the box
  points: Float64Array; // where, 3 numbers each, frame of the world
  values: Float32Array; // there: 1 number each, of `closest` 3
  evaluated: number; // rays that fields were asked for
}

/** The box of the stage along the axes of the world. */
export const sides = (stage: Stage): { lower: Vector; upper: Vector } => {
  const of = (choose: (...values: number[]) => number): Vector =>
    [0, 1, 2].map((axis) => choose(...stage.corners.map((corner) => corner[axis]!))) as Vector;
  return { lower: of(Math.min), upper: of(Math.max) };
};

/** Where a slice is on its axis, unit of the world. */
export function position(slice: Slice, stage: Stage): number {
  const [{ lower, upper }, axis] = [sides(stage), AXES.indexOf(slice.axis)];
  return lower[axis]! + slice.at * (upper[axis]! - lower[axis]!);
}

export function direction(slice: Slice, camera: Camera, stage: Stage): Vector {
  if (slice.way === "look") return scaled(axes(camera, stage.up)[2], -1);
  const sign = slice.way.startsWith("-") ? -1 : 1;
  return AXES.map((name) => (slice.way.endsWith(name) ? sign : 0)) as Vector;
}

/** What the slice shows; rays go on from it where it is clear, and where they pass the box before it. */
export async function cut(
  slice: Slice & { quantity: Quantity },
  world: World,
  stage: Stage,
  camera: Camera,
  rays: Rays,
  distances: Distances,
  signal?: AbortSignal,
): Promise<Sliced> {
  const { starts, index } = onPlane(slice, stage, rays);
  const points = Float64Array.from({ length: 3 * index.length }, (_, i) => starts.rays.positions[3 * index[Math.floor(i / 3)]! + (i % 3)]!);
  const name = slice.quantity.name;
  const found: Sliced = { starts, index, points, values: new Float32Array(0), evaluated: 0 };
  const clear = (i: number): boolean => name === "depth" && found.values[i] === Infinity;
  if (name === "udf" || name === "closest") {
    const closest = await distances.closest(world, points, signal);
    found.values = name === "udf" ? closest.distances : closest.directions;
  } else {
    const v = direction(slice, camera, stage);
    const asked: Rays = { positions: points, directions: points.map((_, i) => v[i % 3]!), count: index.length };
    const said = await query(world, asked, [name === "depth" ? "depth" : "visibility"], signal);
    found.values = said.values[name === "depth" ? "depth" : "visibility"]!;
    found.evaluated = said.evaluated;
  }
  index.forEach((ray, i) => !clear(i) && starts.rays.positions.fill(Infinity, 3 * ray, 3 * ray + 3)); // it ends here
  return found;
}

/** Rays from where they cross the plane, and which of them do so within the box; those that never do begin nowhere. */
function onPlane(slice: Slice, stage: Stage, rays: Rays): { starts: Starts; index: Int32Array } {
  const [{ lower, upper }, axis, level] = [sides(stage), AXES.indexOf(slice.axis), position(slice, stage)];
  const positions = new Float64Array(3 * rays.count).fill(Infinity);
  const distances = new Float64Array(rays.count);
  const inside: number[] = [];
  const others = [0, 1, 2].filter((other) => other !== axis);
  for (let ray = 0; ray < rays.count; ray++) {
    const far = (level - rays.positions[3 * ray + axis]!) / rays.directions[3 * ray + axis]!;
    if (!(far >= 0 && far < Infinity)) continue;
    distances[ray] = far;
    for (const other of others) positions[3 * ray + other] = rays.positions[3 * ray + other]! + far * rays.directions[3 * ray + other]!;
    positions[3 * ray + axis] = level;
    if (others.every((other) => positions[3 * ray + other]! >= lower[other]! && positions[3 * ray + other]! <= upper[other]!)) inside.push(ray);
  }
  return { starts: { rays: { ...rays, positions }, distances }, index: Int32Array.from(inside) };
}

/** Lines of equal values are drawn at multiples of this: 1, 2 or 5 times a power of ten, some eight over the range. */
export function lineStep(range: number): number {
  const power = 10 ** Math.floor(Math.log10(Math.max(range, 1e-12) / 8));
  return power * ([1, 2, 5].find((factor) => factor * power >= range / 8) ?? 10);
}

/** Paint a slice over a picture; returns the range of its colours, null of directions. */
export function paint(slice: Slice & { quantity: Quantity }, found: Sliced, pixels: ImageData): [number, number] | null {
  const { index, values } = found;
  const name = slice.quantity.name;
  const [most] = name === "visibility" ? [1] : quantiles(values, [0.99]);
  const lined = name === "udf" || name === "depth";
  const step = lineStep(most!);
  const steps = new Map<number, number>(); // by ray: between which lines it is
  if (lined && pixels.width >= LINES_FROM) index.forEach((ray, i) => steps.set(ray, Math.floor(values[i]! / step)));
  index.forEach((ray, i) => {
    const colour: Colour | null =
      name === "closest" ? [0, 1, 2].map((axis) => 127.5 * (values[3 * i + axis]! + 1)) as unknown as Colour
      : name === "visibility" ? mixed([255, 255, 255], DARK, values[i]!)
      : Number.isFinite(values[i]!) ? viridis(1 - values[i]! / (most || 1))
      : null;
    if (!colour) return;
    const own = steps.get(ray);
    const line = own !== undefined && [ray + 1, ray + pixels.width].some((other) => (steps.get(other) ?? own) !== own);
    const shown = line ? mixed(colour, [0, 0, 0], 0.45) : colour;
    pixels.data.set([shown[0], shown[1], shown[2], 255], 4 * ray);
  });
  return name === "closest" ? null : [0, most!];
}
