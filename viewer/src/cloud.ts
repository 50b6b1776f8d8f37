/** Points on the surface: hits of random rays, [DDF22] §4.2 with one projection. */

import { project, type Rays } from "./camera.ts";
import { query, type World } from "./field.ts";
import { byId, element } from "./panel.ts";
import { apply, inverse, random, way, type Vector } from "./vectors.ts";
import type { View } from "./view.ts";

const RAYS = 3000;
const RAYS_OF_A_FILE = 40_000;

/** Rays from evenly drawn points of the fields' boxes in evenly drawn directions. */
function drawn(world: World, count: number): Rays {
  const next = random(1);
  const rays = { positions: new Float64Array(3 * count), directions: new Float64Array(3 * count), count };
  for (let ray = 0; ray < count; ray++) {
    const field = world.fields[ray % world.fields.length]!;
    const { lower, upper } = field.record;
    const inside = lower.map((low, i) => low + next() * (upper[i]! - low)) as Vector;
    rays.positions.set(apply(inverse(field.fieldFromWorld), inside), 3 * ray);
    rays.directions.set(way(next), 3 * ray);
  }
  return rays;
}

/** Points that random rays see, frame of the world. */
async function hits(world: World): Promise<Vector[]> {
  const rays = drawn(world, RAYS);
  const found = await query(world, rays, ["depth"]);
  const points: Vector[] = [];
  found.depth.forEach((depth, ray) => {
    if (found.nearest[ray]! < 0) return;
    points.push([0, 1, 2].map((axis) => rays.positions[3 * ray + axis]! + depth * rays.directions[3 * ray + axis]!) as Vector);
  });
  return points;
}

/** Points and normals that random rays see, frame of the world, as a PLY file. */
export async function ply(world: World): Promise<string> {
  const { positions, directions, count } = drawn(world, RAYS_OF_A_FILE);
  const found = await query(world, { positions, directions, count }, ["depth", "normals"]);
  const lines: string[] = [];
  found.depth.forEach((depth, ray) => {
    if (found.nearest[ray]! < 0) return;
    const at = [0, 1, 2].map((axis) => positions[3 * ray + axis]! + depth * directions[3 * ray + axis]!);
    const normal = [...found.values.normals!.subarray(3 * ray, 3 * ray + 3)].map((value) => value.toFixed(6));
    lines.push([...at, ...normal].join(" "));
  });
  const names = ["x", "y", "z", "nx", "ny", "nz"].map((name) => `property ${name[1] ? "float" : "double"} ${name}`);
  return ["ply", "format ascii 1.0", `element vertex ${lines.length}`, ...names, "end_header", ...lines, ""].join("\n");
}

/** Points over the picture. */
export class Cloud {
  private points: Vector[] = [];
  private readonly canvas = element("canvas", { "aria-hidden": "true", hidden: "" });

  constructor(private readonly view: View) {
    byId("overlay").prepend(this.canvas);
  }

  get shown(): boolean {
    return !this.canvas.hidden;
  }

  async show(on: boolean): Promise<void> {
    this.canvas.hidden = !on;
    if (on && this.points.length === 0) this.points = await hits(this.view.world);
    this.update();
  }

  update(): void {
    if (!this.shown) return;
    const side = Math.round(this.canvas.clientWidth * devicePixelRatio) || 1;
    [this.canvas.width, this.canvas.height] = [side, side];
    const pen = this.canvas.getContext("2d")!;
    pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--mark");
    for (const point of this.points) {
      const at = project(point, this.view.camera, this.view.stage);
      if (at) pen.fillRect(at[0] * side - 1, at[1] * side - 1, 2, 2);
    }
  }
}
