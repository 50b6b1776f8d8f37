/**
 * Unsigned distances and v*: to the nearest of hits that a field confirms, as `ddf.fields.checked_cloud`.
 *
 * A hit of a random ray is asked for again along the same ray from before and from behind it; one on which the answers
 * agree stays. Then each becomes a small disc in the plane of the hits around it.
 */

import { random, way } from "./cloud.ts";
import type { Field, World } from "./field.ts";
import { KdTree, type Near } from "./kdtree.ts";
import { breathe } from "./pacing.ts";
import { apply, inverse, type Vector } from "./vectors.ts";

const LEAST_VISIBILITY = 0.9;
const STEPS = [-0.05, 0.05, -0.1, 0.1]; // of half the longest side of the box, as is the next
const LARGEST_SPREAD = 0.015; // mean distance of the answers from their median
const LARGEST_DISC = 1.5; // radius, in those of the median disc
const PLANE_HITS = 16; // that a plane is laid through
const [BATCH, MOST_BATCHES] = [4096, 40]; // rays
const PIECE = 4096; // points between two breaths of the page

/** Discs of a field, its frame. */
interface Discs {
  centres: Float64Array;
  normals: Float64Array;
  radii: Float64Array;
  tree: KdTree;
}

export interface Closest {
  distances: Float32Array;
  directions: Float32Array; // unit, 0 where the distance is 0
}

export class Distances {
  private readonly known = new Map<Field, Promise<Discs>>();

  /** count: hits of a field. */
  constructor(
    readonly count: number,
    private readonly tell: (text: string) => void,
  ) {}

  /** The fields have become others. */
  forget(): void {
    this.known.clear();
  }

  /** From points of the world (3 numbers each) to the nearest surface of all fields; infinite where none is confirmed. */
  async closest(world: World, points: Float64Array, signal?: AbortSignal): Promise<Closest> {
    const count = points.length / 3;
    const found: Closest = { distances: new Float32Array(count).fill(Infinity), directions: new Float32Array(3 * count) };
    for (const field of world.fields) {
      const discs = await this.discs(field);
      const [there, back] = [field.fieldFromWorld, inverse(field.fieldFromWorld)];
      const near: Near = { index: new Int32Array(1), squared: new Float64Array(1) };
      for (let i = 0; i < count && discs.radii.length; i++) {
        if (i % PIECE === PIECE - 1) {
          await breathe();
          signal?.throwIfAborted();
        }
        const at: Vector = apply(there, [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!]);
        discs.tree.find(at[0], at[1], at[2], near);
        const foot = toFoot(discs, near.index[0]!, at);
        const long = Math.hypot(foot[0], foot[1], foot[2]);
        if (long * back.scale >= found.distances[i]!) continue;
        found.distances[i] = long * back.scale;
        for (let axis = 0; axis < 3; axis++) {
          const row = back.rotation[axis]!;
          found.directions[3 * i + axis] = (row[0] * foot[0] + row[1] * foot[1] + row[2] * foot[2]) / (long || 1);
        }
      }
    }
    return found;
  }

  private discs(field: Field): Promise<Discs> {
    const known = this.known.get(field) ?? this.draw(field);
    this.known.set(field, known);
    return known;
  }

  private async draw(field: Field): Promise<Discs> {
    this.tell(`drawing ${this.count.toLocaleString("en")} hits of ${field.record.name} to measure distances to`);
    const hits: number[] = [];
    for (let batch = 0; batch < MOST_BATCHES && hits.length < 3 * this.count; batch++) {
      hits.push(...(await confirmed(field, batch + 1)));
    }
    return flat(Float64Array.from(hits.slice(0, 3 * this.count)));
  }
}

/** From a point to the point of a disc that is closest to it. */
function toFoot({ centres, normals, radii }: Discs, disc: number, at: Vector): Vector {
  const [c, n] = [centres.subarray(3 * disc, 3 * disc + 3), normals.subarray(3 * disc, 3 * disc + 3)];
  const away = [at[0] - c[0]!, at[1] - c[1]!, at[2] - c[2]!] as const;
  const height = away[0] * n[0]! + away[1] * n[1]! + away[2] * n[2]!;
  const within = away.map((value, axis) => value - height * n[axis]!);
  const long = Math.hypot(within[0]!, within[1]!, within[2]!);
  const share = Math.min(1, radii[disc]! / (long || 1));
  return [0, 1, 2].map((axis) => share * within[axis]! - away[axis]!) as Vector;
}

/** The hits of a batch of rays that a field confirms, its frame, 3 numbers each. */
async function confirmed(field: Field, seed: number): Promise<number[]> {
  const { lower, upper } = field.record;
  const unit = Math.max(...upper.map((high, axis) => high - lower[axis]!)) / 2;
  const next = random(seed);
  const rays = { positions: new Float32Array(3 * BATCH), directions: new Float32Array(3 * BATCH) };
  for (let ray = 0; ray < BATCH; ray++) {
    rays.positions.set(lower.map((low, axis) => low + next() * (upper[axis]! - low)), 3 * ray);
    rays.directions.set(way(next), 3 * ray);
  }
  const first = await field.engine.evaluate(rays.positions, rays.directions, ["visibility", "depth"]);
  const seen = [...first.visibility!.keys()].filter((ray) => first.visibility![ray]! >= LEAST_VISIBILITY);
  const hits = Float64Array.from({ length: 3 * seen.length }, (_, i) => {
    const at = 3 * seen[Math.floor(i / 3)]! + (i % 3);
    return rays.positions[at]! + first.depth![seen[Math.floor(i / 3)]!]! * rays.directions[at]!;
  });
  const inBox = (values: ArrayLike<number>, i: number): boolean =>
    lower.every((low, axis) => values[3 * i + axis]! >= low && values[3 * i + axis]! <= upper[axis]!);
  const answers = seen.map(() => [0, 0, 0, 0, 0]); // of how far ahead of the hit the surface is
  for (const [number, share] of STEPS.entries()) {
    const step = share * unit;
    const starts = hits.map((value, i) => value + step * rays.directions[3 * seen[Math.floor(i / 3)]! + (i % 3)]!);
    const inside = [...seen.keys()].filter((i) => inBox(starts, i));
    const pick = (from: (i: number, axis: number) => number): Float32Array =>
      Float32Array.from({ length: 3 * inside.length }, (_, i) => from(inside[Math.floor(i / 3)]!, i % 3));
    const positions = pick((i, axis) => starts[3 * i + axis]!);
    const directions = pick((i, axis) => -Math.sign(step) * rays.directions[3 * seen[i]! + axis]!);
    const found = await field.engine.evaluate(positions, directions, ["depth"]);
    inside.forEach((i, at) => (answers[i]![number + 1] = step - Math.sign(step) * found.depth![at]!));
  }
  const agreed = (values: number[]): boolean => {
    const median = values.slice().sort((a, b) => a - b)[2]!;
    return values.reduce((sum, value) => sum + Math.abs(value - median), 0) / values.length <= LARGEST_SPREAD * unit;
  };
  return answers.flatMap((values, i) => (inBox(hits, i) && agreed(values) ? [...hits.subarray(3 * i, 3 * i + 3)] : []));
}

/** Each point moved onto the plane of least squares through those around it: `checked_cloud.flat_discs`. */
function flat(points: Float64Array): Discs {
  const count = points.length / 3;
  const discs = { centres: points, normals: new Float64Array(3 * count), radii: new Float64Array(count) };
  if (count <= PLANE_HITS) return { ...discs, tree: new KdTree(points) };
  discs.centres = points.slice();
  const tree = new KdTree(points);
  const near: Near = { index: new Int32Array(PLANE_HITS), squared: new Float64Array(PLANE_HITS) };
  for (let i = 0; i < count; i++) {
    tree.find(points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!, near);
    const around = Array.from(near.index, (row) => points.subarray(3 * row, 3 * row + 3));
    const middle = [0, 1, 2].map((axis) => around.reduce((sum, point) => sum + point[axis]!, 0) / PLANE_HITS);
    const spread = (a: number, b: number): number =>
      around.reduce((sum, point) => sum + (point[a]! - middle[a]!) * (point[b]! - middle[b]!), 0);
    const normal = flattest([spread(0, 0), spread(0, 1), spread(0, 2), spread(1, 1), spread(1, 2), spread(2, 2)]);
    const height = normal.reduce((sum, value, axis) => sum + value * (points[3 * i + axis]! - middle[axis]!), 0);
    for (let axis = 0; axis < 3; axis++) discs.centres[3 * i + axis]! -= height * normal[axis]!;
    discs.normals.set(normal, 3 * i);
    discs.radii[i] = Math.sqrt((2 * near.squared[PLANE_HITS - 1]!) / PLANE_HITS);
  }
  const largest = LARGEST_DISC * discs.radii.slice().sort()[count >> 1]!;
  discs.radii.forEach((radius, i) => (discs.radii[i] = Math.min(radius, largest)));
  return { ...discs, tree: new KdTree(discs.centres) };
}

/** The unit eigenvector of the least eigenvalue of a symmetric matrix xx, xy, xz, yy, yz, zz, by its closed form. */
export function flattest([xx, xy, xz, yy, yz, zz]: [number, number, number, number, number, number]): Vector {
  const mean = (xx + yy + zz) / 3;
  const [a, b, c] = [xx - mean, yy - mean, zz - mean];
  const size = Math.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6) || 1e-300;
  const half = (a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)) / (2 * size ** 3);
  const least = mean + 2 * size * Math.cos(Math.acos(Math.min(1, Math.max(-1, half))) / 3 + (2 * Math.PI) / 3);
  const rows: Vector[] = [[xx - least, xy, xz], [xy, yy - least, yz], [xz, yz, zz - least]];
  let [best, longest]: [Vector, number] = [[0, 0, 1], 0];
  for (const [i, j] of [[0, 1], [1, 2], [2, 0]] as const) {
    const [r, s] = [rows[i]!, rows[j]!];
    const normal: Vector = [r[1] * s[2] - r[2] * s[1], r[2] * s[0] - r[0] * s[2], r[0] * s[1] - r[1] * s[0]];
    const long = Math.hypot(...normal);
    if (long > longest) [best, longest] = [normal.map((value) => value / long) as Vector, long];
  }
  return best;
}
