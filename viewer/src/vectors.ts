/** Vectors, rotations and similarities in double precision: as `ddf.geometry.transforms`. */

export type Vector = [number, number, number];
export type Matrix = [Vector, Vector, Vector]; // rows

export const IDENTITY: Matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a: Vector, b: Vector): Vector => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const scaled = (a: Vector, factor: number): Vector => [a[0] * factor, a[1] * factor, a[2] * factor];
export const cross = (a: Vector, b: Vector): Vector => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const length = (a: Vector): number => Math.sqrt(dot(a, a));
export const unit = (a: Vector): Vector => scaled(a, 1 / length(a));
export const times = (m: Matrix, a: Vector): Vector => [dot(m[0], a), dot(m[1], a), dot(m[2], a)];
export const transposed = (m: Matrix): Matrix => [
  [m[0][0], m[1][0], m[2][0]],
  [m[0][1], m[1][1], m[2][1]],
  [m[0][2], m[1][2], m[2][2]],
];
export const product = (a: Matrix, b: Matrix): Matrix => {
  const columns = transposed(b);
  return a.map((row) => columns.map((column) => dot(row, column))) as Matrix;
};

/** y = scale R x + translation. */
export interface Similarity {
  scale: number;
  rotation: Matrix;
  translation: Vector;
}

export const apply = (map: Similarity, point: Vector): Vector =>
  add(scaled(times(map.rotation, point), map.scale), map.translation);

/** The map x -> outer(inner(x)). */
export const compose = (outer: Similarity, inner: Similarity): Similarity => ({
  scale: outer.scale * inner.scale,
  rotation: product(outer.rotation, inner.rotation),
  translation: apply(outer, inner.translation),
});

export const inverse = (map: Similarity): Similarity => {
  const rotation = transposed(map.rotation);
  return {
    scale: 1 / map.scale,
    rotation,
    translation: scaled(times(rotation, map.translation), -1 / map.scale),
  };
};

/** The eight corners of a box. */
export const corners = (lower: Vector, upper: Vector): Vector[] =>
  [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => [
    bits & 1 ? upper[0] : lower[0],
    bits & 2 ? upper[1] : lower[1],
    bits & 4 ? upper[2] : lower[2],
  ]);

/** Numbers in [0, 1) that are the same every time (mulberry32). */
export function random(seed: number): () => number {
  let state = seed;
  return () => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** An evenly drawn direction. */
export function way(next: () => number): Vector {
  const height = 2 * next() - 1;
  const turn = 2 * Math.PI * next();
  const flat = Math.sqrt(1 - height * height);
  return [flat * Math.cos(turn), height, flat * Math.sin(turn)];
}
