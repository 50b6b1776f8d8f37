"""The viewer's page in Chromium with software rendering and in Firefox: its numbers are those of `Field.render`."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import _browsers
import numpy as np
import pytest
from _shapes import torus
from _support import assert_close
from PIL import Image

import ddf
from ddf.cli import views
from ddf.core import shipped_models
from ddf.fields import checked_cloud
from ddf.fields.grid import octree
from ddf.fit import patch_fitting
from ddf.io import viewer_page

pytest.importorskip("playwright.sync_api")
pytestmark = pytest.mark.browser
SCENE = "objects: [{field: .}, {field: rabbit-network, scale: 0.8, translation: [0.5, 0.2, 0]}]"  # patches, a network
RABBIT = shipped_models.place("rabbit-network")
HITS = 4000  # of whose surest distances in the page are measured to; the fewer, the sooner
PATIENCE_MS = 240_000


@dataclass
class Opened:
    """A page, and what it should not have done."""

    page: Any
    faults: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    loads: int = 1

    def render(self, outputs: tuple[str, ...], size: int) -> dict[str, Any]:
        """What the page computes from the camera of `Field.render`."""
        found = self.page.evaluate("([size, outputs]) => ddf.render({}, size, outputs)", [size, list(outputs)])
        shapes = {name: (size, size, 3) if name.startswith("normals") else (size, size) for name in outputs}
        arrays = {name: np.array(found[name], dtype=float).reshape(shape) for name, shape in shapes.items()}
        return arrays | {"evaluated": found["evaluated"]}

    def require_quiet(self) -> None:
        """No error was reported, and nothing was asked for but the file itself and what it made in its own memory."""
        assert self.faults == []
        asked = [address for address in self.requests if not address.startswith(("blob:null/", "data:"))]
        tells = self.page.context.browser.browser_type.name != "firefox"  # which says nothing of files
        assert set(asked) == ({self.page.url.partition("#")[0]} if tells else set())
        assert len(asked) == (self.loads if tells else 0)

    def still(self) -> None:
        """Wait for the picture at rest."""
        self.page.wait_for_selector("body[data-state=still]", timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def driver() -> Iterator[Any]:
    with _browsers.driver() as driver:
        yield driver


def _launched(driver: Any, name: str) -> Any:
    try:
        return _browsers.launched(driver, name)
    except FileNotFoundError as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="module")
def browser(driver) -> Any:
    return _launched(driver, "chromium")


@pytest.fixture(scope="module", params=_browsers.PROGRAMS)
def either(request, driver) -> Any:
    return request.getfixturevalue("browser") if request.param == "chromium" else _launched(driver, request.param)


def _open(browser: Any, file: Path, asked: str, page: viewer_page.Page, **how: Any) -> Opened:
    """A page, written to the file, with its picture at rest."""
    viewer_page.write(file, page)
    opened = Opened(browser.new_page(**how))
    opened.page.on("console", lambda message: opened.faults.append(message.text) if message.type == "error" else None)
    opened.page.on("pageerror", lambda error: opened.faults.append(str(error)))
    opened.page.on("request", lambda request: opened.requests.append(request.url))
    opened.page.goto(f"{file.as_uri()}#{asked}")
    opened.page.set_default_timeout(PATIENCE_MS)
    opened.still()
    return opened


@pytest.fixture(scope="module")
def rabbit(browser, tmp_path_factory) -> Iterator[Opened]:
    file, page = tmp_path_factory.mktemp("pages") / "rabbit.html", views.page_of([RABBIT])
    opened = _open(browser, file, f"size=16&mode=depth&hits={HITS}", page)
    yield opened
    opened.require_quiet()  # of all tests that use the page


def _rabbit_by(engine: str, browser: Any, folder: Path, asked: str) -> Opened:
    """The rabbit's page, whose pixels by that engine are those of Python."""
    opened = _open(browser, folder / "rabbit.html", asked, views.page_of([RABBIT]))
    assert f"by {engine}" in opened.page.inner_text("#status")
    outputs = ("visibility", "depth", "normals", "weight_1", "mean_curvature")
    found, expected = opened.render(outputs, 64), ddf.load("rabbit-network").render(35, 25, size=64, outputs=outputs)
    seen = np.isfinite(expected["depth"])
    assert seen.sum() > 500 and 0 < found["evaluated"] < 64 * 64
    assert_close(found["visibility"], expected["visibility"], atol=1e-4, rtol=0.0)
    assert_close(found["depth"], expected["depth"], atol=1e-3, rtol=0.0)
    cosines = (found["normals"] * expected["normals"]).sum(-1)[seen]
    assert np.degrees(np.arccos(np.clip(cosines, -1, 1))).max() < 1.0
    assert_close(found["weight_1"][seen], expected["weight_1"][seen], atol=1e-3, rtol=0.0)
    assert_close(found["mean_curvature"][seen], expected["mean_curvature"][seen], atol=2e-3, rtol=2e-3)
    return opened


def test_pixels_by_webgl_are_those_of_field_render(browser, tmp_path):
    opened = _rabbit_by("WebGL2", browser, tmp_path, "size=16&mode=depth&engine=webgl")
    second = {engine: _second(opened, engine) for engine in ("webgl", "wasm")}
    seen = (second["webgl"] != 0).any(-1)
    assert seen.sum() > 100
    assert_close(second["wasm"][seen], second["webgl"][seen], atol=1e-3, rtol=0.0)
    opened.require_quiet()


def _second(opened: Opened, engine: str) -> np.ndarray:
    """Normals of component 2, which Python has no name for."""
    address = opened.page.url.partition("#")[0]
    opened.page.goto("about:blank")  # of another hash alone a page is not loaded anew
    opened.page.goto(f"{address}#size=16&mode=depth&engine={engine}")
    opened.loads += 1
    opened.still()
    return opened.render(("normals_2",), 32)["normals_2"]


def test_without_a_gpu_fields_run_by_wasm(either, tmp_path):
    _rabbit_by("wasm", either, tmp_path, "size=32&mode=normals").require_quiet()


def test_drag_and_wheel_orbit_and_zoom(rabbit):
    start = rabbit.page.evaluate("ddf.view.camera")
    box = rabbit.page.locator("#frame").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    rabbit.page.mouse.move(x, y)
    rabbit.page.mouse.down()
    rabbit.page.mouse.move(x + 60, y + 30)
    rabbit.page.mouse.up()
    rabbit.page.mouse.wheel(0, 100)
    rabbit.still()
    moved = rabbit.page.evaluate("ddf.view.camera")
    assert moved["azimuth"] > start["azimuth"] and moved["elevation"] > start["elevation"]
    assert moved["radius"] > start["radius"]
    rabbit.page.get_by_role("button", name="Back to the start").click()
    rabbit.still()


def _sliced(opened: Opened, quantity: str, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the page's slice, and what it shows there."""
    opened.page.get_by_role("combobox", name="Shows").select_option(quantity)
    opened.still()
    found = opened.page.evaluate("size => ddf.slice(size)", size)
    return np.array(found["points"]).reshape(-1, 3), np.array(found["values"], dtype=float)


def test_a_slice_shows_what_the_field_says_along_one_direction(rabbit):
    field = ddf.load("rabbit-network")
    points, depth = _sliced(rabbit, "depth", 64)
    low, high = field.corners.min(axis=0), field.corners.max(axis=0)
    assert len(points) > 200 and (points > low - 1e-6).all() and (points < high + 1e-6).all()
    assert_close(points[:, 0], np.full(len(points), (low[0] + high[0]) / 2))
    ahead = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    expected = field.query(points, ahead, ("depth", "visibility"))
    assert 50 < np.isfinite(expected["depth"]).sum() < len(points)
    assert_close(depth, expected["depth"], atol=1e-3, rtol=0.0)
    points, visibility = _sliced(rabbit, "visibility", 64)
    assert_close(visibility, expected["visibility"], atol=1e-4, rtol=0.0)
    said = rabbit.page.get_attribute("#canvas", "aria-label")
    assert f"a slice at x = {(low[0] + high[0]) / 2:.2f} shows Visibility" in said


def test_keys_and_slider_move_the_slice_and_what_lies_before_it_is_gone(rabbit):
    _sliced(rabbit, "visibility", 8)
    whole = rabbit.page.evaluate("ddf.view.slice.at")
    rabbit.page.focus("#frame")
    rabbit.page.keyboard.press(".")
    rabbit.still()
    assert rabbit.page.evaluate("ddf.view.slice.at") == pytest.approx(whole + 0.02)
    rabbit.page.get_by_role("slider", name="Where").fill("0")
    rabbit.still()
    points = np.array(rabbit.page.evaluate("size => ddf.slice(size)", 16)["points"]).reshape(-1, 3)
    assert_close(points[:, 0], np.full(len(points), ddf.load("rabbit-network").corners[:, 0].min()))
    rabbit.page.get_by_role("slider", name="Where").evaluate("one => one.value = '0.5'")
    rabbit.page.evaluate("ddf.view.slice.at = 0.5")


def test_distances_are_as_good_as_those_of_python_to_as_many_hits(rabbit):
    field = ddf.load("rabbit-network")
    points, distances = _sliced(rabbit, "udf", 64)
    expected, ways = field.udf(points)
    others, other_ways = checked_cloud.draw(field.framed, HITS, seed=1).distances(points)
    bound = np.abs(others - expected).mean()
    assert np.abs(distances - expected).mean() < 1.3 * bound < 0.1 * expected.mean()
    _, directions = _sliced(rabbit, "closest", 64)
    cosines, bound = ((each.reshape(-1, 3) * ways).sum(axis=1) for each in (directions, other_ways))
    assert np.median(np.arccos(cosines.clip(-1, 1))) < 1.3 * np.median(np.arccos(bound.clip(-1, 1)))
    assert f"the surest of {HITS:,} hits" in rabbit.page.inner_text("#legend")


@pytest.fixture(scope="module")
def ring(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("patches") / "ring"
    patch_fitting.fit(torus(), octree.PatchConfig(1e-3), folder)
    return folder


@pytest.fixture(scope="module")
def pair(browser, ring) -> Iterator[Opened]:
    (ring / "pair.yaml").write_text(SCENE)
    page = views.page_of([ring / "pair.yaml"])
    opened = _open(browser, ring / "pair.html", f"size=8&mode=depth&hits={HITS}", page)
    yield opened
    opened.require_quiet()


def test_a_scene_shows_the_nearest_of_its_fields(pair, ring):
    outputs = ("visibility", "depth", "normals")
    expected = ddf.read_scene(ring / "pair.yaml").render(35, 25, size=32, outputs=outputs)
    found = pair.render(outputs, 32)
    assert np.isfinite(expected["depth"]).sum() > 100
    for name in outputs:
        assert_close(found[name], expected[name], atol=1e-3, rtol=0.0)
    fewer = pair.render(("depth",), 32)
    assert fewer["evaluated"] == found["evaluated"]  # of rays that hit the front one, the other is asked for nothing
    assert_close(fewer["depth"], expected["depth"], atol=1e-3, rtol=0.0)


def test_a_handle_moves_its_object(pair):
    where = "ddf.view.world.fields[1].record.world_from_mesh.translation"
    before = pair.page.evaluate(where)
    box = pair.page.locator("#overlay circle").nth(1).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    pair.page.mouse.move(x, y)
    pair.page.mouse.down()
    pair.page.mouse.move(x, y - 50)
    pair.page.mouse.up()
    pair.still()
    after = pair.page.evaluate(where)
    assert after[1] > before[1] + 0.05 and pair.page.evaluate("ddf.view.camera.azimuth") == 35
    pair.page.get_by_label("rabbit-network, y").fill(str(before[1]))
    pair.still()
    assert pair.page.evaluate(where)[1] == pytest.approx(before[1])


def test_patches_are_walked_on_the_cpu_as_python_does(either, ring):
    opened = _open(either, ring / "ring.html", f"size=16&mode=mean_curvature&hits={HITS}", views.page_of([ring]))
    assert "by JavaScript" in opened.page.inner_text("#status")
    assert opened.page.locator("input[value=weight_1], input[value=normals_2]").count() == 0
    outputs, field = ("visibility", "depth", "normals", "mean_curvature"), ddf.load(ring)
    found, expected = opened.render(outputs, 128), field.render(35, 25, size=128, outputs=outputs)
    assert 2000 < np.isfinite(expected["depth"]).sum() < 12_000
    for name in outputs:
        assert_close(found[name], expected[name], atol=1e-6, rtol=1e-5)
    points, distances = _sliced(opened, "udf", 32)
    expected, _ = field.udf(points)
    assert len(points) > 80 and np.abs(distances - expected).mean() < 0.02 * expected.mean()
    opened.require_quiet()


def test_keys_alone_turn_the_camera_and_choose_what_is_shown(either, ring):
    opened = _open(either, ring / "keys.html", "size=16&mode=depth", views.page_of([ring]))
    start, before = (opened.page.evaluate("ddf.view.camera"), opened.page.get_attribute("#canvas", "aria-label"))
    opened.page.keyboard.press("3")  # before anything has the focus
    opened.still()
    assert opened.page.is_checked("input[value=normals]")
    opened.page.keyboard.press("Tab")
    assert opened.page.evaluate("document.activeElement.id") == "frame"
    for key in ("ArrowRight", "ArrowUp", "+", "4"):
        opened.page.keyboard.press(key)
    opened.still()
    turned = opened.page.evaluate("ddf.view.camera")
    assert turned["azimuth"] == pytest.approx(start["azimuth"] + 6)
    assert turned["elevation"] == pytest.approx(start["elevation"] + 6)
    assert turned["radius"] == pytest.approx(0.9 * start["radius"])
    assert opened.page.is_checked("input[value=visibility]")
    said = opened.page.get_attribute("#canvas", "aria-label")
    assert said != before and "visibility" in said and "azimuth 41" in said
    opened.page.keyboard.press("r")
    opened.still()
    assert opened.page.evaluate("ddf.view.camera") == start
    opened.page.locator("input[value=depth]").click()
    opened.page.keyboard.press("3")  # with the focus on a mode
    opened.still()
    assert opened.page.is_checked("input[value=normals]") and "1 to 5" in opened.page.inner_text("#help")
    opened.require_quiet()


PUT = """() => {
  const [view, opening, put] = [ddf.view, ddf.view.mode, ddf.view.put.bind(ddf.view)];
  const covered = () => document.getElementById("first") !== null;
  window.before = covered();
  view.put = (what) => (put(what), view.mode !== opening && (window.told ??= [what.full, covered()]));
}"""


def test_another_mode_asked_at_once_is_not_covered_by_the_opening_picture(browser, tmp_path):
    viewer_page.write(tmp_path / "first.html", views.page_of([RABBIT]))
    page = browser.new_page()
    page.goto((tmp_path / "first.html").as_uri())
    page.wait_for_function("() => window.ddf", timeout=PATIENCE_MS)
    page.evaluate(PUT)
    page.keyboard.press("2")
    page.wait_for_function("() => window.told", timeout=PATIENCE_MS)
    assert page.evaluate("[before, told, ddf.view.mode.key]") == [True, [False, False], "2"]


@pytest.mark.parametrize(
    "asked, said",
    [
        ("{azimuth: NaN}, 8, ['depth']", "azimuth must be a finite number; got NaN"),
        ("{}, 0, ['depth']", "size must be a positive integer; got 0"),
        ("{}, 8, ['colour']", "outputs must be among visibility, depth, .*; got colour"),
    ],
)
def test_what_render_is_not_given_right_is_an_error(rabbit, asked, said):
    assert re.search(said, rabbit.page.evaluate(f"ddf.render({asked}).catch((error) => error.message)"))


PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2.0}
LEAVING = {  # what a page may try, and the part of its policy that stops it
    "connect-src": "fetch('http://127.0.0.1:9/').catch(() => 0)",
    "img-src": "new Image().src = 'http://127.0.0.1:9/'",
}


def test_the_policy_of_the_page_stops_what_would_leave_it(either, ring):
    opened = _open(either, ring / "policy.html", "size=16&mode=weight_1", views.page_of([ring]))
    assert opened.page.is_checked("input[value=shaded]")  # patches have no weights
    opened.require_quiet()
    for stopped, attempt in LEAVING.items():
        told = "addEventListener('securitypolicyviolation', each => done(each.effectiveDirective))"
        script = f"() => new Promise(done => {{ {told}; {attempt}; setTimeout(done, 5000, 'nothing'); }})"
        assert opened.page.evaluate(script) == stopped


@pytest.fixture
def phone(browser, ring) -> Iterator[Opened]:
    opened = _open(browser, ring / "phone.html", "mode=depth", views.page_of([ring]), has_touch=True, **PHONE)
    yield opened
    opened.require_quiet()


def _shown(opened: Opened) -> np.ndarray:
    """The picture as `Save PNG` gives it."""
    with opened.page.expect_download() as download:
        opened.page.get_by_role("button", name="Save PNG").click()
    return np.asarray(Image.open(download.value.path()), dtype=float)


def _middle(opened: Opened) -> np.ndarray:
    """Of what is seen, x and y in shares of the picture."""
    rows, columns = np.nonzero(_shown(opened)[..., 3] > 127)
    return np.array([columns.mean(), rows.mean()]) / opened.page.evaluate("ddf.view.full")


def test_fingers_orbit_shift_and_pinch_on_a_phone(phone):
    side = phone.page.locator("#canvas").bounding_box()["width"]
    touch = phone.page.context.new_cdp_session(phone.page)

    def move(*ways: tuple[tuple[int, int], tuple[int, int]]) -> dict[str, Any]:
        for kind, end in (("touchStart", 0), ("touchMove", 1), ("touchEnd", None)):
            points = (
                [] if end is None else [{"x": way[end][0], "y": way[end][1], "id": i} for i, way in enumerate(ways)]
            )
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
            phone.page.evaluate("new Promise(requestAnimationFrame)")  # moves are handed on once a frame
        phone.still()
        return phone.page.evaluate("ddf.view.camera")

    start, before = phone.page.evaluate("ddf.view.camera"), _middle(phone)
    phone.page.evaluate("scrollTo(0, 0)")
    pinched = move(((150, 300), (100, 300)), ((200, 300), (250, 300)))
    assert pinched["radius"] == pytest.approx(start["radius"] / 3) and pinched["azimuth"] == start["azimuth"]
    back = move(((100, 300), (150, 300)), ((250, 300), (200, 300)))
    assert back == {name: pytest.approx(value) for name, value in start.items()}
    shifted = move(((150, 300), (190, 340)), ((200, 300), (240, 340)))
    assert shifted["radius"] == pytest.approx(start["radius"])
    assert_close(_middle(phone) - before, np.full(2, 40 / side), atol=0.01, rtol=0.0)
    phone.page.evaluate("scrollTo(0, 0)")
    turned = move(((150, 300), (190, 300)))
    assert turned["azimuth"] > start["azimuth"] + 15 and turned["target"] == shifted["target"]


def test_edges_are_smooth_at_rest(browser, ring):
    opened = _open(browser, ring / "edges.html", "size=64&mode=shaded", views.page_of([ring]))
    fine, coarse = (np.isfinite(ddf.load(ring).render(35, 25, size=size)["depth"]) for size in (512, 64))
    covered = fine.reshape(64, 8, 64, 8).mean(axis=(1, 3))
    rim = (covered > 0) & (covered < 1)
    error = np.abs(_shown(opened)[..., 3] / 255 - covered)
    assert rim.sum() > 100 and error[rim].mean() < 0.5 * np.abs(coarse - covered)[rim].mean() and error.max() < 0.5
    opened.require_quiet()


def test_a_shared_address_brings_others_to_the_same_picture(browser, pair):
    pair.page.evaluate("ddf.view.world.fields[1].record.world_from_mesh.translation = [0.3, 0.1, 0.2]")
    pair.page.focus("#frame")
    for key in ("ArrowLeft", "w", "-", "3", "p"):
        pair.page.keyboard.press(key)
    pair.page.get_by_role("button", name="Share").click()
    copy = Opened(browser.new_page())
    copy.page.goto(pair.page.url)
    copy.still()
    state = (
        "[ddf.view.camera, ddf.view.mode.name, ddf.view.slice.quantity.name, ddf.view.slice.at,"
        " ddf.view.world.fields.map(each => each.record.world_from_mesh.translation)]"
    )
    (camera, *rest), (copied, *others) = pair.page.evaluate(state), copy.page.evaluate(state)
    assert others == rest and rest[0] == "normals"
    assert copied == {name: pytest.approx(value, rel=1e-4, abs=1e-5) for name, value in camera.items()}
    copy.page.close()


def test_a_model_shows_the_patches_that_it_makes_of_its_sample(browser, tmp_path):
    folder = shipped_models.place("chair")
    opened = _open(browser, tmp_path / "chair.html", "size=16&mode=depth", views.page_of([folder]))
    assert (tmp_path / "chair.html").stat().st_size < 500_000
    assert opened.page.inner_text("#about").startswith("What the model chair makes of sample_0.png: ")
    expected = ddf.reconstruct(folder / "sample_0.png", folder).field.render(35, 25, size=64)["depth"]
    assert np.isfinite(expected).sum() > 500
    assert_close(opened.render(("depth",), 64)["depth"], expected, atol=1e-6, rtol=0.0)
    opened.require_quiet()
