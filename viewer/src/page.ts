/** What the page is given: the data that Python wrote into it, and what its address asks for behind its #. */

import type { FieldRecord } from "./field.ts";
import type { Vector } from "./vectors.ts";
import type { View } from "./view.ts";

/** Record `page` of the page, see Python's `viewer_page`. */
export interface PageRecord {
  title: string;
  about: string; // one sentence
  up: "y" | "z";
  azimuth: number; // of the first picture, degrees
  corners: Vector[]; // of the box that cameras are about, frame of the world
  fields: FieldRecord[];
  box: [Vector, Vector] | null; // of a scene: what lies before it is cut away
}

export const readPage = (): PageRecord => JSON.parse(document.getElementById("ddf-page")!.textContent!) as PageRecord;

/** The numbers of the fields, which the page holds as gzip in base64. */
export async function readWeights(): Promise<ArrayBuffer> {
  const text = document.getElementById("ddf-weights")!.textContent;
  const packed = await fetch(`data:application/octet-stream;base64,${text}`); // the browser's own base64
  return new Response(packed.body!.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

export interface Asked {
  mode: string | null;
  engine: string | null; // webgl or wasm, where the page has both
  size: number | null; // pixels a side at rest
  azimuth: number | null; // degrees
  elevation: number | null;
  radius: number | null; // benchmark units
  target: Vector | null; // that the camera looks at, frame of the page
  objects: Vector[]; // where they are, in the order of the page
  slice: string | null; // name of what it shows
  axis: string | null; // x, y or z, normal to it
  at: number | null; // between the sides of the box
  v: string | null; // x, -x, ..., look
  hits: number | null; // of a field, that distances are measured to
}

export function asked(hash: string): Asked {
  const found = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name: string, low: number, high: number): number | null => {
    const value = found.get(name) === null ? NaN : Number(found.get(name));
    return Number.isFinite(value) ? Math.min(high, Math.max(low, value)) : null;
  };
  const vectors = (name: string): Vector[] => {
    const read = (found.get(name) ?? "").split(";").map((part) => part.split(",").map(Number));
    return read.every((part) => part.length === 3 && part.every(Number.isFinite)) ? (read as Vector[]) : [];
  };
  return {
    mode: found.get("mode"),
    engine: found.get("engine"),
    size: number("size", 8, 2048),
    azimuth: number("azimuth", -360, 360),
    elevation: number("elevation", -90, 90),
    radius: number("radius", 0, 20),
    target: vectors("target")[0] ?? null,
    objects: vectors("objects"),
    slice: found.get("slice"),
    axis: found.get("axis"),
    at: number("at", 0, 1),
    v: found.get("v"),
    hits: number("hits", 100, 100_000),
  };
}

/** What brings a page to what a view shows; `asked` reads it. */
export function told({ camera, mode, slice, world }: View, engine: string | null): string {
  const short = (value: number): string => `${Number(value.toPrecision(5))}`;
  const vector = (values: Vector): string => values.map(short).join(",");
  const said: Record<string, string | number | null> = {
    mode: mode.name,
    engine,
    azimuth: short(camera.azimuth),
    elevation: short(camera.elevation),
    radius: short(camera.radius),
    target: vector(camera.target),
  };
  if (slice.quantity) Object.assign(said, { slice: slice.quantity.name, axis: slice.axis, at: short(slice.at), v: slice.way });
  if (world.fields.length > 1) said.objects = world.fields.map(({ record }) => vector(record.world_from_mesh.translation)).join(";");
  return Object.entries(said).filter(([, value]) => value !== null).map((pair) => pair.join("=")).join("&");
}
