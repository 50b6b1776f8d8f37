/** What the page's address asks for behind its #: `page.html#mode=depth&size=256&azimuth=35&elevation=25&slice=udf&at=0.4`. */

export interface Asked {
  mode: string | null;
  engine: string | null; // webgl or wasm, where the page has both
  size: number | null; // pixels a side at rest
  azimuth: number | null; // degrees
  elevation: number | null;
  slice: string | null; // name of what it shows
  axis: string | null; // x, y or z, normal to it
  at: number | null; // between the sides of the box
  v: string | null; // x, -x, ..., look
  hits: number | null; // of a field, that distances are measured to
}

export function asked(hash: string): Asked {
  const found = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name: string, low: number, high: number): number | null => {
    const value = found.get(name) === null ? NaN : Number(found.get(name));
    return Number.isFinite(value) ? Math.min(high, Math.max(low, value)) : null;
  };
  return {
    mode: found.get("mode"),
    engine: found.get("engine"),
    size: number("size", 8, 2048),
    azimuth: number("azimuth", -360, 360),
    elevation: number("elevation", -90, 90),
    slice: found.get("slice"),
    axis: found.get("axis"),
    at: number("at", 0, 1),
    v: found.get("v"),
    hits: number("hits", 100, 100_000),
  };
}
