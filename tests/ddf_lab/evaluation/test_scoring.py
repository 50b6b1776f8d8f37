"""The evaluation's frames, rows and means, on predictions whose scores are known."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from _fake_experiment import NUM_TRUTH, SIZES, FakeExperiment, nearest_train_image

from ddf.core import checks
from ddf.data import packing
from ddf.geometry import cameras, neighbours, transforms
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, paper_results, scoring

NONE = pd.DataFrame(columns=["category", "method", "column"])
SETTINGS = scoring.EvaluateConfig(oracle_points=100, oracle_shortlist=3, seed=5)


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    return FakeExperiment(tmp_path_factory.mktemp("experiment"))


def _load(experiment, category="chair"):
    models = _models(experiment, category)
    return models["ddf"], models["pc_siren"], scoring.load_truth(experiment.artifacts / "samples" / category)


def _models(experiment, category="chair"):
    folder = experiment.artifacts / "pointclouds" / category
    return {method: scoring.load_predictions(folder / f"{file}.safetensors") for method, file in scoring.FILES.items()}


def _brute(prediction, truth):
    dist_sq = ((prediction[:, None] - truth[None]) ** 2).sum(-1)
    return dist_sq.min(0).mean() + dist_sq.min(1).mean()


def _means(scores=NONE, cameras=NONE, shapes=NONE):
    return scoring.summary(scores, cameras, shapes).set_index("metric")


def test_predicted_camera_columns_equal_a_comparison_in_camera_frames(experiment):
    ddf, _, truths = _load(experiment)
    unit = transforms.BENCHMARK_FROM_V1
    for column, camera_name in (("Pi_pred", "camera_pred"), ("Pi_corrected", "camera_corrected")):
        row = 3
        shape = ddf.images[row][0]
        tensors = {name: value[row].astype(np.float64) for name, value in ddf.tensors.items() if value.shape[0] == 6}
        rotation, centre = cameras.extrinsics(*tensors[camera_name])
        prediction = (unit * tensors["scale_pred"] * tensors["L.h3"] - centre) @ rotation.T
        rotation, centre = cameras.extrinsics(*tensors["camera_true"])
        truth = (unit * truths[shape].points.astype(np.float64) - centre) @ rotation.T
        placed = ddf.cloud("L.h3", row, column)
        got = cloud_scores.compare_clouds(placed, truths[shape].benchmark_points()).chamfer_l2_sq
        assert got == pytest.approx(_brute(prediction, truth), rel=1e-9)


def test_all_columns_of_the_paper_are_there(experiment):
    found = [(method, column) for method, column, *_ in scoring.columns(*_models(experiment).values())]
    expected = [head for head in paper_results.SI3DR_COLUMNS if head[0] in ("ddf", "pc_siren")]
    ours = [("ddf_image", f"{camera}-{size}") for camera in scoring.CAMERA_COLUMNS for size in "LS"]
    assert found == [*expected[:2], ("ddf", "Pi_corrected-L"), *expected[2:], *ours, *paper_results.SI3DR1H_COLUMNS]


def test_scores_do_not_depend_on_the_number_of_processes(experiment):
    ddf, _, truths = _load(experiment)
    models, shapes = _models(experiment), list(scoring.views_by_shape(ddf.images))
    tables = [scoring.score_all(((truths[s], scoring.model_cases(models, s)) for s in shapes), jobs) for jobs in (1, 2)]
    pd.testing.assert_frame_equal(*tables, check_exact=True)
    counts = tables[0].groupby(["method", "column"]).size()
    assert [counts.pop((f"{method}_3views", "Pi_g-L")) for method in models] == [2, 2, 2]  # shapes
    assert (counts == len(ddf.images)).all() and len(counts) == 20


def test_mean_over_images_and_standard_error():
    scores = {name: [0.1, 0.3, 0.2] for name in (metric.score for metric in cloud_scores.METRICS.values())}
    table = pd.DataFrame({"category": "chair", "method": "ddf", "column": "Pi_g-L", **scores})
    means = _means(table)
    assert means.loc["chamfer_l2_sq_x1000", "value"] == pytest.approx(200.0)
    assert means.loc["f_score_2tau_x100", "value"] == pytest.approx(20.0)
    assert means.loc["f_score_2tau_x100", "spread"] == pytest.approx(10 / np.sqrt(3))
    assert (means["images"] == 3).all() and (means["source"] == "measured").all()
    assert tuple(_means(table).reset_index().columns) == ("metric", *(f for f in scoring.TABLE_FIELDS if f != "metric"))


def test_share_of_cameras_turned_round_and_mean_overlap():
    errors = {"azimuth_error_deg": [1.0, 90.0, 90.1, 180.0], "elevation_error_deg": 0.0, "radius_error": 0.0}
    camera_table = pd.DataFrame(
        {"category": "chair", "method": "ddf", "column": "Pi_pred", **errors, "scale_error_percent": 0.0}
        | {"silhouette_iou": [0.5, 1.0, 0.0, 0.5]}
    )
    means = _means(cameras=camera_table)
    assert means.loc["azimuth_turned_x100", "value"] == 50.0 and means.loc["azimuth_turned_x100", "images"] == 4
    assert means.loc["azimuth_error_deg_median", "value"] == pytest.approx(90.05)
    assert means.loc["silhouette_iou", "value"] == 0.5
    assert "silhouette_iou" not in _means(cameras=camera_table.assign(silhouette_iou=np.nan)).index


def test_camera_errors_in_closed_form(experiment):
    ddf, pc_siren, _ = _load(experiment)
    errors = scoring.camera_errors("ddf", ddf).set_index("column")
    assert np.allclose(errors.loc["Pi_pred", "azimuth_error_deg"], np.degrees(0.1), rtol=1e-4)
    assert np.allclose(errors.loc["Pi_corrected", "elevation_error_deg"], np.degrees(0.01), rtol=1e-4)
    assert np.allclose(errors["scale_error_percent"], 1.0, rtol=1e-4)
    azimuth = errors.loc["Pi_pred", "azimuth_deg"].to_numpy()
    assert np.allclose(azimuth, np.degrees(ddf.tensors["camera_true"][:, 0]), rtol=1e-6) and np.ptp(azimuth) > 90
    only = scoring.camera_errors("pc_siren", pc_siren)
    assert set(only["column"]) == {"Pi_pred"} and np.allclose(only["radius_error"], 0.02, rtol=1e-4)


def test_evenness_is_of_each_cloud_and_of_the_truth(experiment):
    ddf, _, truths = _load(experiment)
    shape = ddf.images[0][0]
    lattice = np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
    cloud = truths[shape].benchmark_points()
    cases = [scoring.Case("ddf", column, [(shape, 0)], points) for column, points in (("a", lattice), ("b", cloud))]
    table = scoring.score_all([(truths[shape], cases)], jobs=1).set_index("column")["spacing_variation"]
    assert table["a"] == pytest.approx(0.0, abs=1e-12) and table["b"] > 0.4
    shapes = pd.DataFrame({"category": "chair", "hidden_share": [0.1, 0.3], "spacing_variation": [0.2, 0.4]})
    means = _means(shapes=shapes)
    assert set(zip(means["method"], means["column"], strict=True)) == {scoring.TRUTH}
    assert means["value"].to_dict() == pytest.approx({"hidden_share_percent": 20.0, "spacing_variation": 0.3})


def _predicted(tensors):
    return scoring.Predictions(Path("x"), [("a", 0)], {name: np.array([value]) for name, value in tensors.items()}, {})


def test_a_shape_off_the_origin_is_placed_where_it_lies():
    """x_v1 = scale x + centre, then 0.57 of it."""
    points = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.5]])
    found = _predicted({"L": points, "scale_true": 0.25, "centre_true": np.array([0.1, -0.2, 0.3])})
    expected = 0.57 * (0.25 * points + np.array([0.1, -0.2, 0.3]))
    assert np.allclose(found.cloud("L", 0, "Pi_g"), expected, rtol=0, atol=1e-15)


def test_a_cloud_is_scaled_as_it_tells_itself():
    """After one cycle, or on the mask, a cloud has a scale of its own; the others have `scale_pred`."""
    camera, points = np.array([0.3, 0.4, 0.8]), np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.5]])
    found = _predicted(
        {name: points for name in ("L", "L.h1", "L.h3", "L.mask")}
        | {"camera_pred": camera, "camera_true": camera, "scale_pred": 0.5}
        | {"scale_pred.h1": 0.25, "scale_pred.mask": 0.75}
    )
    for name, scale in (("L", 0.5), ("L.h3", 0.5), ("L.h1", 0.25), ("L.mask", 0.75)):
        assert np.allclose(found.cloud(name, 0, "Pi_pred"), 0.57 * scale * points, rtol=0, atol=1e-12), name


def test_baselines_choose_as_brute_force_does(experiment):
    ddf, _, truths = _load(experiment)
    train = experiment.categories["chair"]["train"]
    rows = baselines.prepare(ddf, truths, train, [], SIZES, SETTINGS, jobs=1)
    train_images = ddf.metadata["train_images"]
    for row, image in enumerate(ddf.images):
        assert rows.retrieved[image] == train_images[nearest_train_image(row) % len(train_images)]["id"]
    axes = experiment.categories["chair"]["axes"]
    for shape in experiment.categories["chair"]["test"]:
        gaps = {name: np.abs(axes[name] - axes[shape]).max() for name in train}
        assert gaps[rows.oracle[shape]] == min(gaps.values())


def test_the_mean_shape_is_what_is_nearest_to_the_validation_shapes(experiment):
    """Points of all training clouds together, unless one training shape alone is nearer. No test shape is read."""
    _, _, truths = _load(experiment)
    train, held = experiment.categories["chair"]["train"], experiment.categories["chair"]["train"][:1]
    together = baselines.mean_shape(truths, train, [], SIZES, SETTINGS)
    assert {letter: len(cloud) for letter, cloud in together.items()} == SIZES
    found = baselines.mean_shape(truths, train, held, SIZES, SETTINGS)
    points = truths[held[0]].benchmark_points()
    own = {letter: baselines.subset(points, count, SETTINGS.seed, held[0]) for letter, count in SIZES.items()}
    assert all(np.array_equal(found[letter], own[letter]) for letter in SIZES)  # nothing is nearer to it than itself
    spread = {f"s{i}": truths[name] for i, name in enumerate(train)}
    ids, whole = list(spread), np.concatenate([truths[name].points for name in train])
    spread["all"] = packing.Cloud(whole, np.zeros(len(train) * NUM_TRUTH, dtype=bool))
    again = baselines.mean_shape(spread, ids, ["all"], SIZES, SETTINGS)
    expected = baselines.mean_shape(spread, ids, [], SIZES, SETTINGS)
    assert all(np.array_equal(again[letter], expected[letter]) for letter in SIZES)


def test_oracle_with_a_full_shortlist_attains_the_smallest_distance(experiment):
    _, _, truths = _load(experiment)
    train, test = experiment.categories["chair"]["train"], experiment.categories["chair"]["test"]
    everything = scoring.EvaluateConfig(oracle_points=20, oracle_shortlist=len(train), seed=5)
    choice = baselines.oracle_choice(test, train, truths, SIZES["L"], everything, jobs=1)
    drawn = {name: baselines.subset(truths[name].benchmark_points(), SIZES["L"], 5, name) for name in train}
    for shape in test:
        truth = truths[shape].benchmark_points()
        scores = {name: _brute(cloud, truth) for name, cloud in drawn.items()}
        assert choice[shape] == min(scores, key=lambda name: scores[name])


@pytest.mark.parametrize("length", [1, 3, 12])
def test_the_shortlist_is_that_of_all_distances_and_asks_for_fewer(length, monkeypatch):
    rng = np.random.default_rng(0)
    clouds = {f"s{i}": rng.normal(size=(50, 3)) * (1 + 0.2 * (i % 6)) for i in range(12)}  # two of every size
    clouds["s7"] = clouds["s1"]  # equal ones come by name
    truths = [rng.normal(size=(40, 3)) for _ in range(3)]
    asked = []
    dist_sq = neighbours.Neighbours.dist_sq
    monkeypatch.setattr(neighbours.Neighbours, "dist_sq", lambda *given: asked.append(1) or dist_sq(*given))
    found = baselines._shortlist(truths, clouds, length)
    for truth, names in zip(truths, found, strict=True):
        scores = {name: _brute(cloud, truth) for name, cloud in clouds.items()}
        assert names == sorted(scores, key=lambda name: (scores[name], name))[:length]
    both_ways = 2 * len(truths) * len(clouds)
    assert len(asked) == both_ways if length == len(clouds) else len(asked) < both_ways


def test_order_of_rows_ceiling_above_oracle_above_mean(experiment):
    ddf, _, truths = _load(experiment)
    rows = baselines.prepare(ddf, truths, experiment.categories["chair"]["train"], [], SIZES, SETTINGS, jobs=1)
    views = scoring.views_by_shape(ddf.images)
    cases = ((truths[s], rows.cases(s, [ddf.images[v] for v in views[s]])) for s in views)
    table = scoring.score_all(cases, jobs=1)
    mean = table.groupby(["method", "column"])["chamfer_l2_sq"].mean()
    assert mean["ceiling", "Pi_g-L"] < mean["oracle_retrieval", "Pi_g-L"] <= mean["retrieval", "Pi_g-L"]
    assert mean["oracle_retrieval", "Pi_g-L"] < mean["mean_shape", "Pi_g-L"]
    assert (table.groupby(["method", "column"]).size() == len(ddf.images)).all()


def test_ceiling_prediction_is_a_subset_of_the_truth():
    points = np.random.default_rng(0).normal(size=(500, 3))
    chosen = baselines.subset(points, 200, 1, "x")
    scores = cloud_scores.compare_clouds(chosen, points)
    assert scores.precision_tau == 1.0 and len(np.unique(chosen, axis=0)) == 200
    assert (baselines.subset(points, 200, 1, "x") == baselines.subset(points, 200, 1, "x")).all()
    assert (baselines.subset(points, 200, 1, "x") != baselines.subset(points, 200, 1, "y")).any()
    with pytest.raises(checks.InputError, match="only 500"):
        baselines.subset(points, 501, 1, "x")


def test_paper_numbers_are_the_printed_ones():
    table = paper_results.long_table(["chair", "plane", "car"])
    assert len(table) == 3 * 3 * (11 + 4) and set(table["source"]) == {"paper, ShapeNet"}
    value = table.set_index(["category", "method", "column", "metric"])["value"]
    assert value["car", "ddf", "Pi_corrected-S", "f_score_2tau_x100"] == 74.68
    assert value["plane", "pc_siren", "Pi_pred-L", "f_score_tau_x100"] == 63.64
    assert value["chair", "ddf_nh1", "Pi_pred-S", "chamfer_l2_sq_x1000"] == 0.928
    assert value["chair", "3dr", "view frame", "chamfer_l2_sq_x1000"] == 1.432
    assert paper_results.long_table(["sphere"]).empty


@pytest.mark.real
def test_paper_numbers_are_found_in_the_paper(shared_dir):
    text = (shared_dir / "paper" / "ddf_cvpr2022.tex").read_text(encoding="utf-8")
    for label, numbers in (("si3dr", paper_results.SI3DR), ("si3dr1h", paper_results.SI3DR1H)):
        before = text[: text.index(rf"\label{{tab:{label}}}")].rpartition(r"\begin{tabular}")[2]
        printed = [float(n) for n in re.findall(r"\d+\.\d+", before.partition(r"\end{tabular}")[0])]
        assert printed == [n for category in ("chair", "plane", "car") for line in numbers[category] for n in line]
