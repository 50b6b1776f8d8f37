/** The page: reads its data, opens the GPU, shows the field. */

import { asked, told, readPage, readWeights } from "./page.ts";
import { centre, framingRadius, pixelRays, type Camera, type Stage } from "./camera.ts";
import { Cloud, ply } from "./cloud.ts";
import { control, help, stick } from "./controls.ts";
import { CpuEngine, kernels } from "./cpu.ts";
import { Distances } from "./distances.ts";
import type { Engine, Output } from "./engine.ts";
import { Field, query, type FieldRecord } from "./field.ts";
import { Gizmos } from "./gizmos.ts";
import { Gpu, WebglEngine } from "./webgl.ts";
import { layersOf } from "./network.ts";
import { button, byId, check, choices, download, element, select } from "./panel.ts";
import { PatchEngine } from "./patches.ts";
import { MODES } from "./shading.ts";
import { SlicePanel } from "./slicing.ts";
import { summary } from "./summary.ts";
import { View, type Shown } from "./view.ts";

const WISHES = asked(location.hash);
const ELEVATION = 25; // of the first picture, degrees
const [HITS, HITS_OF_A_CPU] = [40_000, 16_000]; // of a field, of which distances are measured to the surest
const SIZES = [128, 256, 384, 512, 768];
const [SHARP, SHARPEST] = [0, 1536]; // for a pixel of the screen each; at most so many a side

type Angles = Pick<Camera, "azimuth" | "elevation">;

function framed(stage: Stage, angles: Angles): Camera {
  const looking = { ...angles, target: centre(stage) };
  return { ...looking, radius: framingRadius(looking, stage) };
}

/** A camera moved to where the address says that it is. */
const wished = (camera: Camera): Camera => ({
  azimuth: WISHES.azimuth ?? camera.azimuth,
  elevation: WISHES.elevation ?? camera.elevation,
  radius: WISHES.radius ?? camera.radius,
  target: WISHES.target ?? camera.target,
});

function fail(text: string): void {
  byId("status").replaceChildren(element("span", { class: "error" }, text));
}

async function main(): Promise<void> {
  const page = readPage();
  if (location.hash.length > 1) document.getElementById("first")?.remove(); // another picture may be asked for
  byId("title").textContent = page.title;
  byId("about").textContent = page.about;
  const stage: Stage = { corners: page.corners, up: page.up };
  const start: Angles = { azimuth: WISHES.azimuth ?? page.azimuth, elevation: WISHES.elevation ?? ELEVATION };
  const numbers = new Float32Array(await readWeights());
  const patches = page.fields.every(({ kind }) => kind === "patches"); // which need no GPU
  const found = patches || WISHES.engine === "wasm" ? "" : Gpu.open();
  if (typeof found === "string" && WISHES.engine === "webgl") throw new Error(found);
  const gpu = typeof found === "string" || (found.isSoftware && WISHES.engine !== "webgl") ? null : found; // a CPU is faster than its imitation of a GPU
  const module = patches || gpu ? null : await kernels();
  const engines = new Map<number, Engine>(); // fields of one network share it
  const engineOf = (record: FieldRecord): Engine => {
    const known = engines.get(record.offset) ?? made(record);
    engines.set(record.offset, known);
    return known;
  };
  const made = (record: FieldRecord): Engine =>
    record.kind === "patches" ? new PatchEngine(record, numbers)
    : gpu ? new WebglEngine(gpu, record, layersOf(record, numbers))
    : new CpuEngine(module!, record, layersOf(record, numbers));
  WISHES.objects.forEach((place, index) => page.fields[index] && (page.fields[index].world_from_mesh.translation = place));
  const world = { fields: page.fields.map((record) => new Field(record, engineOf(record))), box: page.box };
  const slow = !patches && (gpu === null || gpu.isSoftware);
  const distances = new Distances(Math.round(WISHES.hits ?? (slow ? HITS_OF_A_CPU : HITS)), (text) => (byId("status").textContent = text));
  const engineNames = [...new Set(world.fields.map((field) => field.engine.name))].join(" and ");
  const canvas = byId("canvas") as HTMLCanvasElement;
  const view = new View(canvas, world, stage, wished(framed(stage, start)), distances, shown, (error) => fail(error.message));
  const offered = MODES.filter((mode) => mode.outputs.every((name) => world.fields.every((field) => field.engine.outputs.includes(name))));
  const opening = (view.mode = offered.find((mode) => mode.name === WISHES.mode) ?? view.mode);
  byId("help").textContent = help(offered.map((mode) => mode.key));
  const sharp = (): number => Math.min(SHARPEST, Math.round(canvas.clientWidth * devicePixelRatio)) || view.full;
  let size = Math.round(WISHES.size ?? (slow ? view.full : SHARP));
  const sized = (): void => {
    const wanted = size || sharp();
    if (wanted === view.full) return;
    view.full = wanted;
    view.refresh(false);
  };

  function shown(what: Shown): void {
    if (what.full || view.moving || view.mode !== opening || view.slice.quantity) document.getElementById("first")?.remove();
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
  const modes = choices("Show", "modes", offered, view.mode, (mode) => {
    view.mode = mode;
    view.refresh(false);
  });
  const sizes = [...new Set([SHARP, ...SIZES, size])].sort((a, b) => a - b).map((side): [string, string] => [`${side}`, side ? `${side} × ${side}` : "as the screen"]);
  const camera = element("fieldset", {}, element("legend", {}, "View"));
  const screen = document.fullscreenEnabled ? [button("Full screen", () => void byId("stage").requestFullscreen())] : [];
  camera.append(
    select("Pixels at rest", sizes, `${size}`, (value) => {
      size = Number(value);
      sized();
    }),
    check("Points on the surface", (on) => void cloud.show(on)),
    element("div", { class: "row" }, button("Back to the start", reset), button("Light or dark", theme)),
    element("div", { class: "row" }, button("Share", share), button("Save PNG", savePicture), button("Save points", savePoints), ...screen),
  );
  const slicing = new SlicePanel(view, WISHES);
  byId("panel").append(modes, slicing.panel, camera, ...(gizmos ? [gizmos.panel] : []));

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

  function share(): void {
    history.replaceState(null, "", `#${told(view, WISHES.engine)}`);
    const said = (text: string) => (): string => (byId("status").textContent = text);
    (navigator.clipboard?.writeText(location.href) ?? Promise.reject()).then(said("the address is copied; it brings others to this picture"), said("the page's address now brings others to this picture"));
  }
  function savePicture(): void {
    canvas.toBlob((data) => data && download(data, `${page.title}.png`));
  }
  async function savePoints(): Promise<void> {
    download(new Blob([await ply(world)]), `${page.title}.ply`);
  }

  const frame = byId("frame");
  control(frame, view);
  stick(byId("stick"), view);
  frame.addEventListener("keydown", (event) => {
    const index = offered.findIndex((mode) => mode.key === event.key);
    if (index >= 0) (modes.querySelectorAll("input")[index] as HTMLInputElement).click();
    slicing.key(event);
    if (event.key.toLowerCase() === "r" && !event.ctrlKey && !event.metaKey) reset();
  });
  document.body.addEventListener("keydown", (event) => {
    const plain = event.key.length === 1 && !event.ctrlKey && !event.metaKey && !event.altKey;
    const target = event.target as Element;
    if (plain && !frame.contains(target) && !target.matches("select, input[type=number]")) frame.dispatchEvent(new KeyboardEvent("keydown", event));
  });

  /** Numbers as `Field.render` of Python gives them, for scripts and tests. */
  async function render(
    { azimuth, elevation, radius }: Partial<Camera>,
    size: number,
    outputs: Output[],
  ): Promise<Record<string, number[]> & { evaluated: number }> {
    const odd = Object.entries({ azimuth, elevation, radius }).find(([, value]) => value !== undefined && !Number.isFinite(value));
    if (odd) throw new RangeError(`${odd[0]} must be a finite number; got ${odd[1]}`);
    if (!(Number.isInteger(size) && size > 0)) throw new RangeError(`size must be a positive integer; got ${size}`);
    const unknown = outputs.find((name) => world.fields.some(({ engine }) => !engine.outputs.includes(name)));
    if (unknown) throw new RangeError(`outputs must be among ${world.fields[0]!.engine.outputs.join(", ")}; got ${unknown}`);
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
  Object.assign(window, { ddf: { render, slice, view } });
  addEventListener("hashchange", () => location.reload());
  new ResizeObserver(sized).observe(frame);
  view.full = size || sharp();
  view.refresh(false);
}

const begin = (): Promise<void> => main().catch((error: Error) => fail(error.message));
if (document.getElementById("first")) requestAnimationFrame(() => setTimeout(begin)); // after it is painted
else void begin();
