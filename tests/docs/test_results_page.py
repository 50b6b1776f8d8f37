"""Every number in a table of results of README.md and docs/ is one of a committed file, as docs/results.py says."""

import itertools
import re
import types
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import claims, scoring
from ddf_lab.report import model_sections, pages, scores
from docs import results


@pytest.mark.parametrize("page, above, fill", results.TABLES, ids=[above for _, above, _ in results.TABLES])
def test_tables_are_of_the_committed_files(page, above, fill):
    _, table, _ = results.parts((results.ROOT / page).read_text(), above)
    assert results.cells(table) == fill(results.cells(table))


@pytest.mark.parametrize(
    "page", ["README.md", *sorted(f"docs/{file.name}" for file in (results.ROOT / "docs").glob("*.md"))]
)
def test_no_table_has_a_number_without_a_key(page):
    text = (results.ROOT / page).read_text()
    keyed = {
        results.parts(text, above)[1]
        for own, above in [*((own, above) for own, above, _ in results.TABLES), *results.SET]
        if own == page
    }
    for table in re.findall(r"(?m)^\|.*\n\|[ :|-]+\|\n((?:\|.*\n)+)", text):
        found = [cell for row in results.cells(table) for cell in row[1:] if results.NUMBER.fullmatch(cell)]
        assert table in keyed or not found, f"{page}: {found[0]} has no key: enter its table in TABLES"


@pytest.mark.parametrize("page, above, report", results.CLAIMS, ids=[report for *_, report in results.CLAIMS])
def test_what_is_claimed_below_a_table_is_what_the_report_claims(page, above, report):
    after = results.parts((results.ROOT / page).read_text(), above)[2]
    assert after.startswith(f"\n- {results.best(results.Measured(report))}\n")


@pytest.mark.parametrize(("page", "begins", "fill"), results.LINES)
def test_lines_of_numbers_are_those_of_the_committed_files(page, begins, fill):
    assert f"\n{begins}{fill()}\n" in (results.ROOT / page).read_text()


def test_minutes_stand_with_the_steps_of_the_experiment(tmp_path, monkeypatch):
    for name in ("reports/cpu", "configs"):
        (tmp_path / name).mkdir(parents=True)
    minutes = "DDF 10.0 min, PC-SIREN 30.0 min, DDF+image 25.0 min"
    images = "".join(f"| Π<sub>g</sub>, Π̂ | {name} | 1 |\n" for name in results.MODELS)
    page = f"Wall time of the trainings, summed over categories: {minutes}.\n{images}"
    (tmp_path / "reports" / "cpu" / "README.md").write_text(page)
    (tmp_path / "configs" / "below.yaml").write_text("ddf: {steps: 7}\npcsiren: {steps: 8}\nddf_image: {steps: 9}\n")
    (tmp_path / "configs" / "cpu.yaml").write_text("base: below\nddf: {learning_rate: 1.0}\nddf_image: {steps: 1650}\n")
    monkeypatch.setattr(results, "ROOT", tmp_path)
    begins = (
        "trainings DDF 10.0 min (7 steps), PC-SIREN 30.0 min (8), DDF+image 25.0 min (1,650), 1.25 times the others'"
    )
    assert results.times("cpu").startswith(begins)


def test_a_scan_is_claimed_to_be_better_or_worse_than_an_image_by_the_tables_rule(monkeypatch):
    """Of chairs D_C is lower and F no other than chance makes it; of planes F is lower, D_C all but lower."""
    wave = np.sin(np.arange(16.0))
    each = {
        "chair": {results.CHAMFER: -0.5 + 0.1 * wave, results.F_TAU: 0.1 + wave},
        "plane": {results.CHAMFER: -0.02 - 0.1 * wave, results.F_TAU: -2 + wave},
    }
    rows = [
        {"what": f"{c}, test: {way}", "each": {m: 1.0 + values * (way == "depth") for m, values in scores.items()}}
        for c, scores in each.items()
        for way in ("image", "depth")
    ]
    monkeypatch.setattr(results, "bench", lambda _: rows)
    assert results.gains() == "a scan is better than an image for chairs by D<sub>C</sub>; worse for planes by F."
    mean, error, _ = results.over_image("chair", results.F_TAU)
    assert error == pytest.approx(wave.std(ddof=1) / 4) and mean == pytest.approx(0.1 + wave.mean())


def test_near_relatives_are_those_of_the_report():
    page = results.Measured("real:real").page
    for number, kind in enumerate(("near", "others")):
        (row,) = re.findall(rf"(?m)^\| (?:real plane)? \| {kind} \| (\d+) \| \S+ \| (.*) \|$", page)[:1]
        name, *found = results.relatives(results.Measured("real:real"), [["near"], ["others"]])[number]
        assert name == f"{kind}, {row[0]}"
        assert np.allclose([float(each) for each in found], [float(each) for each in row[1].split(" | ")], atol=0.051)


@pytest.mark.parametrize(("above", "count"), [("On real shapes:", 14), ("On procedural shapes:", 9)])
def test_readme_has_all_rows(above, count):
    assert len(results.cells(results.parts((results.ROOT / "README.md").read_text(), above)[1])) == count


def test_an_open_report_is_claimed_from_its_bold_cells(tmp_path, monkeypatch):
    """In F(τ) DDF+image is 8 better for chairs, at the true camera, and 8 worse for cars, by the predicted one.
    Retrieval beats it for chairs. Nothing else differs.
    """
    random, rows, columns = np.random.default_rng(0), [], ("Pi_g-L", "Pi_pred-L")
    for category, method, column in itertools.product(results.CATEGORIES, results.MODELS.values(), columns):
        ahead = {("chair", "ddf_image", "Pi_g-L"): 8.0, ("car", "ddf_image", "Pi_pred-L"): -8.0}
        ahead = ahead.get((category, method, column), 0.0)
        for shape in range(12):
            score = (50 + ahead + random.normal()) / 100
            distance = 0.001 + 1e-5 * random.normal()
            rows.append((f"real {category}", method, column, f"s{shape}", 0, distance, score, score, score, score, 0.5))
    rows += [
        ("real chair", "retrieval", "Pi_g-L", f"s{shape}", 0, 0.001, 0.7, 0.7, 0.7, 0.7, 0.5) for shape in range(12)
    ]
    scored = pd.DataFrame(rows, columns=[*claims.IMAGE, *(metric.score for metric in cloud_scores.METRICS.values())])
    table = scoring.summary(scored, pd.DataFrame(columns=[*claims.IMAGE]), pd.DataFrame(columns=["category"]))
    groups = {f"real {category}": category for category in results.CATEGORIES}
    found = types.SimpleNamespace(table=table, trainings=[scored], per_image=scored, groups=groups)
    labels = {metric: scores.LABELS[metric] for metric in (results.CHAMFER, results.F_TAU)}
    printed = scores.pairs(cast(Any, found), groups, columns, model_sections.MODELS, "", labels=labels)
    assert printed is not None
    folder = tmp_path / "reports" / "own"
    page = pages.Page("Own", ["With the true camera, DDF+image is best"], [pages.Section("R", [printed, ""])])
    pages.write(page, folder)
    (folder / "si3dr.csv").write_text(table.to_csv(index=False))
    monkeypatch.setattr(results, "ROOT", tmp_path)
    told = "Claimed none: scores per image of this run were not kept."
    assert results.best(results.Measured("own:real")).endswith(told)
    assert results.Measured("own:real").claims == set()
    (folder / "per_image.csv").write_text(claims.as_text([scored]))
    one = r"F\(τ\) \(by (\d\.\d) ± [01]\.\d, 12 shapes, 1 training alone"
    won = rf"DDF\+image, true camera: chair {one}; retrieval by the true camera: 70\.0\)"
    said = rf"by one image: {won}\.\n- Claimed worse than both: DDF\+image, predicted camera: car {one}\)\.$"
    match = re.search(said, results.best(results.Measured("own:real")))
    assert match and all(abs(float(gap) - 8) < 1 for gap in match.groups())


def test_no_fake_has_a_better_score_than_samples():
    errors = {row["what"]: row["error"] for row in results.bench("generate")}
    for each in results.CATEGORIES:  # a score that is fooled by noise, blur or one shape says nothing
        score = {name: errors[f"{each}: {name}"]["energy_x1000"] for name in ("samples", *results.FAKES)}
        assert min(score, key=score.__getitem__) == "samples"
