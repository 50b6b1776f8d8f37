"""Stage `evaluate`: scores of all predicted clouds and of the baselines, per image and as the table of means."""

from typing import Any

import pandas as pd

from ddf.core import provenance, storage
from ddf.geometry import neighbours
from ddf.metrics import cloud_scores
from ddf_lab.engine import stage
from ddf_lab.evaluation import baselines, groups, scoring
from ddf_lab.run import Run

FACTS = ("id", "points", "hidden_share", "spacing_variation", "oracle_id")


def category_tables(
    models: dict[str, scoring.Predictions],
    truths: baselines.Truths,
    shapes: list[dict[str, Any]],
    settings: scoring.EvaluateConfig,
    seed: int,
) -> list[pd.DataFrame]:
    """Scores per image, camera errors per image and facts per test shape of one category.

    What no training changes is found for seed 0 alone: further seeds have no other baseline than retrieval, no facts.
    """
    ddf, sizes = models[scoring.DDF], scoring.cloud_sizes(models[scoring.PC_SIREN])
    if seed:
        retrieved = baselines.retrieval_choice(ddf, truths)
        rows = baselines.Baselines(truths, sizes, settings.seed, retrieved)
    else:
        train_ids = [shape["id"] for shape in shapes if shape["train_views"]]
        validation_ids = [shape["id"] for shape in shapes if shape.get("validation_views")]
        rows = baselines.prepare(ddf, truths, train_ids, validation_ids, sizes, settings)
    tests = {shape: [ddf.images[row] for row in own] for shape, own in scoring.views_by_shape(ddf.images).items()}
    scores = scoring.score_all(
        (truths[shape], scoring.model_cases(models, shape) + rows.cases(shape, images))
        for shape, images in tests.items()
    )
    errors = [scoring.camera_errors(method, found) for method, found in models.items()]
    facts = [
        {
            "id": shape,
            "points": len(truths[shape].points),
            "hidden_share": float(truths[shape].hidden.mean()),
            "spacing_variation": cloud_scores.spacing_variation(neighbours.Neighbours(truths[shape].points)),
            "oracle_id": chosen,
        }
        for shape, chosen in rows.oracle.items()
    ]
    return [scores, pd.concat(errors, ignore_index=True), pd.DataFrame(facts, columns=list(FACTS))]


@stage.main(seed=True)
def make(run: Run) -> None:
    """Evaluate every category of the data set; writes si3dr, per_image, cameras and shapes as CSV, by group."""
    settings = run.section(scoring.EvaluateConfig)
    names = ("per_image", "cameras", "shapes")
    tables: dict[str, list[pd.DataFrame]] = {name: [] for name in names}
    sources, index = [run.index], storage.read_json(run.index)
    for category, entry in index["categories"].items():
        clouds = run.folder("pointclouds", category, run.seed)
        files = {method: clouds / f"{file}.safetensors" for method, file in scoring.FILES.items()}
        models = {method: scoring.load_predictions(file) for method, file in files.items()}
        truths = scoring.load_truth(run.folder("samples", category))
        found = category_tables(models, truths, entry["shapes"], settings, run.seed)
        for name, table in zip(names, found, strict=True):
            table.insert(0, "category", table["id"].map(groups.of_shapes(index, category)))
            tables[name].append(table)
        sources += files.values()
    whole = {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}
    whole["si3dr"] = scoring.summary(whole["per_image"], whole["cameras"], whole["shapes"])
    record = provenance.record(settings, settings.seed, sources, baselines)
    out_dir = run.folder("evaluate", seed=run.seed)
    for name, table in whole.items():
        storage.save_table(out_dir / f"{name}.csv", table, record)
