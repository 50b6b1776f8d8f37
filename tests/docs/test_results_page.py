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


@pytest.mark.parametrize(("page", "begins", "report"), results.TIMES)
def test_times_are_those_of_the_report(page, begins, report):
    assert f"\n{begins}{results.times(report)}\n" in (results.ROOT / page).read_text()


@pytest.mark.parametrize(("above", "count"), [("On real shapes:", 10), ("On procedural shapes:", 10)])
def test_readme_has_all_rows(above, count):
    assert len(results.cells(results.parts((results.ROOT / "README.md").read_text(), above)[1])) == count


def test_an_open_report_is_claimed_from_its_bold_cells(tmp_path, monkeypatch):
    """DDF+image is 8 better in F(τ) for real chairs at the true camera, and nothing else differs."""
    random, rows, columns = np.random.default_rng(0), [], ("Pi_g-L", "Pi_pred-L")
    for category, method, column in itertools.product(results.CATEGORIES, results.MODELS.values(), columns):
        ahead = 8.0 * ((category, method, column) == ("chair", "ddf_image", "Pi_g-L"))
        for shape in range(12):
            score = (50 + ahead + random.normal()) / 100
            rows.append((f"real {category}", method, column, f"s{shape}", 0, 0.001, score, score, score, score, 0.5))
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
    told = "None is claimed to be better: scores per image of this run were not kept."
    assert results.best(results.Measured("own:real")).endswith(told)
    assert results.Measured("own:real").claims == set()
    (folder / "per_image.csv").write_text(claims.as_text([scored]))
    said = r"DDF\+image, true camera: chair F\(τ\) \(by (\d\.\d) ± 0\.\d, 12 shapes, 1 training alone\)\."
    told = results.best(results.Measured("own:real"))
    match = re.search(f"Claimed to be better than both other models: {said}$", told)
    assert match and abs(float(match[1]) - 8) < 1


def test_no_fake_has_a_better_score_than_samples():
    errors = {row["what"]: row["error"] for row in results.bench("generate")}
    for each in results.CATEGORIES:  # a score that is fooled by noise, blur or one shape says nothing
        score = {name: errors[f"{each}: {name}"]["energy_x1000"] for name in ("samples", *results.FAKES)}
        assert min(score, key=score.__getitem__) == "samples"
