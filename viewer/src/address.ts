/** What the page's address asks for behind its #: `page.html#mode=depth&size=256&azimuth=35&elevation=25`. */

export interface Asked {
  mode: string | null;
  engine: string | null; // webgl or wasm, where the page has both
  size: number | null; // pixels a side at rest
  azimuth: number | null; // degrees
  elevation: number | null;
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
  };
}
