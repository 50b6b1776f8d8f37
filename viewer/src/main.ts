/** The page: reads its data, opens the GPU, shows the field. */

import { asked } from "./address.ts";
import { readBlock, readPage } from "./blocks.ts";
import { centre, framingRadius, pixelRays, type Camera, type Stage } from "./camera.ts";
import { Cloud } from "./cloud.ts";
import { control, HELP } from "./controls.ts";
import { Distances } from "./distances.ts";
import type { Engine, Output } from "./engine.ts";
import { Field, query, type FieldRecord } from "./field.ts";
import { Gizmos } from "./gizmos.ts";
import { Gpu } from "./gpu.ts";
import { layersOf, type NetworkRecord } from "./network.ts";
import { button, byId, check, choices, element, select } from "./panel.ts";
import { PatchEngine } from "./patches.ts";
import { Reconstruction } from "./reconstruct.ts";
import { MODES } from "./shading.ts";
import { SlicePanel } from "./slicing.ts";
import { summary } from "./summary.ts";
import { View, type Shown } from "./view.ts";
import type { open, WasmEngine } from "./wasm.ts";
import { WebglEngine } from "./webgl.ts";

const WISHES = asked(location.hash);
const ELEVATION = 25; // of the first picture, degrees
const [HITS, HITS_OF_A_CPU] = [40_000, 16_000]; // of a field, of which distances are measured to the surest
const SIZES = [128, 256, 384, 512, 768];

type Angles = Pick<Camera, "azimuth" | "elevation">;

function framed(stage: Stage, angles: Angles): Camera {
  const looking = { ...angles, target: centre(stage) };
  return { ...looking, radius: framingRadius(looking, stage) };
}

function fail(text: string): void {
  byId("status").replaceChildren(element("span", { class: "error" }, text));
}

declare global {
  interface Window {
    ddfWasm?: { open: typeof open; WasmEngine: typeof WasmEngine };
  }
}

/** A CPU runs a field faster by wasm than by imitating a GPU. */
const wanted = (gpu: Gpu | string): "wasm" | "webgl" => (typeof gpu === "string" || gpu.isSoftware ? "wasm" : "webgl");

async function main(): Promise<void> {
  const page = readPage();
  byId("title").textContent = page.title;
  byId("about").textContent = page.about;
  byId("help").textContent = HELP;
  const stage: Stage = { corners: page.corners, up: page.up };
  const start: Angles = { azimuth: WISHES.azimuth ?? page.azimuth, elevation: WISHES.elevation ?? ELEVATION };
  const numbers = new Float32Array((await readBlock("ddf-weights"))!);
  const patches = page.fields.every(({ kind }) => kind === "patches"); // which need no GPU
  const gpu = patches ? "" : Gpu.open();
  const byWasm = document.getElementById("ddf-graph-values") !== null && (WISHES.engine ?? wanted(gpu)) === "wasm";
  if (typeof gpu === "string" && !byWasm && !patches) {
    throw new Error(`${gpu}; open the page in another browser, or write it with ddf view --wasm`);
  }
  const engines = new Map<number, Engine>(); // fields of one network share it
  const engineOf = (record: FieldRecord): Engine => {
    const known = engines.get(record.offset) ?? made(record);
    engines.set(record.offset, known);
    return known;
  };
  const made = (record: FieldRecord): Engine =>
    record.kind === "patches" ? new PatchEngine(record, numbers)
    : byWasm || typeof gpu === "string"
      ? new window.ddfWasm!.WasmEngine(readBlock)
      : new WebglEngine(gpu, record, layersOf(record, numbers));
  const world = { fields: page.fields.map((record) => new Field(record, engineOf(record))), box: page.box };
  const slow = !patches && (byWasm || typeof gpu === "string" || gpu.isSoftware);
  const distances = new Distances(Math.round(WISHES.hits ?? (slow ? HITS_OF_A_CPU : HITS)), (text) => (byId("status").textContent = text));
  const engineNames = [...new Set(world.fields.map((field) => field.engine.name))].join(" and ");
  const canvas = byId("canvas") as HTMLCanvasElement;
  const view = new View(canvas, world, stage, framed(stage, start), distances, shown, (error) => fail(error.message));
  view.mode = MODES.find((mode) => mode.name === WISHES.mode) ?? view.mode;
  view.full = Math.round(WISHES.size ?? view.full);

  function shown(what: Shown): void {
    const words = summary(page.title, view, engineNames, what);
    byId("canvas").setAttribute("aria-label", words.picture);
    byId("legend").replaceChildren(...words.legend);
    gizmos?.update();
    cloud.update();
    byId("status").textContent = words.status;
    document.body.dataset.state = what.full ? "still" : "moving";
  }

  const gizmos = world.fields.length > 1 ? new Gizmos(byId("overlay"), view) : null;
  const cloud = new Cloud(view);
  const offered = MODES.filter((mode) => mode.outputs.every((name) => world.fields.every((field) => field.engine.outputs.includes(name))));
  const rebuilt = page.model && new Reconstruction(page.model, layersOf(page.fields[0] as NetworkRecord, numbers), engineOf(page.fields[0]!) as WebglEngine, view, cloud);
  const modes = choices("Show", "modes", offered, view.mode, (mode) => {
    view.mode = mode;
    view.refresh(false);
  });
  const sizes = [...new Set([...SIZES, view.full])].sort((a, b) => a - b).map((size): [string, string] => [`${size}`, `${size} × ${size}`]);
  const camera = element("fieldset", {}, element("legend", {}, "View"));
  camera.append(
    select("Pixels at rest", sizes, `${view.full}`, (value) => {
      view.full = Number(value);
      view.refresh(false);
    }),
    check("Points on the surface", (on) => void cloud.show(on)),
    element("div", { class: "row" }, button("Back to the start", reset), button("Light or dark", theme)),
  );
  const slicing = new SlicePanel(view, WISHES);
  byId("panel").append(...(rebuilt ? [rebuilt.panel] : []), modes, slicing.panel, camera, ...(gizmos ? [gizmos.panel] : []));

  function reset(): void {
    view.camera = framed(stage, start);
    view.refresh(false);
  }
  function theme(): void {
    const dark = document.documentElement.dataset.theme
      ? document.documentElement.dataset.theme === "dark"
      : matchMedia("(prefers-color-scheme: dark)").matches;
    document.documentElement.dataset.theme = dark ? "light" : "dark";
  }

  const frame = byId("frame");
  control(frame, view);
  frame.addEventListener("keydown", (event) => {
    const index = offered.findIndex((mode) => mode.key === event.key);
    if (index >= 0) (modes.querySelectorAll("input")[index] as HTMLInputElement).click();
    slicing.key(event);
    if (event.key.toLowerCase() === "r" && !event.ctrlKey && !event.metaKey) reset();
  });

  /** Numbers as `Field.render` of Python gives them, for scripts and tests. */
  async function render(
    { azimuth, elevation, radius }: Partial<Camera>,
    size: number,
    outputs: Output[],
  ): Promise<Record<string, number[]> & { evaluated: number }> {
    const base = framed(stage, { azimuth: azimuth ?? start.azimuth, elevation: elevation ?? start.elevation });
    const rays = pixelRays({ ...base, radius: radius ?? base.radius }, stage, size);
    const found = await query(world, rays, outputs);
    const arrays = Object.fromEntries(Object.entries(found.values).map(([name, values]) => [name, Array.from(values!)]));
    return { ...arrays, evaluated: found.evaluated } as Record<string, number[]> & { evaluated: number };
  }
  /** What the slice shows to the rays of a picture: where, and the numbers there. */
  async function slice(size: number): Promise<{ points: number[]; values: number[]; evaluated: number }> {
    const { points, values, evaluated } = (await view.cut(pixelRays(view.camera, stage, size)))!;
    return { points: Array.from(points), values: Array.from(values), evaluated };
  }
  Object.assign(window, { ddf: { render, slice, view, rebuilt } });
  if (rebuilt) await rebuilt.sample(0);
  else view.refresh(false);
}

main().catch((error: Error) => fail(error.message));
