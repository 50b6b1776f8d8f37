"""All scores of one category: of all models and of the baselines, per image, and facts of its shapes."""

from pathlib import Path
from typing import Any

import pandas as pd

from ddf.geometry import neighbours
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, scoring

FACTS = ("id", "points", "hidden_share", "spacing_variation", "oracle_id")


def evaluate(
    folders: dict[str, Path], shapes: list[dict[str, Any]], settings: scoring.EvaluateConfig, seed: int
) -> list[pd.DataFrame]:
    """Scores per image, camera errors per image and facts per test shape of one category.

    What no training changes is found for seed 0 alone: further seeds have no other baseline than retrieval, no facts.
    """
    models = {
        method: scoring.load_predictions(folders["pointclouds"] / f"{file}.safetensors")
        for method, file in scoring.FILES.items()
    }
    ddf = models[scoring.DDF]
    truths = scoring.load_truth(folders["samples"])
    train_ids = [shape["id"] for shape in shapes if shape["train_views"]]
    validation_ids = [shape["id"] for shape in shapes if shape.get("validation_views")]
    tests = {shape: [ddf.images[row] for row in rows] for shape, rows in scoring.views_by_shape(ddf.images).items()}
    sizes = scoring.cloud_sizes(models[scoring.PC_SIREN])
    if seed:
        retrieved = baselines.retrieval_choice(ddf, truths)
        rows, oracle = baselines.Retrieval(truths, sizes, settings.seed, retrieved), {}
    else:
        rows = baselines.prepare(ddf, truths, train_ids, validation_ids, sizes, settings)
        oracle = rows.oracle
    cases = (
        (truths[shape], scoring.model_cases(models, shape) + rows.cases(shape, images))
        for shape, images in tests.items()
    )
    scores = scoring.score_all(cases)
    errors = [scoring.camera_errors(method, found) for method, found in models.items()]
    facts = [
        {
            "id": shape,
            "points": len(truths[shape].points),
            "hidden_share": float(truths[shape].hidden.mean()),
            "spacing_variation": cloud_scores.spacing_variation(neighbours.Neighbours(truths[shape].points)),
            "oracle_id": chosen,
        }
        for shape, chosen in oracle.items()
    ]
    return [scores, pd.concat(errors, ignore_index=True), pd.DataFrame(facts, columns=list(FACTS))]
