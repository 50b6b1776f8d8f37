/** Cameras and their pixel rays: as `ddf.geometry.cameras` and `framed_field.camera_rays`, in the frame of the world. */

import { add, dot, length, scaled, times, transposed, type Matrix, type Vector } from "./vectors.ts";

const FOCAL = 149.84375 / 68.5; // tangent of half the angle of view is its inverse
const FRAMED = 0.95; // of a picture's half width, that a framed box takes
const BENCHMARK_FROM_V1 = 0.57;

/**
 * Where a camera stands: it looks at `target` from `radius` (benchmark units: 0.57 is one diagonal of the box).
 * Angles in degrees.
 */
export interface Camera {
  azimuth: number;
  elevation: number;
  radius: number;
  target: Vector;
}

/** The box that cameras are about, by its eight corners in the frame of the world, and the axis that points up. */
export interface Stage {
  corners: Vector[]; // the first and the last are opposite
  up: "y" | "z";
}

export interface Rays {
  positions: Float64Array; // 3 a ray
  directions: Float64Array; // unit
  count: number;
}

const UP_FROM_Y: Record<Stage["up"], Matrix> = {
  y: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  z: [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
};

export const centre = (stage: Stage): Vector => scaled(add(stage.corners[0]!, stage.corners[7]!), 0.5);

export const diagonal = (stage: Stage): number => length(add(stage.corners[7]!, scaled(stage.corners[0]!, -1)));

/** How wide the picture is where the camera looks, in diagonals of the box. */
export const widthAt = (radius: number): number => (2 * radius) / FOCAL / BENCHMARK_FROM_V1;

/** World units per benchmark unit. */
export const unitOf = (stage: Stage): number => diagonal(stage) / BENCHMARK_FROM_V1;

/** Rows right, up, backwards of a camera, in the frame of the world. */
export function axes(camera: Camera, up: Stage["up"]): Matrix {
  const azimuth = (camera.azimuth * Math.PI) / 180;
  const elevation = (camera.elevation * Math.PI) / 180;
  const [sinT, cosT, sinP, cosP] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
  const rows: Matrix = [
    [sinT, 0, -cosT],
    [-sinP * cosT, cosP, -sinP * sinT],
    [cosP * cosT, sinP, cosP * sinT],
  ];
  return rows.map((row) => times(UP_FROM_Y[up], row)) as Matrix;
}

export function eye(camera: Camera, stage: Stage): Vector {
  return add(camera.target, scaled(axes(camera, stage.up)[2], camera.radius * unitOf(stage)));
}

/** The least radius from which the picture holds the box, with a margin. */
export function framingRadius(camera: Omit<Camera, "radius">, stage: Stage): number {
  const rows = axes({ ...camera, radius: 0 }, stage.up);
  const middle = centre(stage);
  const far = stage.corners.map((corner) => {
    const [x, y, z] = times(rows, scaled(add(corner, scaled(middle, -1)), 1 / unitOf(stage)));
    return z + (Math.max(Math.abs(x), Math.abs(y)) * FOCAL) / FRAMED;
  });
  return Math.max(...far);
}

/** Rays through the pixel centres of a size x size picture, rows from the top. */
export const pixelRays = (camera: Camera, stage: Stage, size: number): Rays =>
  raysAt(camera, stage, size, size * size, (ray) => [(ray % size) + 0.5, Math.floor(ray / size) + 0.5]);

const PARTS = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]] as const; // of a pixel, that its rays pass

/** Four rays through each of some pixels, one after the other. */
export const finerRays = (camera: Camera, stage: Stage, size: number, pixels: readonly number[]): Rays =>
  raysAt(camera, stage, size, 4 * pixels.length, (ray) => {
    const [pixel, [x, y]] = [pixels[ray >> 2]!, PARTS[ray & 3]!];
    return [(pixel % size) + x, Math.floor(pixel / size) + y];
  });

/** Rays through places of a picture, in pixels from its left upper corner. */
function raysAt(camera: Camera, stage: Stage, size: number, count: number, place: (ray: number) => readonly [number, number]): Rays {
  const turn = transposed(axes(camera, stage.up));
  const start = eye(camera, stage);
  const positions = new Float64Array(3 * count);
  const directions = new Float64Array(3 * count);
  for (let ray = 0, at = 0; ray < count; ray++, at += 3) {
    const [column, row] = place(ray);
    const x = ((2 * column) / size - 1) / FOCAL;
    const y = (1 - (2 * row) / size) / FOCAL;
    const far = Math.sqrt(x * x + y * y + 1);
    for (let axis = 0; axis < 3; axis++) {
      positions[at + axis] = start[axis]!;
      directions[at + axis] = (turn[axis]![0] * x + turn[axis]![1] * y - turn[axis]![2]) / far;
    }
  }
  return { positions, directions, count };
}

/** Where a point of the world is seen, in shares of the picture from its left upper corner; null behind the camera. */
export function project(point: Vector, camera: Camera, stage: Stage): [number, number] | null {
  const [right, top, back] = axes(camera, stage.up);
  const away = add(point, scaled(eye(camera, stage), -1));
  const depth = -dot(back, away);
  if (depth <= 1e-9 * diagonal(stage)) return null;
  return [0.5 + (FOCAL / 2) * (dot(right, away) / depth), 0.5 - (FOCAL / 2) * (dot(top, away) / depth)];
}
