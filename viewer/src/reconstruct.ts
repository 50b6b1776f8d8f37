/** From an image to a live field, all inside the page: encoders by wasm, modulations baked into the field's weights. */

import { readBlock, type ModelRecord } from "./page.ts";
import { ends, hits, spread, type Cloud } from "./cloud.ts";
import { Cutout, framed, type Frame, read } from "./images.ts";
import type { Layer, NetworkEngine } from "./network.ts";
import { element } from "./panel.ts";
import type { Vector } from "./vectors.ts";
import type { View } from "./view.ts";
import type { Model } from "./wasm.ts";
import { centre, project, type Camera } from "./camera.ts";

const BENCHMARK_FROM_V1 = 0.57;
const RAYS_OF_SCALE = 800; // whose hits tell how large the shape is

/** What the encoders say of an image. */
export interface Encoded {
  camera: [number, number, number]; // azimuth and elevation in radians, radius in benchmark units
  modulations: Float32Array;
  distance: number | null; // from the training images, where the model knows
}

/** A network whose states carry factors, as a plain one: W_l diag(m_{l-1}). */
export function modulated(layers: Layer[], modulations: Float32Array): Layer[] {
  let at = 0;
  return layers.map((layer, index) => {
    if (index === 0) return layer;
    const factors = modulations.subarray(at, at + layer.columns);
    at += layer.columns;
    return { ...layer, weight: layer.weight.map((value, i) => value * factors[i % layer.columns]!) };
  });
}

export class Reconstruction {
  readonly panel = element("fieldset", {}, element("legend", {}, "Image"));
  scale = 1; // v1 units per unit of the field
  encoded: Encoded | null = null; // of the image that is shown
  frame: Frame | null = null; // of its object
  index: number | null = null; // of the sample that is
  private model: Model | null = null;
  private readonly shown = element("img", { alt: "The image that is reconstructed", class: "input" });
  private readonly said = element("p", { class: "note", role: "status" });

  constructor(
    private readonly record: ModelRecord,
    private readonly layers: Layer[],
    private readonly engine: NetworkEngine,
    private readonly view: View,
    private readonly cloud: Cloud,
  ) {
    const file = element("input", { type: "file", accept: "image/png,image/webp", id: "image" });
    file.addEventListener("change", () => file.files?.[0] && this.take(file.files[0]));
    const samples = record.samples.map((address, index) => {
      const made = element("button", { type: "button", class: "sample" }, element("img", { src: address, alt: `Sample ${index + 1}` }));
      made.addEventListener("click", () => void this.sample(index));
      return made;
    });
    const drop = element("label", { class: "drop", for: "image" }, "Drop an RGBA image here, or choose one");
    this.panel.append(this.shown, element("div", { class: "row" }, ...samples), drop, file, this.said);
    document.body.addEventListener("dragover", (event) => event.preventDefault());
    document.body.addEventListener("drop", (event) => {
      event.preventDefault();
      const dropped = event.dataTransfer?.files[0];
      if (dropped) this.take(dropped);
    });
  }

  async sample(index: number): Promise<void> {
    const [, text] = (this.record.samples[index] ?? this.record.samples[0]!).split(",");
    await this.take(new Blob([Uint8Array.from(atob(text!), (letter) => letter.charCodeAt(0))], { type: "image/png" }));
    this.index = index;
  }

  /** Show what an image file shows; says what is wrong with it. */
  async take(file: Blob): Promise<void> {
    this.said.textContent = "reading the image";
    this.index = null;
    try {
      const pixels = await read(file);
      URL.revokeObjectURL(this.shown.src);
      this.shown.src = URL.createObjectURL(file);
      const started = performance.now();
      const cutout = new Cutout(pixels);
      const size = this.record.image_size;
      this.frame = await framed({ distances: this.record.usual ? (crops) => this.distances(crops) : null, shape: (crop) => this.placed(crop) }, cutout, size);
      const found = await this.encode(cutout.crop(this.frame, size));
      const encoders = Math.round(performance.now() - started);
      this.encoded = found;
      await this.become(found);
      this.cloud.points = [];
      this.view.distances.forget();
      if (this.cloud.shown) await this.cloud.show(true);
      this.view.camera = this.seenFrom(found.camera);
      this.view.refresh(false);
      const [azimuth, elevation] = found.camera.map((angle) => Math.round((angle * 180) / Math.PI));
      this.said.textContent = `camera ${azimuth}°, ${elevation}°; ${encoders} ms${found.distance === null ? "" : `; distance from the training images ${found.distance.toFixed(1)}`}`;
    } catch (error) {
      this.said.textContent = (error as Error).message;
    }
  }

  async encode(planes: Float32Array): Promise<Encoded> {
    const outputs = ["camera", "modulations", ...(this.record.usual ? ["distance"] : [])];
    const found = await this.run([planes], outputs);
    return { camera: Array.from(found.camera!) as Encoded["camera"], modulations: found.modulations!, distance: found.distance?.[0] ?? null };
  }

  private async distances(crops: Float32Array[]): Promise<Float32Array> {
    return (await this.run(crops, ["distance"])).distance!;
  }

  private async run(crops: Float32Array[], outputs: string[]): Promise<Record<string, Float32Array>> {
    const { image_size: size } = this.record;
    this.model ??= await window.ddfWasm!.open((await readBlock("ddf-runtime"))!, (await readBlock("ddf-model"))!);
    const data = new Float32Array(crops.length * crops[0]!.length);
    crops.forEach((crop, i) => data.set(crop, i * crop.length));
    return this.model.run({ images: { data, shape: [crops.length, 4, size, size] } }, outputs);
  }

  /** Make the field that of an image; returns points of it. */
  private async become({ modulations }: Encoded): Promise<Vector[]> {
    this.engine.replace(modulated(this.layers, modulations));
    const points = await hits(this.view.world, undefined, RAYS_OF_SCALE);
    this.scale = 1 / spread(points);
    return points;
  }

  /** The frame of the shape that the model sees, from the mean distance. */
  private async placed(crop: Float32Array): Promise<Frame> {
    const found = await this.encode(crop);
    const points = await this.become(found);
    const camera = this.seenFrom([found.camera[0], found.camera[1], this.record.radius]);
    const places = points.map((point) => project(point, camera, this.view.stage)).filter((place) => place !== null);
    const [[left, right], [top, bottom]] = [0, 1].map((axis) => ends(places.map((place) => place[axis]!))) as [[number, number], [number, number]];
    return [Math.hypot(right - left, bottom - top), (left + right) / 2 - 0.5, (top + bottom) / 2 - 0.5];
  }

  /** The camera of the image about the field, whose box is a cube of side 2; radii of the page are in shares of its diagonal. */
  private seenFrom([azimuth, elevation, radius]: Encoded["camera"]): Camera {
    const degrees = 180 / Math.PI;
    const away = radius / BENCHMARK_FROM_V1 / this.scale; // field units
    return {
      azimuth: azimuth * degrees,
      elevation: elevation * degrees,
      radius: (BENCHMARK_FROM_V1 * away) / (2 * Math.sqrt(3)),
      target: centre(this.view.stage),
    };
  }
}
