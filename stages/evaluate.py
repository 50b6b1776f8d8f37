"""Stage `evaluate`: scores of all predicted clouds and of the baselines, per image and as the table of means."""

from pathlib import Path

import pandas as pd

from ddf.core import config, provenance, storage
from ddf.evaluation import baselines, metrics, scoring
from ddf.geometry import neighbours
from ddf.pipeline import stage

FACTS = ("id", "points", "hidden_share", "spacing_variation", "oracle_id")


def evaluate_category(
    folders: dict[str, Path], shapes: list[dict], settings: scoring.EvaluateConfig, seed: int
) -> list[pd.DataFrame]:
    """Scores per image, camera errors per image and facts per test shape of one category.

    What no training changes is found for seed 0 alone: further seeds have no other baseline than retrieval, no facts.
    """
    ddf = scoring.load_predictions(folders["pointclouds"] / "ddf.safetensors")
    pc_siren = scoring.load_predictions(folders["pointclouds"] / "pcsiren.safetensors")
    truths = scoring.load_truth(folders["samples"])
    train_ids = [shape["id"] for shape in shapes if shape["train_views"]]
    tests = {shape: [ddf.images[row] for row in rows] for shape, rows in scoring.views_by_shape(ddf.images).items()}
    sizes = scoring.cloud_sizes(pc_siren)
    if seed:
        rows, oracle = baselines.prepare_retrieval(ddf, truths, sizes, settings), {}
    else:
        rows = baselines.prepare(ddf, truths, train_ids, sizes, settings)
        oracle = rows.oracle
    cases = (
        (truths[shape], scoring.model_cases(ddf, pc_siren, shape) + rows.cases(shape, images))
        for shape, images in tests.items()
    )
    scores = scoring.score_all(cases, settings.tau_sq)
    errors = [
        scoring.camera_errors(scoring.DDF, ddf),
        scoring.camera_errors(scoring.PC_SIREN, pc_siren),
    ]
    facts = [
        {
            "id": shape,
            "points": len(truths[shape].points),
            "hidden_share": float(truths[shape].hidden.mean()),
            "spacing_variation": metrics.spacing_variation(neighbours.Neighbours(truths[shape].points)),
            "oracle_id": chosen,
        }
        for shape, chosen in oracle.items()
    ]
    return [scores, pd.concat(errors, ignore_index=True), pd.DataFrame(facts, columns=list(FACTS))]


def run(config_path: Path, seed: int = 0) -> None:
    """Evaluate every category of the data set; writes si3dr, per_image, cameras and shapes as CSV."""
    settings = config.load(config_path, scoring.EvaluateConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    names = ("per_image", "cameras", "shapes")
    tables: dict[str, list[pd.DataFrame]] = {name: [] for name in names}
    sources = [index_path]
    for category, entry in storage.read_json(index_path)["categories"].items():
        folders = {
            "samples": config.artifact_dir(config_path, "samples", category),
            "pointclouds": config.artifact_dir(config_path, "pointclouds", category, seed),
        }
        for name, table in zip(names, evaluate_category(folders, entry["shapes"], settings, seed), strict=True):
            table.insert(0, "category", category)
            tables[name].append(table)
        sources += [folders["pointclouds"] / f"{model}.safetensors" for model in ("ddf", "pcsiren")]
    whole = {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}
    whole["si3dr"] = scoring.summary(whole["per_image"], whole["cameras"], whole["shapes"])
    record = provenance.record(provenance.fingerprint(settings, sources, baselines), settings.seed, sources)
    out_dir = config.artifact_dir(config_path, "evaluate", seed=seed)
    for name, table in whole.items():
        storage.save_table(out_dir / f"{name}.csv", table, record)


if __name__ == "__main__":
    stage.main(run, __doc__, seed=True)
