"""The page of a generative experiment, from hand-made results."""

import _generative
import numpy as np
import pytest

from ddf.core import storage
from ddf.training import training_loop
from ddf_lab.report import generative_page
from ddf_lab.run import Run

_KIDS = {"ceiling": 0.0, "blur 2": 0.2, "blur 4": 0.3, "noise 0.05": 0.1, "noise 0.15": 0.2}


def _scores(in_order, told_apart):
    kids = {**_KIDS, "image GAN": 0.05, "2D GAN": 0.04, "mean image": 0.4, "noise": 0.9}
    clouds = {"f_score_tau_x100": 50.0, "f_score_2tau_x100": 70.0}
    return {
        "shapes": {"learned": 9, "held_out": 2, "pictured": 5},
        "held_out": {
            name: {"chamfer_l2_sq_x1000": chamfer, **clouds} for name, chamfer in (("encoded", 1.2), ("optimised", 1.0))
        },
        "divergence": {"sum": 7.5, "used": 3, "dimensions": 5},
        "distribution": {
            "prior": {"matching_x1000": 0.25, "coverage": 0.5, "told_apart": told_apart},
            "learned": {"matching_x1000": 0.125, "coverage": 0.75, "told_apart": 0.5},
        },
        "nearest": ["a"],
        "images": {
            "rows": {name: {"kid": kid, "kid_spread": 0.001} for name, kid in kids.items()},
            "in_order": in_order,
            "real": 20,
            "spoiled": list(_KIDS)[1:],
        },
    }


@pytest.mark.parametrize(("in_order", "told_apart"), [(True, 0.75), (False, 0.875)])
def test_the_page_says_what_was_measured(tmp_path, monkeypatch, in_order, told_apart):
    monkeypatch.chdir(tmp_path)
    run = Run(tmp_path / "tiny.yaml", {}, "car")
    evaluated = run.folder("evaluate_generative")
    storage.write_json(evaluated / "scores.json", _scores(in_order, told_apart))
    names = "samples_normals samples_colours samples_nearest rival_colours real_colours"
    images = {name: np.full((3, 3, 64, 64), 0.5, np.float32) for name in names.split()}
    storage.save_tensors(evaluated / "pictures.safetensors", images, {})
    log = "step,loss,seconds\n100,1.5,120.0\n"
    storage.write_text(run.folder("train_vae") / training_loop.LOG, log)
    generative_page.write(run, _generative.GAN, _generative.SCORES)
    text = (run.page / "README.md").read_text()
    assert ("| 50 ± 1 |" in text) == in_order and "1.20 times that of latents optimised" in text
    assert f"| samples of the prior | 0.250 | 50 | {100 * told_apart:.0f} |" in text
    assert f"This model {'works' if in_order else 'fails'}: its samples are told apart" in text
