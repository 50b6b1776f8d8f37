"""The second calculation of bold cells agrees with the report's and with the pages in git, and sees what is wrong."""

import contextlib
import dataclasses
import re

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ddf_lab.evaluation import claims
from ddf_lab.report import experiment_page, pages, stage_results
from docs import recomputed


@pytest.fixture(scope="module")
def page(reported, tmp_path_factory):
    """Of more test shapes, that there be something to claim, and of two trainings."""
    with contextlib.chdir(reported[2].parents[2]):
        found = stage_results.read_results(reported[1])
    scored = pd.concat([found.per_image.assign(id=found.per_image["id"] + str(number)) for number in range(8)])
    second = scored.assign(chamfer_l2_sq=1.01 * scored["chamfer_l2_sq"], f_score_tau=0.99 * scored["f_score_tau"])
    both = [scored, second]
    means = found.table.copy()
    keys = ["category", "method", "column"]
    for metric, factor in (("chamfer_l2_sq", 1.005), ("f_score_tau", 0.995)):
        means.loc[means["metric"].str.startswith(metric), "value"] *= factor
    folder = tmp_path_factory.mktemp("open")
    found = dataclasses.replace(found, trainings=both, table=means, seeds=1)
    pages.write(experiment_page.build(found), folder)
    (folder / "per_image.csv").write_text(claims.as_text(both))
    assert set(scored.groupby(keys).groups) == set(recomputed.Scores(folder).groups)
    return folder


def test_both_calculations_agree_and_something_is_bold(page):
    assert recomputed.wrong(page) == []
    assert "**0." in (page / "README.md").read_text()


def test_a_claim_names_effect_interval_and_number(page):
    """Over one training the interval is that of SciPy's paired test."""
    scores = recomputed.Scores(page)
    cell = ("chair", "ddf", "Pi_g-L", "F<sub>τ</sub> ↑")
    best = max(scores.of((cell[0], method, *cell[2:]))[1] for method in ("pc_siren", "ddf_image"))
    gap, (shapes, trainings) = scores.of(cell)[1] - best, scores.of(cell)[0].shape[::-1]
    assert scores.told(cell).startswith(f"by {gap:.1f} ± ")
    assert scores.told(cell).endswith(f", {shapes} shapes, {trainings} trainings")
    first, second = np.random.default_rng(0).normal([[5.0], [4.0]], 1, (2, 9))
    scores.groups = {
        ("a", method, "Pi_g-L"): pd.DataFrame({"training": 0, "id": range(9), "f_score_tau": values / 100})
        for method, values in (("ddf", first), ("pc_siren", second))
    }
    low, high = stats.ttest_rel(first, second).confidence_interval()
    half = f"by {(low + high) / 2:.1f} ± {(high - low) / 2:.1f}, 9 shapes, 1 training alone"
    assert scores.told(("a", *cell[1:])) == half


WRONG = {  # what is put into the page, for what, and what is told
    r"\*\*(0\.\d+)\*\*": (r"\1", "should be bold"),
    r"-S \| (0\.\d\d\d) \|": (r"-S | **\1** |", "should not be bold"),
    r"\| 0\.\d\d\d \|": ("| 9.999 |", "9.999 is printed"),
    r"is best for": ("is better for", "With the true camera"),
}


def test_what_is_wrong_is_told(page, tmp_path):
    text = (page / "README.md").read_text()
    for old, (new, _) in WRONG.items():
        text, count = re.subn(old, new, text, count=1)
        assert count
    (tmp_path / "README.md").write_text(text)
    (tmp_path / "per_image.csv").write_bytes((page / "per_image.csv").read_bytes())
    told = recomputed.wrong(tmp_path)
    assert [said for _, said in WRONG.values() if not any(said in line for line in told)] == []


@pytest.mark.parametrize("folder", recomputed.OPEN, ids=lambda folder: folder.name)
def test_pages_in_git_say_what_their_scores_per_image_say(folder):
    assert recomputed.wrong(folder) == []
