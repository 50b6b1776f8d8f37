"""The report of a small experiment: every number comes from the table, nothing is loaded from outside."""

import dataclasses
import itertools
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from _fake_experiment import EVALUATE_SECTION, SIZES, FakeExperiment

from ddf.core import checks, config, storage
from ddf.evaluation import baselines, paper_results, scoring, seed_means
from ddf.report import pages
from ddf.report.experiment import charts, example_strips, experiment_page, score_tables, stage_results

_ROOT = Path(__file__).resolve().parents[3]
_FILES = {"README.md", "index.html", "si3dr.csv", "baselines.svg", "losses.svg", "images.svg", "cameras.svg"}
_FILES |= {"shapes.svg", "azimuth.svg"}


def _experiment_file(experiment):
    """cpu.yaml with the fake's own evaluate and report sections."""
    text = (_ROOT / "configs" / "cpu.yaml").read_text().partition("evaluate:")[0]
    return Path(experiment.write_config(f"{text}evaluate: {EVALUATE_SECTION}\nreport: {{examples: 3}}\n"))


def _run(stage, config_path, *arguments):
    runpy.run_path(str(_ROOT / "stages" / f"{stage}.py"))["run"](config_path, *arguments)


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """A finished experiment with categories of which the paper knows two, and its folder as the current one."""
    with pytest.MonkeyPatch.context() as patch:
        root = tmp_path_factory.mktemp("report")
        experiment = FakeExperiment(root, categories=("chair", "plane", "primitives"), train=4, test=2)
        patch.chdir(root)
        config_path = _experiment_file(experiment)
        _run("evaluate", config_path)
        _run("report", config_path)
        yield experiment, config_path, root / "reports" / "fake"


def _markdown_tables(text):
    """Rows of cells of every pipe table, bold marks taken away."""
    tables, rows = [], []
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            rows.append([cell.strip().replace("**", "") for cell in line.strip("|").split(" | ")])
        elif rows:
            tables.append(rows)
            rows = []
    return tables


def _measured(folder):
    table = pd.read_csv(folder / "si3dr.csv")
    table = table[table["source"] == scoring.MEASURED]
    return table.set_index(["category", "method", "column", "metric"])["value"]


def test_every_file_and_category_is_there(reported):
    experiment, _, folder = reported
    names = _FILES | {f"strip_{category}.webp" for category in experiment.categories}
    assert {path.name for path in folder.iterdir()} == names
    for page in ("README.md", "index.html"):
        text = (folder / page).read_text()
        assert all(
            f"strip_{c}.webp" in text or f"{c.capitalize()}: best to worst" in text for c in experiment.categories
        )
    linked = re.findall(r"\]\(([^)]+)\)", (folder / "README.md").read_text())
    assert set(linked) <= names and {name for name in names if name.endswith((".webp", ".svg"))} <= set(linked)


def test_html_is_self_contained(reported):
    text = (reported[2] / "index.html").read_text()
    without_data = re.sub(r'src="data:[^"]+"', "", text)
    assert "http" not in without_data and "src=" not in without_data and "url(" not in without_data
    assert text.count('src="data:image/webp;base64,') == 3 and text.count('src="data:image/svg+xml;base64,') == 6


def test_printed_values_are_those_of_the_table(reported):
    _, _, folder = reported
    table = pd.read_csv(folder / "si3dr.csv")
    assert tuple(table.columns) == scoring.TABLE_FIELDS
    value = table.set_index(["source", "category", "method", "column", "metric"])["value"]
    rows = _markdown_tables((folder / "README.md").read_text())[0]
    heads = [head for head in paper_results.SI3DR_COLUMNS if head[0] in ("ddf", "pc_siren")]
    body = rows[2:]
    assert len(rows[0]) == 3 + 9 + 11 and len(body) == 9
    for i, row in enumerate(body):
        category = ("chair", "plane", "primitives")[i // 3]
        metric = list(score_tables.METRIC_LABELS)[i % 3]
        digits = 3 if i % 3 == 0 else 2
        printed = [value["measured", category, *head, metric] for head in heads]
        assert row[2:12] == ["4", *(f"{number:.{digits}f}" for number in printed)]
        known = category in paper_results.SI3DR
        quoted = paper_results.SI3DR[category][i % 3] if known else None
        assert row[12:] == ([f"{number:.{digits}f}" for number in quoted] if quoted else ["–"] * 11)


def test_moved_shapes_are_told_where_shapes_are_moved(reported):
    _, config_path, folder = reported
    assert "moves until its silhouette" in (folder / "README.md").read_text()
    results = stage_results.read_results(config_path)
    clouds = {**results.settings["pointclouds"], "shape_correction": None}
    plain = dataclasses.replace(results, settings={**results.settings, "pointclouds": clouds})
    assert "moves until its silhouette" not in pages.markdown(experiment_page.build(plain, {}, 0))


def test_paper_numbers_are_only_in_columns_that_say_so(reported):
    rows = _markdown_tables((reported[2] / "README.md").read_text())[0]
    assert all("measured here" in head for head in rows[0][3:12])
    assert all("paper, ShapeNet" in head for head in rows[0][12:])
    table = pd.read_csv(reported[2] / "si3dr.csv")
    assert set(table["source"]) == {"measured", "paper, ShapeNet"}
    assert table[table["source"] != "measured"]["images"].isna().all()
    assert (table[table["source"] == "measured"]["images"] > 0).all()


def test_bold_is_the_better_model_of_each_column(reported):
    text = (reported[2] / "README.md").read_text()
    line = next(line for line in text.splitlines() if line.startswith("| chair | D<sub>C</sub>"))
    cells = [cell.strip() for cell in line.strip("| ").split(" | ")][3:12]
    numbers = [float(cell.strip("*")) for cell in cells]
    pairs = {0: 5, 1: 6, 3: 7, 4: 8}  # DDF and PC-SIREN columns of the same name; Pi_corrected-S has no rival
    for ddf, pc_siren in pairs.items():
        assert cells[ddf].startswith("**") == (numbers[ddf] < numbers[pc_siren])
        assert cells[pc_siren].startswith("**") == (numbers[pc_siren] < numbers[ddf])
    assert not cells[2].startswith("**")


def test_one_cycle_and_baseline_tables_have_every_row(reported):
    text = (reported[2] / "README.md").read_text()
    baseline, _, one_cycle = _markdown_tables(text)[1:4]
    assert len(baseline) == 2 + 3 * len(score_tables.BASELINE_ORDER)
    assert len(one_cycle) == 2 + 9 and len(one_cycle[0]) == 3 + 4 + 4 + 4
    ceiling = next(row for row in baseline if row[1] == "ceiling: truth against itself")
    mean = next(row for row in baseline if row[1] == "mean shape")
    assert float(ceiling[3]) < float(mean[3]) and float(ceiling[4]) > float(mean[4])
    assert ceiling[2] == mean[2] == "4"


def test_shape_and_camera_add_up_to_the_score_with_the_predicted_camera(reported):
    _, _, folder = reported
    value = _measured(folder)
    split = next(rows for rows in _markdown_tables((folder / "README.md").read_text()) if "camera" in rows[0][4])
    assert len(split) == 2 + 9
    for row in split[2:]:
        for numbers in (row[2:6], row[6:10]):
            ceiling, shape, camera, whole = map(float, numbers)
            assert ceiling + shape + camera == pytest.approx(whole, abs=0.021)  # of numbers rounded to 0.01
    ceiling, placed, whole = (
        value["plane", *head, "chamfer_l2_sq_x1000"]
        for head in (("ceiling", "Pi_g-S"), ("ddf", "Pi_g-S"), ("ddf", "Pi_corrected-S"))
    )
    row = split[2 + 4]
    assert row[1].startswith("DDF, Π̂<sub>∇</sub>")
    assert row[2:6] == [f"{ceiling:.3f}", f"{placed - ceiling:+.3f}", f"{whole - placed:+.3f}", f"{whole:.3f}"]


def test_distances_from_ceiling_and_retrieval_are_those_of_the_table(reported):
    _, _, folder = reported
    value = _measured(folder)
    text = (folder / "README.md").read_text()
    rows = _markdown_tables(text)[2]
    assert len(rows) == 2 + 6 and "from the ceiling" in rows[0][2]
    for row, (category, method) in zip(
        rows[2:], itertools.product(("chair", "plane", "primitives"), ("ddf", "pc_siren")), strict=True
    ):
        own, ceiling, retrieved = (
            [value[category, who, "Pi_g-L", metric] for metric in ("chamfer_l2_sq_x1000", "f_score_tau_x100")]
            for who in (method, "ceiling", "retrieval")
        )
        assert row[2:4] == [f"{own[0] - ceiling[0]:+.3f}", f"{own[0] - retrieved[0]:+.3f}"]
        assert row[4:6] == [f"{own[1] - ceiling[1]:+.2f}", f"{own[1] - retrieved[1]:+.2f}"]
        assert (f"**{row[3]}**" in text) == (own[0] < retrieved[0])
        assert (f"**{row[5]}**" in text) == (own[1] > retrieved[1])


def test_evenness_of_the_clouds_is_printed_beside_that_of_the_truth(reported):
    _, _, folder = reported
    value = _measured(folder)
    rows = next(rows for rows in _markdown_tables((folder / "README.md").read_text()) if "of the truth's" in rows[0][2])
    names = ["true cloud", "as many of its points at random", "DDF", "DDF, N<sub>H</sub> = 1", "PC-SIREN"]
    assert [row[0] for row in rows[2:]] == names
    truth = value["plane", *scoring.TRUTH, "spacing_variation"]
    ddf = value["plane", "ddf", "Pi_g-L", "spacing_variation"]
    assert rows[2][3:5] == [f"{truth:.2f}", "1.00"] and rows[4][3:5] == [f"{ddf:.2f}", f"{ddf / truth:.2f}"]
    assert 0.2 < truth < 1 and 0.2 < ddf < 1


def test_training_budgets_are_stated_with_their_difference(reported):
    results = stage_results.read_results(reported[1])
    longer = {name: log.assign(seconds=1.2 * log["seconds"]) for name, log in results.logs["DDF"].items()}
    text = experiment_page.budget(dataclasses.replace(results, logs={**results.logs, "DDF": longer}))
    assert "did not train for the same wall time" in text
    assert "DDF 12.0 min, PC-SIREN 10.0 min, the longer 20 % above the shorter" in text
    further = {"DDF": [654.0, 3000.0], "PC-SIREN": [600.0, 60.0]}  # beside 600 s of the first
    text = experiment_page.budget(dataclasses.replace(results, seeds=3, further_seconds=further))
    assert "within 9 %, summed over categories: DDF 10.9 min, PC-SIREN 10.0 min. Medians over the 3 seeds." in text
    text = (reported[2] / "README.md").read_text()
    assert experiment_page.budget(results) in text and "the same wall time within 0 %" in text


def test_shapes_are_means_over_their_images(reported):
    results = stage_results.read_results(reported[1])
    images, shapes = (charts.pairs(results, by)["plane"] for by in (["id", "view"], ["id"]))
    assert len(images[0]) == 4 and len(shapes[0]) == 2
    for one, other in zip(images, shapes, strict=True):
        assert one.reshape(2, 2).mean(axis=1) == pytest.approx(other)


def test_errors_over_azimuth_belong_to_their_images(reported):
    experiment, config_path, _ = reported
    results = stage_results.read_results(config_path)
    ddf = scoring.load_predictions(experiment.artifacts / "pointclouds" / "plane" / "ddf.safetensors")
    (_, chamfer), (_, errors) = charts.over_azimuth(results)
    angles, values = chamfer["plane"][0][3]
    assert angles == pytest.approx(np.degrees(ddf.tensors["camera_true"][:, 0]), rel=1e-5)
    rows = results.per_image.set_index(["category", "method", "column"]).loc[("plane", "ddf", "Pi_g-L")]
    assert values == pytest.approx(1000 * rows["chamfer_l2_sq"].to_numpy())
    assert [curve[:3] for curve in chamfer["plane"]] == [("DDF", "ddf", False), ("PC-SIREN", "pc_siren", False)]
    assert [curve[3][1].mean() for curve in errors["plane"]] == pytest.approx(np.degrees([0.1, 0.05, 0.2]), rel=1e-4)


def test_failures_losses_and_limits_are_named(reported):
    text = (reported[2] / "README.md").read_text()
    assert "3 shapes were left out" in text and "`plane99` (meshes): no triangles left" in text
    assert "0.20 / 0.20" in text and "6 of 6" in text
    assert "do not reproduce the paper's ShapeNet numbers" in text
    assert "| encoder width (64 is ResNet-18) | " in text
    assert f"{SIZES['L']} and {SIZES['S']} predicted points" in text
    assert "not timed" in text  # the fake has no times of its stages


def test_second_writing_gives_the_same_bytes(reported):
    _, config_path, folder = reported
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    experiment_page.write(config_path, folder.parent / "again", experiment_page.ReportConfig(examples=3))
    assert {path.name: path.read_bytes() for path in (folder.parent / "again").iterdir()} == before


@pytest.fixture(scope="module")
def seeded(reported):
    """The report with two seeds, in a folder of its own; clouds of the second are those of the first, 1 % larger."""
    experiment, config_path, folder = reported
    further = experiment.artifacts / "pointclouds_seeds" / "1"
    for category in experiment.categories:
        for model in ("ddf", "pcsiren"):
            name = f"{category}/{model}.safetensors"
            tensors, metadata = storage.load_tensors(experiment.artifacts / "pointclouds" / name)
            clouds = {key: 1.01 * value for key, value in tensors.items() if key[0] in "LS"}
            storage.save_tensors(further / name, tensors | clouds, metadata)
    for model in stage_results.MODELS:
        shutil.copytree(experiment.artifacts / model, experiment.artifacts / f"{model}_seeds" / "1")
    _run("evaluate", config_path, 1)
    count = experiment.artifacts / "evaluate_seeds" / seed_means.COUNT
    storage.write_text(count, "2\n")
    experiment_page.write(config_path, folder.parent / "seeded", experiment_page.ReportConfig(examples=3))
    count.unlink()
    return folder, folder.parent / "seeded"


def test_further_seeds_are_evaluated_without_what_no_training_changes(seeded):
    artifacts = Path("artifacts") / "fake"
    first = storage.load_table(artifacts / "evaluate" / "si3dr.csv")[0]
    second = storage.load_table(artifacts / "evaluate_seeds" / "1" / "si3dr.csv")[0]
    assert set(second["method"]) == set(seed_means.TRAINED) < set(first["method"])
    keys = ["category", "method", "column", "metric"]
    both = [table[table["method"] == baselines.RETRIEVAL].set_index(keys)["value"] for table in (first, second)]
    pd.testing.assert_series_equal(*both)  # the fake's features are those of seed 0


def test_trained_rows_of_several_seeds_are_printed_with_their_spread(seeded):
    table = pd.read_csv(seeded[1] / "si3dr.csv")
    assert tuple(table.columns) == scoring.TABLE_FIELDS
    rows = table[table["source"] == scoring.MEASURED].set_index(["category", "method", "column", "metric"])
    trained = rows.index.get_level_values("method").isin(seed_means.TRAINED)
    assert (rows["seeds"] == trained + 1).all() and rows[trained]["spread"].notna().all()
    text = (seeded[1] / "README.md").read_text()
    tables = _markdown_tables(text)
    row = rows.loc[("chair", "ddf", "Pi_g-L", "chamfer_l2_sq_x1000")]
    assert tables[0][2][3] == f"{row['value']:.3f} ± {row['spread']:.3f}" and row["spread"] > 0
    assert all("±" in cell for line in tables[0][2:] for cell in line[3:12])
    assert not any("±" in cell for line in tables[0][2:] for cell in line[12:])  # the paper's
    by_name = {line[1]: line[3:] for line in tables[1][2:]}
    assert all("±" in cell for cell in by_name["retrieval (nearest training image)"])
    assert not any("±" in cell for cell in by_name["mean shape"])
    cameras = next(rows for rows in tables if "azimuth" in rows[0][3])
    assert all("±" in cell for line in cameras[2:] for cell in line[3:])
    assert text.count("are means over 2 seeds") == 5 and text.count("Of the first of the 2 seeds.") == 8
    assert text.count("Medians over the 2 seeds.") == 1  # the budget
    assert text.count("Of means over 2 seeds.") == 2
    assert "2 seeds were trained" in text and "One seed was trained" not in text and "SEEDS=2`" in text


def test_pictures_and_paired_charts_are_of_the_first_seed(seeded):
    first, both = seeded
    names = {path.name for path in first.iterdir()}
    assert {path.name for path in both.iterdir()} == names
    same = {name for name in names if (first / name).read_bytes() == (both / name).read_bytes()}
    assert same == names - {"README.md", "index.html", "si3dr.csv", "baselines.svg"}


def test_times_are_summed_over_categories_and_memory_is_the_largest(reported, tmp_path):
    _, config_path, _ = reported
    folder = Path("artifacts") / "fake" / "times"
    for name, seconds in (("train_ddf-chair", 100), ("train_ddf-plane", 20), ("train_ddf-primitives", 3)):
        memory = {"peak_mib": 1000.0 + seconds, "worker_peak_mib": 0.0}
        storage.write_json(folder / f"{name}.json", {"seconds": seconds, **memory})
    storage.write_json(folder / "train_pcsiren-chair.json", {"seconds": 5, "peak_mib": 900.0, "worker_peak_mib": 0.0})
    noted = {"seconds": 7.0, "peak_mib": 300.0, "worker_peak_mib": 400.0}
    storage.write_json(folder / "dataset.json", noted)
    storage.write_json(folder / "evaluate.json", {"seconds": 9.0})  # of a version that noted no memory
    costs = stage_results.read_results(config_path).costs
    assert costs["train_ddf"] == stage_results.Cost(123.0, 1100.0, None)  # the sum, the largest, no workers
    assert costs["train_pcsiren"] == stage_results.Cost(None, None, None)
    assert costs["dataset"] == stage_results.Cost(7.0, 300.0, 400.0)
    assert costs["evaluate"] == stage_results.Cost(9.0, None, None)
    experiment_page.write(config_path, tmp_path, experiment_page.ReportConfig(examples=3))
    lines = (tmp_path / "README.md").read_text().splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert ["dataset", "7 s", "300", "400"] in rows and ["train_ddf", "2.0 min", "1,100", "–"] in rows
    assert [experiment_page.duration(s) for s in (0.4, 89.0, 123.0, 7200.0)] == ["0 s", "89 s", "2.0 min", "2.0 h"]
    for path in folder.glob("*.json"):
        path.unlink()


def test_examples_run_from_best_to_worst():
    scores = pd.DataFrame({"method": "ddf", "column": "Pi_g-L", "id": list("abcdefg"), "view": 0})
    scores["chamfer_l2_sq"] = [5.0, 1.0, 7.0, 3.0, 2.0, 6.0, 4.0]
    rendered = [(name, 0) for name in "abcdef"]  # g was not rendered
    chosen = example_strips.examples(scores, rendered, 3)
    assert [(name, image[0]) for name, image in chosen] == [("best", "b"), ("median", "d"), ("worst", "c")]
    assert len(example_strips.examples(scores, rendered, 50)) == 6
    assert [name for name, _ in example_strips.examples(scores, rendered, 5)][1::2] == ["25 % point", "75 % point"]


def test_damaged_and_missing_inputs_are_named(reported):
    _, config_path, _ = reported
    path = Path("artifacts/fake/evaluate/si3dr.csv")
    original = path.read_bytes()
    path.write_bytes(original.replace(b"measured", b"measurec", 1))
    with pytest.raises(checks.InputError, match=r"si3dr\.csv is damaged"):
        stage_results.read_results(config_path)
    path.write_bytes(original)
    log = Path("artifacts/fake/train_pcsiren/plane/log.csv")
    moved = log.rename(log.with_suffix(".moved"))
    with pytest.raises(FileNotFoundError, match=r"plane.log\.csv does not exist"):
        stage_results.read_results(config_path)
    moved.rename(log)


@pytest.mark.parametrize("name", ["smoke", "cpu", "paper"])
def test_every_experiment_file_has_the_settings_that_the_report_prints(name):
    path = _ROOT / "configs" / f"{name}.yaml"
    settings = config.read(path)
    empty = pd.DataFrame()
    results = stage_results.Results(name, {}, empty, empty, empty, empty, {}, {}, {}, empty, {}, settings)
    printed = [results.setting(key) for _, key, _ in experiment_page.SETTINGS]
    if name == "cpu":
        assert results.setting("ddf.proposals").startswith("points 160, directions 2, near 0.5")
    if name == "paper":
        wanted = [value for _, _, value in experiment_page.SETTINGS]
        assert all(have in (want, "all") for have, want in zip(printed, wanted, strict=True))
    with pytest.raises(checks.InputError, match=r"no key 'train\.nothing'"):
        results.setting("train.nothing")
    config.load(path, "report", experiment_page.ReportConfig)
    config.load(path, "evaluate", scoring.EvaluateConfig)


@pytest.mark.parametrize("examples", [1, 21])
def test_report_settings_out_of_range_are_refused(examples):
    with pytest.raises(checks.InputError, match=r"report\.examples"):
        experiment_page.ReportConfig(examples)
