/** Patches in an octree, walked along rays in double precision: as `ddf.fields.grid`, `octree.unpack` and `kernels.trace`. */

import { widthOf, type Engine, type Output, type Values, breathe } from "./engine.ts";
import type { Vector } from "./vectors.ts";

const [BASE, DEEPEST, LEAF, CUT, WIDTH] = [16, 10, 1, 2, 7];
const [LAST, ROUGH, BENT, FINENESS, FINEST, ONE] = [1, 2, 1 << 10, 11, 7, 32767]; // of a code, and of int16
const [NEAR, NEAR_ROUGH, NEAREST, ROUNDING] = [2, 0.25, 1.5e-5, 5e-6];
const [STEP, LONG] = [1e-9, 1e300]; // into a cell; in place of 1/0
const CELLS = BASE << DEEPEST; // along a side, were all cut to the end
const CHUNK = 8192; // rays between two breaths of the page

/** What Python's `viewer_page` says of patches: how many codes (one a patch), bent ones and bytes of cells there are. */
export interface PatchRecord {
  kind: "patches";
  offset: number;
  codes: number;
  bends: number;
  cells: number;
  tolerance: number;
  lower: Vector;
  upper: Vector;
}

/** Two unit tangents of a unit normal, into `out` from 0 on. */
export function tangents(x: number, y: number, z: number, out: Float64Array): void {
  const sign = z >= 0 ? 1 : -1;
  const a = -1 / (sign + z);
  const b = x * y * a;
  out[0] = 1 + sign * x * x * a;
  out[1] = sign * b;
  out[2] = -sign * x;
  out[3] = b;
  out[4] = sign + y * y * a;
  out[5] = -y;
}

export class PatchEngine implements Engine {
  readonly name = "JavaScript";
  readonly exact = true;
  readonly outputs: readonly Output[] = ["visibility", "depth", "normals", "mean_curvature"];
  private readonly codes: Uint16Array;
  private readonly nodes: Int32Array; // 0 empty, k > 0 a leaf whose patches begin at k - 1, -k < 0 the k-th that is cut
  private readonly rows: Float32Array; // normal, offset, A, B, C of each patch
  private readonly frame = new Float64Array(6);
  private readonly met = new Float64Array(5); // depth, normal, κ1 + κ2 of the ray at hand
  private hit = Infinity; // in the cell at hand

  constructor(
    private readonly record: PatchRecord,
    numbers: Float32Array,
  ) {
    let at = numbers.byteOffset + 4 * record.offset;
    const next = (bytes: number): number => (at += bytes) - bytes;
    this.codes = new Uint16Array(numbers.buffer, next(2 * record.codes), record.codes);
    const planes = new Int16Array(numbers.buffer, next(6 * record.codes), 3 * record.codes);
    const bends = new Int16Array(numbers.buffer, next(6 * record.bends), 3 * record.bends);
    const states = new Uint8Array(numbers.buffer, next(record.cells), record.cells);
    this.nodes = new Int32Array(4 * record.cells);
    this.rows = new Float32Array(WIDTH * record.codes);
    let [cell, cuts, patch, bend] = [0, 0, 0, 0];
    for (let side = 2 / BASE, end = BASE ** 3; cell < end; side /= 2, end = BASE ** 3 + 8 * cuts) {
      for (; cell < end; cell++) {
        const state = (states[cell >> 2]! >> (2 * (cell & 3))) & 3;
        if (state === CUT) this.nodes[cell] = -++cuts;
        if (state !== LEAF) continue;
        this.nodes[cell] = patch + 1;
        do {
          const [a, b, offset] = [0, 1, 2].map((i) => planes[3 * patch + i]! / ONE) as Vector;
          const z = 1 - Math.abs(a) - Math.abs(b);
          const [x, y] = [a, b].map((value) => value - (value >= 0 ? 1 : -1) * Math.max(-z, 0)) as [number, number];
          const long = Math.hypot(x, y, z);
          this.rows.set([x / long, y / long, z / long, offset * side], WIDTH * patch);
          if (!(this.codes[patch]! & BENT)) continue;
          for (let i = 0; i < 3; i++) this.rows[WIDTH * patch + 4 + i] = bends[bend++]! / ONE / side;
        } while (!(this.codes[patch++]! & LAST));
      }
    }
  }

  async evaluate(positions: Float64Array, directions: Float64Array, outputs: readonly Output[], signal?: AbortSignal): Promise<Values> {
    const count = positions.length / 3;
    const known = outputs.filter((name) => this.outputs.includes(name));
    const values: Values = Object.fromEntries(known.map((name) => [name, new Float32Array(count * widthOf(name))]));
    const { met } = this;
    for (let ray = 0; ray < count; ray++) {
      if (ray % CHUNK === CHUNK - 1) {
        await breathe();
        signal?.throwIfAborted();
      }
      if (!this.trace(positions, directions, 3 * ray)) continue;
      if (values.visibility) values.visibility[ray] = 1;
      if (values.depth) values.depth[ray] = met[0]!;
      if (values.normals) values.normals.set(met.subarray(1, 4), 3 * ray);
      if (values.mean_curvature) values.mean_curvature[ray] = met[4]!;
    }
    return values;
  }

  /** Whether the ray whose numbers begin at `at` meets anything; if so, what, in `met`. */
  private trace(p: Float64Array, v: Float64Array, at: number): boolean {
    const { lower, upper, tolerance } = this.record;
    const { nodes, codes } = this;
    const [px, py, pz] = [p[at]!, p[at + 1]!, p[at + 2]!];
    const [vx, vy, vz] = [v[at]!, v[at + 1]!, v[at + 2]!];
    const [ix, iy, iz] = [vx ? 1 / vx : LONG, vy ? 1 / vy : LONG, vz ? 1 / vz : LONG];
    const [ax, ay, az] = [(lower[0] - px) * ix, (lower[1] - py) * iy, (lower[2] - pz) * iz];
    const [bx, by, bz] = [(upper[0] - px) * ix, (upper[1] - py) * iy, (upper[2] - pz) * iz];
    const leave = Math.min(Math.max(ax, bx), Math.max(ay, by), Math.max(az, bz));
    const [sx, sy, sz] = [vx >= 0 ? 1 : 0, vy >= 0 ? 1 : 0, vz >= 0 ? 1 : 0];
    let near = 0;
    for (let t = Math.max(0, Math.min(ax, bx), Math.min(ay, by), Math.min(az, bz)); t <= leave; ) {
      const inside = t + STEP;
      let i = Math.min(Math.max(Math.trunc((px + inside * vx + 1) * (CELLS / 2)), 0), CELLS - 1);
      let j = Math.min(Math.max(Math.trunc((py + inside * vy + 1) * (CELLS / 2)), 0), CELLS - 1);
      let k = Math.min(Math.max(Math.trunc((pz + inside * vz + 1) * (CELLS / 2)), 0), CELLS - 1);
      let shift = DEEPEST;
      let node = nodes[((i >> shift) * BASE + (j >> shift)) * BASE + (k >> shift)]!;
      while (node < 0) {
        shift--;
        node = nodes[BASE ** 3 - 8 * (node + 1) + ((((i >> shift) & 1) << 2) | (((j >> shift) & 1) << 1) | ((k >> shift) & 1))]!;
      }
      const side = (2 / CELLS) * (1 << shift);
      [i, j, k] = [i >> shift, j >> shift, k >> shift];
      const end = Math.min(leave, ((i + sx) * side - 1 - px) * ix, ((j + sy) * side - 1 - py) * iy, ((k + sz) * side - 1 - pz) * iz);
      if (node > 0) {
        const [x, y, z] = [px + 1 - (i + 0.5) * side, py + 1 - (j + 0.5) * side, pz + 1 - (k + 0.5) * side];
        const code = codes[node - 1]!;
        const error = tolerance / (1 << ((code >> FINENESS) & FINEST));
        const least = Math.max(NEAREST, NEAR * error);
        near = t > side ? 0 : Math.max(near, code & ROUGH ? Math.max(least, NEAR_ROUGH * side) : least);
        const which = this.inCell(node - 1, x, y, z, vx, vy, vz, t, end, side, Math.max(error, ROUNDING), near);
        if (which >= 0) {
          this.surface(which, x + this.hit * vx, y + this.hit * vy, z + this.hit * vz, vx, vy, vz);
          return true;
        }
      }
      t = Math.max(end, t) + STEP;
    }
    return false;
  }

  /** The patch of a cell that a ray meets first, and where, in `hit`; -1 where none. */
  private inCell(
    first: number, x: number, y: number, z: number, vx: number, vy: number, vz: number,
    begin: number, end: number, side: number, error: number, near: number,
  ): number {
    const { rows, codes, frame } = this;
    let [which, count] = [-1, 1];
    this.hit = Infinity;
    while (!(codes[first + count - 1]! & LAST)) count++;
    for (let i = first; i < first + count; i++) {
      const at = WIDTH * i;
      const [nx, ny, nz, p, q, r] = [rows[at]!, rows[at + 1]!, rows[at + 2]!, rows[at + 4]!, rows[at + 5]!, rows[at + 6]!];
      let [q2, q1, q0] = [0, nx * vx + ny * vy + nz * vz, nx * x + ny * y + nz * z - rows[at + 3]!];
      if (p || q || r) {
        tangents(nx, ny, nz, frame);
        const [a, b, c, d, e, g] = frame as unknown as [number, number, number, number, number, number];
        const [u, w, vu, vw] = [a * x + b * y + c * z, d * x + e * y + g * z, a * vx + b * vy + c * vz, d * vx + e * vy + g * vz];
        q0 -= 0.5 * (p * u * u + 2 * q * u * w + r * w * w);
        q1 -= p * u * vu + q * (u * vw + w * vu) + r * w * vw;
        q2 = -0.5 * (p * vu * vu + 2 * q * vu * vw + r * vw * vw);
      }
      let [nearer, farther] = [q1 ? -q0 / q1 : Infinity, Infinity];
      if (q2) {
        const square = q1 * q1 - 4 * q2 * q0;
        if (square < 0) continue;
        const half = -0.5 * (q1 + (q1 >= 0 ? Math.sqrt(square) : -Math.sqrt(square)));
        const [one, other] = [half / q2, half ? q0 / half : Infinity];
        [nearer, farther] = [Math.min(one, other), Math.max(one, other)];
      }
      const on = begin <= side && Math.abs(q0) <= near; // the ray starts on the patch
      for (let turn = 0; turn < 2; turn++) {
        const root = turn ? farther : nearer;
        if (!(root >= 0 && root < this.hit) || (on && Math.abs(root) <= Math.min(Math.abs(nearer), Math.abs(farther)))) continue;
        const slack = Math.min(error / Math.max(Math.abs(2 * q2 * root + q1), 1e-12), 0.5 * side);
        if (root < begin - slack || root > end + slack) continue;
        let held = true;
        for (let j = 0; j < count && held; j++) {
          const cut = (codes[i]! >> (2 + 2 * j)) & 3;
          if (!cut) continue;
          const other = this.value(first + j, x + root * vx, y + root * vy, z + root * vz);
          held = (cut === 1 ? other : -other) >= -error;
        }
        if (held) [this.hit, which] = [root, i];
      }
    }
    return which;
  }

  /** f of a patch at a point from its cell's centre. */
  private value(i: number, x: number, y: number, z: number): number {
    const { rows, frame } = this;
    const at = WIDTH * i;
    const [nx, ny, nz, p, q, r] = [rows[at]!, rows[at + 1]!, rows[at + 2]!, rows[at + 4]!, rows[at + 5]!, rows[at + 6]!];
    const height = nx * x + ny * y + nz * z - rows[at + 3]!;
    if (!p && !q && !r) return height;
    tangents(nx, ny, nz, frame);
    const u = frame[0]! * x + frame[1]! * y + frame[2]! * z;
    const w = frame[3]! * x + frame[4]! * y + frame[5]! * z;
    return height - 0.5 * (p * u * u + 2 * q * u * w + r * w * w);
  }

  /** Into `met`: depth, the unit normal that faces back, and κ1 + κ2 of a patch at a point from its cell's centre. */
  private surface(i: number, x: number, y: number, z: number, vx: number, vy: number, vz: number): void {
    const at = WIDTH * i;
    const [nx, ny, nz, , a, b, c] = this.rows.subarray(at, at + WIDTH) as unknown as number[] as [number, number, number, number, number, number, number];
    const { frame, met } = this;
    tangents(nx, ny, nz, frame);
    const u = frame[0]! * x + frame[1]! * y + frame[2]! * z;
    const w = frame[3]! * x + frame[4]! * y + frame[5]! * z;
    const [p, q] = [a * u + b * w, b * u + c * w];
    const n = [0, 1, 2].map((axis) => this.rows[at + axis]! - p * frame[axis]! - q * frame[3 + axis]!) as Vector;
    const square = 1 + p * p + q * q;
    const sign = n[0] * vx + n[1] * vy + n[2] * vz > 0 ? -1 : 1;
    for (let axis = 0; axis < 3; axis++) met[1 + axis] = (sign * n[axis]!) / Math.sqrt(square);
    met[0] = this.hit;
    met[4] = (sign * ((1 + q * q) * a - 2 * p * q * b + (1 + p * p) * c)) / (square * Math.sqrt(square));
  }
}
