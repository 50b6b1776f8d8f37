"""The page of `ddf view` without a GPU: processor time until a live picture of 128 x 128 pixels, and of a frame.

Rows `open`: of all of a browser's processes, from the address to that picture. Rows `frame`: of the page's own thread,
while the camera turns. A frame of 50 ms is 20 a second on one quiet core. Error: of depth beside `Field.render`.
"""

import contextlib
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import trimesh

import ddf
from bench.lib import browsers, measuring
from ddf.cli.field import view
from ddf.core import shipped_models
from ddf.fields.grid import build
from ddf.fit import patch_fitting
from ddf.geometry.mesh_io import Mesh
from ddf.io import viewer_page

ON_DEMAND = "python -m bench live_page, with Chromium, Firefox and a core to itself"
SIDE, OPENINGS, FRAMES, CHECKED = 128, 2, 12, 64
EMPTY = b"<!doctype html><canvas></canvas><script>window.live = 1</script><body data-state=still>"
LIVE = """(() => { const put = CanvasRenderingContext2D.prototype.putImageData;
CanvasRenderingContext2D.prototype.putImageData = function (image, ...rest) {
  put.call(this, image, ...rest);
  if (image.width >= %d) window.live ??= performance.now();
}; })()"""
TURN = """async ([side, count]) => { const { view } = ddf, { signal } = new AbortController();
for (let i = 0; i < count; i++) {
  view.camera = { ...view.camera, azimuth: view.camera.azimuth + 3 };
  await view.once(side, true, signal);
} }"""


def torus(folder: Path) -> Path:
    """A field of patches."""
    mesh = trimesh.creation.torus(0.6, 0.25)
    patch_fitting.fit(Mesh(np.array(mesh.vertices), np.array(mesh.faces)), build.PatchConfig(1e-3), folder / "torus")
    return folder / "torus"


def pages(folder: Path) -> Iterator[tuple[str, bytes, Any]]:
    """What is opened: a name, a file's bytes, and the field that Python has of it."""
    yield "an empty page", EMPTY, None
    ring = torus(folder)
    yield "patches (torus)", viewer_page.render(view.page_of([ring])), ddf.load(ring)
    rabbit = viewer_page.render(view.page_of([shipped_models.place("rabbit")]))
    yield "network of 5 x 128 (rabbit)", rabbit, ddf.load("rabbit")
    pair = [shipped_models.place(name) for name in ("rabbit", "armchair")]
    yield "scene of two networks", viewer_page.render(view.page_of(pair)), None
    yield "reconstruction model (chair)", viewer_page.render(view.page_of([shipped_models.place("chair")])), None


def processor() -> dict[int, tuple[float, float]]:
    """Seconds of all threads and of the first one, of each process below this one."""
    spent = {}
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            own, total = next(each for each in process.threads() if each.id == process.pid), process.cpu_times()
            spent[process.pid] = (total.user + total.system, own.user_time + own.system_time)
    return spent


def since(before: dict[int, tuple[float, float]], which: int) -> list[float]:
    """Seconds of each process from then on."""
    return [spent[which] - before.get(pid, (0.0, 0.0))[which] for pid, spent in processor().items()]


def measured(driver: Any, name: str, file: Path) -> tuple[list[float], list[float], Any]:
    """Seconds of openings, then of frames; and the depth that the page has."""
    opened, frames, depth = [], [], None
    for _ in range(OPENINGS):
        browser = browsers.launched(driver, name)
        page = browser.new_page()
        page.set_default_timeout(120_000)
        page.add_init_script(LIVE % SIDE)
        before = processor()
        page.goto(f"{file.as_uri()}#mode=shaded", wait_until="commit")
        while not page.evaluate("window.live ?? 0"):
            time.sleep(0.02)
        opened.append(sum(since(before, 0)))
        page.wait_for_selector("body[data-state=still]")
        if file.stem != "empty":
            before = processor()
            page.evaluate(TURN, [SIDE, FRAMES])
            frames.append(max(since(before, 1)) / FRAMES)
            depth = page.evaluate("size => ddf.render({}, size, ['depth']).then(found => found.depth)", CHECKED)
        browser.close()
    return opened, frames, depth


def main() -> None:
    """Measure every page in every browser, write."""
    rows = []
    with tempfile.TemporaryDirectory() as folder, browsers.driver() as driver:
        for number, (name, data, field) in enumerate(pages(Path(folder))):
            file = Path(folder) / (f"{number}.html" if number else "empty.html")
            file.write_bytes(data)
            for browser in browsers.PROGRAMS:
                opened, frames, depth = measured(driver, browser, file)
                size, error = {"browser": browser, "pixels": SIDE}, {}
                if field is not None:
                    got, true = np.array(depth, dtype=float), field.render(35, 25, size=CHECKED)["depth"].reshape(-1)
                    both = np.isfinite(got) & np.isfinite(true)
                    error = {"depth_mean": float(np.abs(got[both] - true[both]).mean())}
                print(f"{name}, {browser}: {opened}, {frames} s", flush=True)
                rows.append(measuring.row(f"{name}: open", size, opened, {}))
                rows += [measuring.row(f"{name}: frame", size, frames, error)] if frames else []
    measuring.write("live_page", 1, rows)
