"""The stages on a single shape end to end, on a tiny field: files, printed numbers."""

from pathlib import Path

import pytest
import yaml
from _experiment_report import make, markdown_tables
from _shapes import torus
from _tiny_fits import SECTION

from ddf.core import storage
from ddf.fit import field_diagnostics
from ddf.geometry import mesh_io
from ddf_lab.evaluation import shape_fits
from ddf_lab.report import shape_page, shape_views
from ddf_lab.run import Run

_PAGE = {"README.md", "fit.csv", "ablate_samples.csv", "views.webp", "slices.webp", "losses.svg"}


@pytest.fixture(scope="module")
def fitted_shape(tmp_path_factory):
    """The current folder of a finished experiment."""
    folder = tmp_path_factory.mktemp("shape")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for module, name, value in (
            (shape_views, "PICTURE_SIZE", 12),
            (shape_views, "RAYS", 50),
            (shape_fits, "SAMPLES", 600),
            (shape_fits, "HELD_OUT", 50),
        ):
            patch.setattr(module, name, value)
        Path("torus.ply").write_bytes(mesh_io.ply_bytes(torus(sections=16)))
        Path("tiny_fit.yaml").write_text(yaml.safe_dump({"fit": {**SECTION, "mesh": "torus.ply"}}))
        for name in ("fit_shape", "ablate_samples", "report_shape"):
            make(name, Run.read("tiny_fit.yaml"))
        yield folder


def test_stages_write_tables_and_a_page_with_their_numbers(fitted_shape):
    folder = fitted_shape / "artifacts" / "tiny_fit"
    assert {path.name for path in (folder / "report").iterdir()} == _PAGE
    text = (folder / "report" / "README.md").read_text()
    table, record = storage.load_table(folder / "ablate_samples" / "ablate_samples.csv")
    assert len(table) == 7 * 2 * 6 * 2
    assert record["sources"].keys() == {"artifacts/tiny_fit/ablate_samples/ablation.json"}
    rows = [row for table in markdown_tables(text) for row in table]
    metrics = storage.read_json(folder / "fit_shape" / "fit.json")
    held_out, number = metrics["held_out"], shape_page.number
    assert ["L1 × 10 of depth", "here", *(number(held_out["depth_l1_x10"][kind]) for kind in "UABOTS")] in rows
    assert ["L1 × 10 of depth", "paper, bunny", "0.45", "0.75", "0.19", "0.50", "0.77", "0.67"] in rows
    found = storage.read_json(folder / "fit_shape" / "diagnostics.json")
    assert tuple(found) == field_diagnostics.NAMES
