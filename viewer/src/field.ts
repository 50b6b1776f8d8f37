/** Fields that stand in a world, asked along rays: as `ddf.fields.framed_field.query` and `ddf.api.scene`. */

import { widthOf, type Engine, type Output } from "./engine.ts";
import type { Rays } from "./camera.ts";
import type { NetworkRecord } from "./network.ts";
import type { PatchRecord } from "./patches.ts";
import { compose, corners, inverse, type Similarity, type Vector } from "./vectors.ts";

export const SEEN = 0.5; // visibility from which on a surface counts as seen

/** What Python's `viewer_page` says of a field. */
export type FieldRecord = (NetworkRecord | PatchRecord) & {
  name: string;
  lower: Vector; // of the box, frame of the field
  upper: Vector;
  field_from_mesh: Similarity;
  world_from_mesh: Similarity;
};

/** Fields, and the box that rays from outside enter first: what lies before it is cut away. */
export interface World {
  fields: readonly Field[];
  box: [Vector, Vector] | null;
}

/** Answers in the frame of the world. Where nothing is seen depth is infinite and all but the visibility is 0. */
export interface Answers {
  values: Partial<Record<Output, Float32Array>>;
  depth: Float64Array;
  nearest: Int8Array; // which field is seen, -1 where none is
  seen: number;
  evaluated: number; // rays that a field was asked for, all fields together
}

/** Rays from points further along, and how far these are. */
export interface Starts {
  rays: Rays;
  distances: Float64Array;
}

export class Field {
  constructor(
    readonly record: FieldRecord,
    readonly engine: Engine,
  ) {}

  get fieldFromWorld(): Similarity {
    return compose(this.record.field_from_mesh, inverse(this.record.world_from_mesh));
  }

  /** Corners of its box and its middle, frame of the world. */
  get worldCorners(): Vector[] {
    const worldFromField = inverse(this.fieldFromWorld);
    return corners(this.record.lower, this.record.upper).map((corner) => move(worldFromField, corner));
  }
}

const move = (map: Similarity, p: Vector): Vector =>
  map.rotation.map((row, i) => map.scale * (row[0] * p[0] + row[1] * p[1] + row[2] * p[2]) + map.translation[i]!) as Vector;

/** Rays of one field: where they enter its box (its frame), how far that is, and which of all rays they are. */
interface Entered {
  index: Int32Array;
  positions: Float64Array;
  directions: Float64Array;
  distances: Float64Array;
}

/** Slab test in double precision (`rays.enter_box`); only rays that meet the box before `limit` (world units) are kept. */
export function enterBox(field: Field, rays: Rays, limit: Float64Array): Entered {
  const map = field.fieldFromWorld;
  const [[a, b, c], [d, e, f], [g, h, i]] = map.rotation;
  const { lower, upper } = field.record;
  const { exact } = field.engine;
  const index = new Int32Array(rays.count);
  const positions = new Float64Array(3 * rays.count);
  const directions = new Float64Array(3 * rays.count);
  const distances = new Float64Array(rays.count);
  const [p, v] = [[0, 0, 0], [0, 0, 0]];
  let kept = 0;
  for (let ray = 0; ray < rays.count; ray++) {
    const [x, y, z] = [rays.positions[3 * ray]!, rays.positions[3 * ray + 1]!, rays.positions[3 * ray + 2]!];
    const [s, t, u] = [rays.directions[3 * ray]!, rays.directions[3 * ray + 1]!, rays.directions[3 * ray + 2]!];
    p[0] = map.scale * (a * x + b * y + c * z) + map.translation[0];
    p[1] = map.scale * (d * x + e * y + f * z) + map.translation[1];
    p[2] = map.scale * (g * x + h * y + i * z) + map.translation[2];
    v[0] = a * s + b * t + c * u;
    v[1] = d * s + e * t + f * u;
    v[2] = g * s + h * t + i * u;
    const [near, far] = span(p, v, lower, upper);
    if (!(near <= far) || near / map.scale >= limit[ray]!) continue;
    index[kept] = ray;
    distances[kept] = exact ? 0 : near;
    for (let axis = 0; axis < 3; axis++) {
      const entry = p[axis]! + near * v[axis]!;
      positions[3 * kept + axis] = exact ? p[axis]! : Math.min(Math.max(entry, lower[axis]!), upper[axis]!);
      directions[3 * kept + axis] = v[axis]!;
    }
    kept++;
  }
  return {
    index: index.subarray(0, kept),
    positions: positions.subarray(0, 3 * kept),
    directions: directions.subarray(0, 3 * kept),
    distances: distances.subarray(0, kept),
  };
}

/**
 * The nearest of what the fields say along rays: [DDF22] §4.1 with the hard choice. Fields are asked from the nearest on,
 * and no field for rays that have hit something before they reach its box; unless visibility is asked for, of which the
 * largest is shown.
 *
 * @param later where the rays begin instead; depth is still from where they are.
 */
export async function query(
  world: World,
  rays: Rays,
  outputs: readonly Output[],
  signal?: AbortSignal,
  later?: Starts,
): Promise<Answers> {
  const found: Answers = {
    values: Object.fromEntries(outputs.map((name) => [name, new Float32Array(rays.count * widthOf(name))])),
    depth: new Float64Array(rays.count).fill(Infinity),
    nearest: new Int8Array(rays.count).fill(-1),
    seen: 0,
    evaluated: 0,
  };
  const start: Vector = [rays.positions[0]!, rays.positions[1]!, rays.positions[2]!];
  const away = (field: Field): number =>
    Math.min(...field.worldCorners.map((corner) => Math.hypot(...corner.map((value, i) => value - start[i]!))));
  const asked = later?.rays ?? rays;
  const cut = world.box && cutAway(asked, world.box);
  const order = world.fields.map((field, index) => ({ field, index, far: away(field) })).sort((a, b) => a.far - b.far);
  for (const { field, index } of order) await ask(field, index, cut?.rays ?? asked, outputs, found, signal);
  for (const { distances } of [later, cut].filter((each) => !!each)) distances.forEach((by, ray) => (found.depth[ray]! += by));
  found.seen = found.nearest.reduce((sum, which) => sum + (which >= 0 ? 1 : 0), 0);
  if (found.values.depth) found.values.depth.set(found.depth);
  return found;
}

/** Rays from where they enter a box, and how far that is; those that miss it start so far away that they miss all. */
function cutAway(rays: Rays, [lower, upper]: [Vector, Vector]): Starts {
  const positions = rays.positions.slice();
  const distances = new Float64Array(rays.count);
  for (let ray = 0; ray < rays.count; ray++) {
    const [p, v] = [rays.positions, rays.directions].map((all) => all.subarray(3 * ray, 3 * ray + 3)) as [Float64Array, Float64Array];
    const [near, far] = span(p, v, lower, upper);
    distances[ray] = near <= far ? near : 0;
    for (let axis = 0; axis < 3; axis++) positions[3 * ray + axis] = near <= far ? p[axis]! + near * v[axis]! : Infinity;
  }
  return { rays: { ...rays, positions }, distances };
}

/** First and last distance at which a ray is in a box (`rays.box_span`); it misses where the first is larger. */
function span(p: ArrayLike<number>, v: ArrayLike<number>, lower: Vector, upper: Vector): [number, number] {
  let [near, far] = [0, Infinity];
  for (let axis = 0; axis < 3; axis++) {
    if (v[axis] === 0) {
      if (!(p[axis]! >= lower[axis]! && p[axis]! <= upper[axis]!)) far = -Infinity;
      continue;
    }
    const [one, other] = [(lower[axis]! - p[axis]!) / v[axis]!, (upper[axis]! - p[axis]!) / v[axis]!];
    near = Math.max(near, Math.min(one, other));
    far = Math.min(far, Math.max(one, other));
  }
  return [near, far];
}

async function ask(
  field: Field,
  which: number,
  rays: Rays,
  outputs: readonly Output[],
  found: Answers,
  signal?: AbortSignal,
): Promise<void> {
  const all = found.values.visibility;
  const entered = enterBox(field, rays, found.depth);
  const names = new Set<Output>(["visibility", "depth", ...outputs]);
  const answers = await field.engine.evaluate(entered.positions, entered.directions, [...names], signal);
  const { scale, rotation } = field.fieldFromWorld;
  found.evaluated += entered.index.length;
  entered.index.forEach((ray, at) => {
    const visibility = answers.visibility![at]!;
    const depth = (answers.depth![at]! + entered.distances[at]!) / scale;
    if (all && found.depth[ray] === Infinity) all[ray] = Math.max(all[ray]!, visibility);
    if (visibility < SEEN || depth >= found.depth[ray]!) return;
    found.depth[ray] = depth;
    if (all) all[ray] = visibility;
    found.nearest[ray] = which;
    for (const name of outputs) {
      const [target, given] = [found.values[name]!, answers[name]!];
      if (name === "visibility" || name === "depth") continue;
      if (widthOf(name) === 1) {
        target[ray] = given[at]! * (name === "mean_curvature" ? scale : 1);
        continue;
      }
      for (let axis = 0; axis < 3; axis++) {
        let sum = 0;
        for (let row = 0; row < 3; row++) sum += rotation[row]![axis]! * given[3 * at + row]!;
        target[3 * ray + axis] = sum;
      }
    }
  });
}
