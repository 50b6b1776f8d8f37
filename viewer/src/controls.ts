/** Mouse, touch and keyboard to the camera: orbit, zoom, walk. */

import { axes, unitOf, widthAt, type Camera, type Stage } from "./camera.ts";
import { add, scaled } from "./vectors.ts";

const DEGREES_PER_WIDTH = 200; // that a drag over the whole picture turns the camera
const [NEAREST, FARTHEST] = [0, 20]; // radius, benchmark units
const STEP = 0.04; // of a walk, in diagonals of the box
const STRIDE = 0.6; // of the stick, in diagonals a second
const TURN = 6; // degrees, of an arrow key

/** What can be done. keys: of what can be shown. */
export const help = (keys: string[]): string =>
  "Drag, or arrow keys: turn. Wheel, pinch, + and −: nearer and farther. Two fingers, right button: shift. " +
  `W A S D, Q E: walk, also into the box. ${keys[0]} to ${keys.at(-1)}: what is shown. ` +
  "P: a slice, next of its kinds; comma and full stop: move it. R: back to the start.";

/** The camera after a turn; elevations stay short of the poles' other side. */
export function turned(camera: Camera, azimuth: number, elevation: number): Camera {
  return {
    ...camera,
    azimuth: (((camera.azimuth + azimuth) % 360) + 360) % 360,
    elevation: Math.min(90, Math.max(-90, camera.elevation + elevation)),
  };
}

export function zoomed(camera: Camera, factor: number): Camera {
  return { ...camera, radius: Math.min(FARTHEST, Math.max(NEAREST, camera.radius * factor)) };
}

/** The camera and what it looks at, moved along its own axes by shares of the diagonal. */
export function walked(camera: Camera, stage: Stage, right: number, up: number, forward: number): Camera {
  const [x, y, z] = axes(camera, stage.up);
  const far = 0.57 * unitOf(stage);
  const by = add(add(scaled(x, right * far), scaled(y, up * far)), scaled(z, -forward * far));
  return { ...camera, target: add(camera.target, by) };
}

/** Where fingers are: how far apart, and their middle in shares of the picture from its centre, right and down. */
type Grip = [apart: number, right: number, down: number];

/** What lay under the fingers lies under them again. */
function gripped(camera: Camera, stage: Stage, last: Grip, now: Grip): Camera {
  const nearer = zoomed(camera, last[0] / now[0]);
  const [before, after] = [camera, nearer].map(({ radius }) => widthAt(Math.max(radius, STEP))) as [number, number];
  return walked(nearer, stage, last[1] * before - now[1] * after, now[2] * after - last[2] * before, 0);
}

const KEYS: Record<string, (camera: Camera, stage: Stage) => Camera> = {
  ArrowLeft: (c) => turned(c, -TURN, 0),
  ArrowRight: (c) => turned(c, TURN, 0),
  ArrowUp: (c) => turned(c, 0, TURN),
  ArrowDown: (c) => turned(c, 0, -TURN),
  "+": (c) => zoomed(c, 0.9),
  "=": (c) => zoomed(c, 0.9),
  "-": (c) => zoomed(c, 1 / 0.9),
  w: (c, s) => walked(c, s, 0, 0, STEP),
  s: (c, s) => walked(c, s, 0, 0, -STEP),
  a: (c, s) => walked(c, s, -STEP, 0, 0),
  d: (c, s) => walked(c, s, STEP, 0, 0),
  q: (c, s) => walked(c, s, 0, -STEP, 0),
  e: (c, s) => walked(c, s, 0, STEP, 0),
};

export interface Controlled {
  camera: Camera;
  readonly drawn: number; // pictures
  readonly stage: Stage;
  refresh(): void;
}

/** Listen on an element that can have the focus. */
export function control(element: HTMLElement, view: Controlled): void {
  const set = (camera: Camera): void => {
    view.camera = camera;
    view.refresh();
  };
  const fingers = new Map<number, [number, number]>();
  const grip = (): Grip => {
    const { left, top, width } = element.getBoundingClientRect();
    const [[x, y], [a, b] = [x, y]] = [...fingers.values()] as [[number, number], [number, number]?];
    return [Math.max(Math.hypot(x - a, y - b), 1), ((x + a) / 2 - left) / width - 0.5, ((y + b) / 2 - top) / width - 0.5];
  };
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  element.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const last = grip();
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const degrees = DEGREES_PER_WIDTH / element.clientWidth;
    if (fingers.size === 2 || event.shiftKey || event.buttons & 2) {
      set(gripped(view.camera, view.stage, last, grip()));
    } else {
      set(turned(view.camera, (event.clientX - before[0]) * degrees, (event.clientY - before[1]) * degrees));
    }
  });
  const lift = (event: PointerEvent): boolean => fingers.delete(event.pointerId);
  element.addEventListener("pointerup", lift);
  element.addEventListener("pointercancel", lift);
  element.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      set(zoomed(view.camera, Math.exp(Math.sign(event.deltaY) * 0.08)));
    },
    { passive: false },
  );
  element.addEventListener("keydown", (event) => {
    const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    set(act(view.camera, view.stage));
  });
}

/** A stick for a thumb: pushed up it walks forward, to the side sideways, a step for every picture. */
export function stick(element: HTMLElement, view: Controlled): void {
  const knob = element.firstElementChild as HTMLElement;
  let push: [number, number] | null = null;
  let [last, drawn] = [0, -1];
  const pushed = (event: PointerEvent): void => {
    event.stopPropagation(); // the picture does not turn
    const { left, top, width } = element.getBoundingClientRect();
    const [x, y] = [(2 * (event.clientX - left)) / width - 1, (2 * (event.clientY - top)) / width - 1];
    const long = Math.max(1, Math.hypot(x, y));
    push = [x / long, y / long];
    knob.style.transform = `translate(${(push[0] * width) / 4}px, ${(push[1] * width) / 4}px)`;
  };
  const walk = (now: number): void => {
    if (!push) return;
    if (view.drawn !== drawn) {
      const by = (STRIDE * Math.min(now - last, 200)) / 1000;
      view.camera = walked(view.camera, view.stage, push[0] * by, 0, -push[1] * by);
      [last, drawn] = [now, view.drawn];
      view.refresh();
    }
    requestAnimationFrame(walk);
  };
  const lift = (): void => {
    push = null;
    knob.style.transform = "";
  };
  element.addEventListener("pointerdown", (event) => {
    pushed(event);
    element.setPointerCapture(event.pointerId);
    [last, drawn] = [performance.now(), -1];
    requestAnimationFrame(walk);
  });
  element.addEventListener("pointermove", (event) => push && pushed(event));
  element.addEventListener("pointerup", lift);
  element.addEventListener("pointercancel", lift);
}
