"""Stage `evaluate`: scores of all predicted clouds and of the baselines, per image and as the table of means."""

from pathlib import Path

import pandas as pd

from ddf import baselines, config, evaluation, provenance, stage, storage


def evaluate_category(
    folders: dict[str, Path], shapes: list[dict], settings: evaluation.EvaluateConfig
) -> list[pd.DataFrame]:
    """Scores per image, camera errors per image and facts per test shape of one category."""
    ddf = evaluation.load_predictions(folders["pointclouds"] / "ddf.safetensors")
    pc_siren = evaluation.load_predictions(folders["pointclouds"] / "pcsiren.safetensors")
    truths = evaluation.load_truth(folders["samples"])
    train_ids = [shape["id"] for shape in shapes if shape["train_views"]]
    rows = baselines.prepare(ddf, truths, train_ids, evaluation.cloud_sizes(pc_siren), settings)
    tests = evaluation.views_by_shape(ddf.images)
    cases = (
        (
            truths[shape],
            evaluation.model_cases(ddf, pc_siren, shape) + rows.cases(shape, [ddf.images[view] for view in views]),
        )
        for shape, views in tests.items()
    )
    scores = evaluation.score_all(cases, settings.tau_sq)
    errors = [
        evaluation.camera_errors(evaluation.DDF, ddf),
        evaluation.camera_errors(evaluation.PC_SIREN, pc_siren),
    ]
    facts = [
        {
            "id": shape,
            "points": len(truths[shape].points),
            "hidden_share": float(truths[shape].hidden.mean()),
            "oracle_id": rows.oracle[shape],
        }
        for shape in tests
    ]
    return [scores, pd.concat(errors, ignore_index=True), pd.DataFrame(facts)]


def run(config_path: Path) -> None:
    """Evaluate every category of the data set; writes si3dr, per_image, cameras and shapes as CSV."""
    settings = config.load(config_path, "evaluate", evaluation.EvaluateConfig)
    index_path = config.artifact_dir(config_path, "dataset") / "index.json"
    names = ("per_image", "cameras", "shapes")
    tables: dict[str, list[pd.DataFrame]] = {name: [] for name in names}
    sources = [index_path]
    for category, entry in storage.read_json(index_path)["categories"].items():
        folders = {name: config.artifact_dir(config_path, name, category) for name in ("samples", "pointclouds")}
        for name, table in zip(names, evaluate_category(folders, entry["shapes"], settings), strict=True):
            table.insert(0, "category", category)
            tables[name].append(table)
        sources += [folders["pointclouds"] / f"{model}.safetensors" for model in ("ddf", "pcsiren")]
    whole = {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}
    whole["si3dr"] = evaluation.summary(whole["per_image"], whole["cameras"], whole["shapes"])
    record = provenance.record(provenance.fingerprint(settings, sources, baselines), settings.seed, sources)
    out_dir = config.artifact_dir(config_path, "evaluate")
    for name, table in whole.items():
        storage.save_table(out_dir / f"{name}.csv", table, record)


if __name__ == "__main__":
    stage.main(run, __doc__)
