/**
 * Unsigned distances and v*: to the nearest of the hits that a field is surest of, as `ddf.fields.checked_cloud`.
 *
 * A hit of a random ray is asked for again along the same ray from before and from behind it, and along another line.
 * Of hits that are near each other those stay on which the answers agree best. Then each becomes a small disc in the
 * plane of the hits around it.
 */

import { SEEN, type Field, type World } from "./field.ts";
import { apply, inverse, random, way, type Vector } from "./vectors.ts";
import { breathe } from "./engine.ts";

const OFFSET = 0.05; // from a hit to where it is asked about; of half the longest side of the box, as is the next
const LARGEST_DOUBT = 0.18; // range of the answers along a ray, and that along another line
const [RIVALS, SURER_RIVALS] = [32, 0.3]; // nearest hits that a hit is compared with; share of surer ones from which on it goes
const LARGEST_DISC = 1.5; // radius, in those of the median disc
const LONELY = 1.75; // distance to the last of the plane's hits, in the median, from which on a hit is a stray
const PLANE_HITS = 12; // that a plane is laid through
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

  /** count: hits that are drawn of a field. */
  constructor(
    readonly count: number,
    private readonly tell: (text: string) => void,
  ) {}

  /** From points of the world (3 numbers each) to the nearest surface of all fields; infinite where none is sure. */
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
    const [hits, doubts]: [number[], number[]] = [[], []];
    if (field.engine.exact) return sure(field, this.count);
    for (let batch = 0; batch < MOST_BATCHES && doubts.length < this.count; batch++) {
      const found = await doubted(field, batch + 1);
      hits.push(...found.hits);
      doubts.push(...found.doubts);
    }
    return flat(surest(hits.slice(0, 3 * this.count), doubts.slice(0, this.count), LARGEST_DOUBT * halfSide(field)));
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

function halfSide({ record }: Field): number {
  return Math.max(...record.upper.map((high, axis) => high - record.lower[axis]!)) / 2;
}

/** Of values of rays, 3 each, those of some rays. */
function rows(values: ArrayLike<number>, rays: number[]): Float64Array {
  return Float64Array.from({ length: 3 * rays.length }, (_, i) => values[3 * rays[Math.floor(i / 3)]! + (i % 3)]!);
}

/** The points that lie in the box of a field. */
function within({ record: { lower, upper } }: Field, points: Float64Array): number[] {
  return [...Array(points.length / 3).keys()].filter((i) =>
    lower.every((low, axis) => points[3 * i + axis]! >= low && points[3 * i + axis]! <= upper[axis]!),
  );
}

/** Rays from evenly drawn points of a field's box in evenly drawn directions. */
function drawn({ record: { lower, upper } }: Field, next: () => number, count: number): { positions: Float64Array; directions: Float64Array } {
  const rays = { positions: new Float64Array(3 * count), directions: new Float64Array(3 * count) };
  for (let ray = 0; ray < count; ray++) {
    rays.positions.set(lower.map((low, axis) => low + next() * (upper[axis]! - low)), 3 * ray);
    rays.directions.set(way(next), 3 * ray);
  }
  return rays;
}

/** Discs of a field whose hits are sure, in the planes of its normals. */
async function sure(field: Field, count: number): Promise<Discs> {
  const [centres, normals]: [number[], number[]] = [[], []];
  const next = random(1);
  for (let batch = 0; batch < MOST_BATCHES && centres.length < 3 * count; batch++) {
    const { positions, directions } = drawn(field, next, BATCH);
    const found = await field.engine.evaluate(positions, directions, ["visibility", "depth", "normals"]);
    for (let i = 0; i < 3 * BATCH; i++) {
      const ray = Math.floor(i / 3);
      if (!found.visibility![ray]) continue;
      centres.push(positions[i]! + found.depth![ray]! * directions[i]!);
      normals.push(found.normals![i]!);
    }
  }
  const points = Float64Array.from(centres.slice(0, 3 * count));
  const few = Math.min(PLANE_HITS, points.length / 3);
  const radii = few ? around(points, few, ({ squared }) => Math.sqrt((2 * squared[few - 1]!) / few)) : [];
  return { centres: points, normals: Float64Array.from(normals), radii: Float64Array.from(radii), tree: new KdTree(points) };
}

/** The hits of a batch of rays, the field's frame, 3 numbers each, and how far the answers about each are apart. */
async function doubted(field: Field, seed: number): Promise<{ hits: number[]; doubts: number[] }> {
  const next = random(seed);
  const rays = drawn(field, next, BATCH);
  const first = await field.engine.evaluate(rays.positions, rays.directions, ["visibility", "depth"]);
  const ends = Float64Array.from(rays.positions, (value, i) => value + first.depth![Math.floor(i / 3)]! * rays.directions[i]!);
  const kept = within(field, ends).filter((ray) => first.visibility![ray]! >= SEEN);
  const hits = rows(ends, kept);
  const [before, behind] = await answers(field, hits, rows(rays.directions, kept));
  const lines = Float64Array.from(kept.flatMap(() => way(next)));
  const [left, right] = await answers(field, hits, lines);
  const doubts = kept.map((_, i) => {
    const along = [0, before[i]!, behind[i]!].sort((a, b) => a - b);
    return along[2]! - along[0]! + Math.min(Math.abs(left[i]!), Math.abs(right[i]!));
  });
  return { hits: [...hits], doubts };
}

/** Where the surface is seen along lines through hits, from the hit on: from before and from behind; 0 outside the box. */
async function answers(field: Field, hits: Float64Array, lines: Float64Array): Promise<[Float64Array, Float64Array]> {
  const offset = OFFSET * halfSide(field);
  const found: [Float64Array, Float64Array] = [new Float64Array(hits.length / 3), new Float64Array(hits.length / 3)];
  for (const [side, sign] of [1, -1].entries()) {
    const starts = hits.map((value, i) => value - sign * offset * lines[i]!);
    const inside = within(field, starts);
    const [positions, directions] = [rows(starts, inside), rows(lines, inside).map((value) => sign * value)];
    const { depth } = await field.engine.evaluate(positions, directions, ["depth"]);
    inside.forEach((i, at) => (found[side]![i] = sign * (depth![at]! - offset)));
  }
  return found;
}

/** Hits that few of the nearest are surer than, without those that lie alone: `checked_cloud.surest`. */
function surest(hits: ArrayLike<number>, doubts: number[], largest: number): Float64Array {
  const kept = [...doubts.keys()].filter((i) => doubts[i]! <= largest);
  const points = rows(hits, kept);
  if (kept.length <= RIVALS) return points;
  const doubt = kept.map((i) => doubts[i]!);
  const surer = around(points, RIVALS + 1, ({ index }, i) => index.filter((rival) => doubt[rival]! < doubt[i]!).length);
  const sure = rows(points, [...surer.keys()].filter((i) => surer[i]! < SURER_RIVALS * RIVALS));
  if (sure.length / 3 <= PLANE_HITS) return sure;
  const reach = around(sure, PLANE_HITS, ({ squared }) => Math.sqrt(squared[PLANE_HITS - 1]!));
  const median = reach.slice().sort((a, b) => a - b)[reach.length >> 1]!;
  return rows(sure, [...reach.keys()].filter((i) => reach[i]! <= LONELY * median));
}

/** What is found of the `count` points nearest to each point, itself among them. */
function around<T>(points: Float64Array, count: number, find: (near: Near, i: number) => T): T[] {
  const tree = new KdTree(points);
  const near: Near = { index: new Int32Array(count), squared: new Float64Array(count) };
  return [...Array(points.length / 3).keys()].map((i) => {
    tree.find(points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!, near);
    return find(near, i);
  });
}

/** Each point moved onto the plane of least squares through those around it: `checked_cloud.flat_discs`. */
function flat(points: Float64Array): Discs {
  const count = points.length / 3;
  const discs = { centres: points, normals: new Float64Array(3 * count), radii: new Float64Array(count) };
  if (count <= PLANE_HITS) return { ...discs, tree: new KdTree(points) };
  discs.centres = points.slice();
  around(points, PLANE_HITS, (near, i) => {
    const others = Array.from(near.index, (row) => points.subarray(3 * row, 3 * row + 3));
    const middle = [0, 1, 2].map((axis) => others.reduce((sum, point) => sum + point[axis]!, 0) / PLANE_HITS);
    const spread = (a: number, b: number): number =>
      others.reduce((sum, point) => sum + (point[a]! - middle[a]!) * (point[b]! - middle[b]!), 0);
    const normal = flattest([spread(0, 0), spread(0, 1), spread(0, 2), spread(1, 1), spread(1, 2), spread(2, 2)]);
    const height = normal.reduce((sum, value, axis) => sum + value * (points[3 * i + axis]! - middle[axis]!), 0);
    for (let axis = 0; axis < 3; axis++) discs.centres[3 * i + axis]! -= height * normal[axis]!;
    discs.normals.set(normal, 3 * i);
    discs.radii[i] = Math.sqrt((2 * near.squared[PLANE_HITS - 1]!) / PLANE_HITS);
  });
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

export interface Near {
  index: Int32Array; // nearest first
  squared: Float64Array; // distances
}

export class KdTree {
  private readonly order: Int32Array; // rows of points; the middle of a range parts it
  private readonly sought: [number, number, number] = [0, 0, 0];

  /** points: 3 numbers each. */
  constructor(private readonly points: Float64Array) {
    this.order = Int32Array.from({ length: points.length / 3 }, (_, row) => row);
    this.part(0, this.order.length - 1, 0);
  }

  /** Fill `near` with as many of the points as it takes; what is left over keeps an infinite distance. */
  find(x: number, y: number, z: number, near: Near): void {
    this.sought[0] = x;
    this.sought[1] = y;
    this.sought[2] = z;
    near.squared.fill(Infinity);
    near.index.fill(-1);
    this.search(0, this.order.length - 1, 0, near);
  }

  private search(low: number, high: number, axis: number, near: Near): void {
    if (low > high) return;
    const middle = (low + high) >> 1;
    const row = this.order[middle]!;
    const { points, sought } = this;
    const [a, b, c] = [points[3 * row]! - sought[0], points[3 * row + 1]! - sought[1], points[3 * row + 2]! - sought[2]];
    keep(near, row, a * a + b * b + c * c);
    const beyond = axis === 0 ? a : axis === 1 ? b : c; // of the point, seen from what is sought
    const next = (axis + 1) % 3;
    if (beyond > 0) this.search(low, middle - 1, next, near);
    else this.search(middle + 1, high, next, near);
    if (beyond * beyond >= near.squared[near.squared.length - 1]!) return;
    if (beyond > 0) this.search(middle + 1, high, next, near);
    else this.search(low, middle - 1, next, near);
  }

  /** Halve a range by the median of an axis (quickselect), then its halves. */
  private part(low: number, high: number, axis: number): void {
    if (low >= high) return;
    const middle = (low + high) >> 1;
    const { order, points } = this;
    for (let [left, right] = [low, high]; left < right; ) {
      const pivot = points[3 * order[middle]! + axis]!;
      let [i, j] = [left, right];
      while (i <= j) {
        while (points[3 * order[i]! + axis]! < pivot) i++;
        while (points[3 * order[j]! + axis]! > pivot) j--;
        if (i > j) break;
        [order[i], order[j]] = [order[j]!, order[i]!];
        i++;
        j--;
      }
      if (j < middle) left = i;
      if (middle < i) right = j;
    }
    this.part(low, middle - 1, (axis + 1) % 3);
    this.part(middle + 1, high, (axis + 1) % 3);
  }
}

function keep(near: Near, row: number, squared: number): void {
  let at = near.squared.length - 1;
  if (squared >= near.squared[at]!) return;
  for (; at > 0 && near.squared[at - 1]! > squared; at--) {
    near.squared[at] = near.squared[at - 1]!;
    near.index[at] = near.index[at - 1]!;
  }
  near.squared[at] = squared;
  near.index[at] = row;
}
