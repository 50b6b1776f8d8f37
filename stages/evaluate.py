"""Stage `evaluate`: scores of all predicted clouds and of the baselines, per image and as the table of means."""

from pathlib import Path

import pandas as pd

from ddf.core import config, provenance, storage
from ddf_lab.engine import stage
from ddf_lab.evaluation import category_scores, scoring


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
        for name, table in zip(names, category_scores.evaluate(folders, entry["shapes"], settings, seed), strict=True):
            table.insert(0, "category", category)
            tables[name].append(table)
        sources += [folders["pointclouds"] / f"{model}.safetensors" for model in ("ddf", "pcsiren")]
    whole = {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}
    whole["si3dr"] = scoring.summary(whole["per_image"], whole["cameras"], whole["shapes"])
    record = provenance.record(provenance.fingerprint(settings, sources, category_scores), settings.seed, sources)
    out_dir = config.artifact_dir(config_path, "evaluate", seed=seed)
    for name, table in whole.items():
        storage.save_table(out_dir / f"{name}.csv", table, record)


if __name__ == "__main__":
    stage.main(run, __doc__, seed=True)
