/** Controls of the slice: what it shows, where it stands, along which v; keys P, comma and full stop. */

import type { Asked } from "./page.ts";
import { element, select, slider } from "./panel.ts";
import { AXES, QUANTITIES, WAYS, type Slice } from "./slice.ts";
import type { View } from "./view.ts";

const STEP = 0.02; // of a key, in sides of the box
const OFF = "none";

export class SlicePanel {
  readonly panel = element("fieldset", {}, element("legend", {}, "Slice"));
  private readonly slice: Slice;
  private readonly shows: HTMLLabelElement;
  private readonly place: HTMLLabelElement;

  constructor(
    private readonly view: View,
    wished: Asked,
  ) {
    const slice = (this.slice = view.slice);
    slice.quantity = QUANTITIES.find(({ name }) => name === wished.slice) ?? null;
    slice.axis = AXES.find((name) => name === wished.axis) ?? slice.axis;
    slice.way = WAYS.find((name) => name === wished.v) ?? slice.way;
    slice.at = wished.at ?? slice.at;
    const quantities = QUANTITIES.map(({ name, label }): [string, string] => [name, label]);
    this.shows = select("Shows", [[OFF, "nothing"], ...quantities], slice.quantity?.name ?? OFF, (name) => {
      slice.quantity = QUANTITIES.find((one) => one.name === name) ?? null;
      this.changed(false);
    });
    this.place = slider("Where", slice.at, (value) => {
      slice.at = value;
      this.changed(true);
    });
    this.panel.append(
      this.shows,
      select("Across", AXES.map((name) => [name, `the ${name} axis`]), slice.axis, (name) => {
        slice.axis = name as Slice["axis"];
        this.changed(false);
      }),
      this.place,
      select("v", WAYS.map((name) => [name, name === "look" ? "as the camera looks" : `along ${name.replace("-", "−")}`]), slice.way, (name) => {
        slice.way = name as Slice["way"];
        this.changed(false);
      }),
    );
    this.changed(null);
  }

  /** P: the next kind of slice; comma and full stop move it. */
  key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key.toLowerCase() === "p") {
      const shows = this.shows.querySelector("select")!;
      shows.selectedIndex = (shows.selectedIndex + 1) % shows.length;
      shows.dispatchEvent(new Event("change"));
    }
    const by = event.key === "," ? -STEP : event.key === "." ? STEP : 0;
    if (!by || !this.slice.quantity) return;
    this.slice.at = Math.min(1, Math.max(0, this.slice.at + by));
    this.place.querySelector("input")!.value = `${this.slice.at}`;
    this.changed(true);
  }

  /** moving: how the picture is drawn anew; null for not at all. What has no effect cannot be changed. */
  private changed(moving: boolean | null): void {
    const quantity = this.slice.quantity?.name;
    const [, across, place, way] = this.panel.querySelectorAll<HTMLSelectElement | HTMLInputElement>("select, input");
    across!.disabled = place!.disabled = !quantity;
    way!.disabled = quantity !== "depth" && quantity !== "visibility";
    if (moving !== null) this.view.refresh(moving);
  }
}
