"""Stage `evaluate`: scores of all predicted clouds and of the baselines, per image and as the table of means."""

import pandas as pd

from ddf.core import provenance, storage
from ddf_lab.engine import stage
from ddf_lab.evaluation import category_scores, groups, scoring
from ddf_lab.run import Run


@stage.main(seed=True)
def make(run: Run) -> None:
    """Evaluate every category of the data set; writes si3dr, per_image, cameras and shapes as CSV, by group."""
    settings = run.section(scoring.EvaluateConfig)
    names = ("per_image", "cameras", "shapes")
    tables: dict[str, list[pd.DataFrame]] = {name: [] for name in names}
    sources, index = [run.index], storage.read_json(run.index)
    for category, entry in index["categories"].items():
        folders = {
            "samples": run.folder("samples", category),
            "pointclouds": run.folder("pointclouds", category, run.seed),
        }
        found = category_scores.evaluate(folders, entry["shapes"], settings, run.seed)
        for name, table in zip(names, found, strict=True):
            table.insert(0, "category", table["id"].map(groups.of_shapes(index, category)))
            tables[name].append(table)
        sources += [folders["pointclouds"] / f"{model}.safetensors" for model in scoring.FILES.values()]
    whole = {name: pd.concat(parts, ignore_index=True) for name, parts in tables.items()}
    whole["si3dr"] = scoring.summary(whole["per_image"], whole["cameras"], whole["shapes"])
    record = provenance.record(settings, settings.seed, sources, category_scores)
    out_dir = run.folder("evaluate", seed=run.seed)
    for name, table in whole.items():
        storage.save_table(out_dir / f"{name}.csv", table, record)
