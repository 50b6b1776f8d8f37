/** The picture on the canvas: coarse while the camera moves, finer and finer when it rests, at last with smooth edges. */

import { finerRays, pixelRays, type Camera, type Rays, type Stage } from "./camera.ts";
import { query, type Answers, type World } from "./field.ts";
import type { Distances } from "./distances.ts";
import { breathe } from "./engine.ts";
import { edges, MODES, picture, smooth, type Mode, type Picture } from "./shading.ts";
import { cut, paint, Slice, type Quantity, type Sliced } from "./slice.ts";

const [COARSEST, COARSE_MOST] = [24, 256]; // pixels a side while the camera moves
const QUICK_MS = 45; // that a picture may take while the camera moves
const FINER = 2; // pixels a side from one picture to the next at rest

export interface Shown {
  size: number;
  full: boolean;
  answers: Answers;
  picture: Picture;
  milliseconds: number;
  evaluated: number; // rays
  slice: [number, number] | null; // range of its colours
}

export class View {
  mode: Mode = MODES[0]!;
  readonly slice: Slice;
  full = 384; // pixels a side at rest
  drawn = 0; // pictures
  private coarse = 64;
  private running: AbortController | null = null;
  private moved = 0; // when the camera moved last

  constructor(
    private readonly canvas: HTMLCanvasElement,
    readonly world: World,
    readonly stage: Stage,
    public camera: Camera,
    readonly distances: Distances,
    private readonly shown: (what: Shown) => void,
    private readonly failed: (error: Error) => void,
  ) {
    this.slice = new Slice(camera, stage);
  }

  /** Whether the camera has moved since the picture at rest. */
  get moving(): boolean {
    return this.moved > 0;
  }

  /** Whether normals cost nothing. */
  private get cheap(): boolean {
    return this.world.fields.every((field) => field.engine.exact);
  }

  /** Something moved, or another mode was chosen: what is being drawn is out of date. */
  refresh(moving = true): void {
    this.moved = moving ? performance.now() : 0;
    document.body.dataset.state = "moving";
    this.running?.abort();
    const control = new AbortController();
    this.running = control;
    this.draw(control.signal).catch((error: Error) => {
      if (!control.signal.aborted) this.failed(error);
    });
  }

  private async draw(signal: AbortSignal): Promise<void> {
    await breathe();
    if (signal.aborted) return;
    for (let size = Math.min(this.coarse, this.full), moving = true; ; moving = false) {
      await this.once(size, moving, signal);
      if (!moving && size >= this.full) return;
      if (moving) while (performance.now() - this.moved < 120) await pause(20, signal);
      if (signal.aborted) return;
      size = moving ? Math.min(this.full, Math.max(size, 64)) : Math.min(this.full, FINER * size);
    }
  }

  private async once(size: number, moving: boolean, signal: AbortSignal): Promise<void> {
    const started = performance.now();
    const rays = pixelRays(this.camera, this.stage, size);
    const slice = await this.cut(rays, signal);
    const answers = await query(this.world, rays, moving && !this.cheap ? this.mode.moving : this.mode.outputs, signal, slice?.starts);
    const milliseconds = performance.now() - started;
    if (moving) this.coarse = nextCoarse(size, milliseconds);
    const drawn = picture(this.mode, rays, answers, this.camera, this.stage);
    const range = slice && paint(this.slice as Slice & { quantity: Quantity }, slice, drawn.pixels);
    const what = { size, full: false, answers, picture: drawn, milliseconds, evaluated: answers.evaluated + (slice?.evaluated ?? 0), slice: range };
    this.put(what);
    if (moving || size < this.full) return;
    if (!slice) what.evaluated += await this.smooth(drawn, size, signal);
    this.put({ ...what, full: true, milliseconds: performance.now() - started });
  }

  private put(what: Shown): void {
    [this.canvas.width, this.canvas.height] = [what.size, what.size];
    this.canvas.getContext("2d")!.putImageData(what.picture.pixels, 0, 0);
    this.drawn++;
    this.shown(what);
  }

  /** Four rays through each pixel at an edge; returns how many were evaluated. */
  private async smooth({ pixels, range }: Picture, size: number, signal: AbortSignal): Promise<number> {
    const which = edges(pixels);
    const rays = finerRays(this.camera, this.stage, size, which);
    const answers = await query(this.world, rays, this.mode.outputs, signal);
    smooth(pixels, which, picture(this.mode, rays, answers, this.camera, this.stage, range).pixels);
    return answers.evaluated;
  }

  /** What the slice shows to rays; null without one. */
  async cut(rays: Rays, signal?: AbortSignal): Promise<Sliced | null> {
    if (!this.slice.quantity) return null;
    return cut(this.slice as Slice & { quantity: Quantity }, this.world, this.stage, this.camera, rays, this.distances, signal);
  }
}

/** Pixels a side for the next moving picture: time goes with their square. */
export function nextCoarse(size: number, milliseconds: number): number {
  const wanted = size * Math.sqrt(QUICK_MS / Math.max(milliseconds, 1));
  return Math.round(Math.min(COARSE_MOST, Math.max(COARSEST, Math.min(2 * size, wanted)) / 8)) * 8 || COARSEST;
}

const pause = (ms: number, signal: AbortSignal): Promise<void> =>
  new Promise((resolve) => {
    const timer = setTimeout(resolve, ms);
    signal.addEventListener("abort", () => (clearTimeout(timer), resolve()), { once: true });
  });
