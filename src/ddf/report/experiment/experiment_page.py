"""The report of an experiment: one Markdown page, one self-contained HTML page, the table as CSV, the figures.

What is listed comes from the experiment's own index and config, never from what happens to lie in a folder. Nothing
in the files depends on the day; times are those that the stages measured.
"""

import os
import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ddf.core import checks, config, storage
from ddf.evaluation import baselines, scoring
from ddf.report import figures, pages
from ddf.report.experiment import charts, diagnosis, example_strips, score_tables, stage_results, texts

# Printed name, key in the experiment file, value in the paper.
SETTINGS = (
    ("training images per shape", "train.train_views", "5"),
    ("image size of the encoders", "train.image_size", "128"),
    ("encoder width (64 is ResNet-18)", "train.encoder_width", "64"),
    ("latent size", "train.latent_features", "512"),
    ("images per step", "train.batch_size", "32"),
    ("learning rate", "train.loop.learning_rate", "0.0001"),
    ("course of the learning rate", "train.loop.schedule", "constant"),
    ("steps of warm-up", "train.loop.warmup_steps", "0"),
    ("gradients clipped to a norm of", "train.loop.clip_norm", "none"),
    ("learning rate of the matrices between hidden layers, by Muon", "train.loop.muon", "none"),
    ("learning rate of the encoders' kernels, by Muon", "train.loop.muon_kernels", "none"),
    ("azimuth of the camera", "train.azimuth", "angle"),
    ("DDF learning rate", "ddf.learning_rate", "0.0001"),
    ("DDF learning rate of the matrices between hidden layers, by Muon", "ddf.muon", "none"),
    ("learning rate of the DDF's encoders, where it is another", "ddf.encoder_learning_rate", "none"),
    ("DDF depth activation", "ddf.field.depth_activation", "relu"),
    ("DDF first frequency, ω", "ddf.field.omega_first", "1.0"),
    ("DDF first weights of directions, times those of positions", "ddf.field.direction_scale", "1.0"),
    ("plane about which the DDF takes shapes for all but symmetric, by its normal", "ddf.field.mirror", "none"),
    ("component that the depth loss is of", "ddf.weights.depth_of", "chosen"),
    ("error beyond which the depth loss is linear", "ddf.weights.depth_huber", "none"),
    ("DDF weight of the depth loss", "ddf.weights.depth", "5.0"),
    ("DDF weight of the normal loss", "ddf.weights.normals", "10.0"),
    ("DDF weight of the mask loss", "ddf.mask_weight", "10.0"),
    ("mask of that loss, pixels a side", "ddf.mask_size", "64"),
    ("pixels of it that are drawn for each image", "ddf.mask_pixels", "all"),
    (
        "oriented points of a shape in a step, by type (+: values alone)",
        "ddf.counts",
        "U 1200, A 1200, B 300, S 300, T 300, O 300, E 1000",
    ),
    ("samples of a step", "ddf.samples", "stored"),
    ("plane by whose mirror images the DDF's training set is doubled, by its normal", "ddf.mirror_shapes", "none"),
    ("rays that the field proposes while training", "ddf.proposals", "none"),
    ("DDF hidden layers", "ddf.field.hidden", "512, 512, 512, 256, 256, 256, 256"),
    ("DDF steps", "ddf.steps", "100000"),
    ("steps of a category, times those stated", "train.step_shares", "none"),
    ("PC-SIREN hidden layers", "pcsiren.hidden", "512, 512, 512, 256, 256, 256, 256"),
    ("PC-SIREN steps", "pcsiren.steps", "100000"),
    ("PC-SIREN points in the Chamfer loss", "pcsiren.points", "1024"),
    ("true points in the Chamfer loss", "pcsiren.truth_points", "1024"),
    ("the same for PC-SIREN's training set", "pcsiren.mirror_shapes", "none"),
    ("meshes made watertight", "meshes.wrap", "auto"),
    ("triangles per training mesh, at most", "meshes.faces", "10000"),
    ("U and A samples per shape", "samples.counts.U", "20000"),
    ("other samples per shape and type", "samples.counts.S", "10000"),
    ("plane about which test images are also encoded flipped, by its normal", "pointclouds.mirror", "none"),
    ("directions per point, n<sub>v</sub>", "pointclouds.cloud.num_directions", "128"),
    ("cycles, N<sub>H</sub>", "pointclouds.cloud.cycles", "3"),
    ("points of a cycle beyond those wanted, ε<sub>p</sub>", "pointclouds.cloud.oversampling", "0.1"),
    ("temperature of the directions' weights, η<sub>T</sub>", "pointclouds.cloud.temperature", "0.1"),
    ("inverse depth of these weights, ε<sub>s</sub>", "pointclouds.cloud.inverse_depth", "0.1"),
    ("a cycle starts beside the last hit by, σ", "pointclouds.cloud.jitter", "0.0"),
    ("share of the starts drawn anew among the hits", "pointclouds.cloud.resample", "0.0"),
    ("offsets at which a hit is rechecked", "pointclouds.cloud.recheck", "none"),
    ("candidates of all cycles spread by the power of their confidence", "pointclouds.cloud.spread", "none"),
    ("least confidence of these candidates", "pointclouds.cloud.least_confidence", "0.0"),
    ("power by which lonely ones are taken later", "pointclouds.cloud.crowding", "0.0"),
    ("their mirror images too, by the plane's normal", "pointclouds.cloud.mirror", "none"),
    (
        "chosen ones moved to the mean of those around, by the power of their confidence",
        "pointclouds.cloud.centre",
        "none",
    ),
    ("share of the hits outside the box that gives DDF's scale", "pointclouds.scale_quantile", "none"),
    ("shapes moved towards their silhouettes", "pointclouds.shape_correction", "none"),
    ("corrected by the mask", "pointclouds.correction.free", "azimuth, elevation, radius"),
    ("steps of this correction", "pointclouds.correction.steps", "100"),
    ("its learning rate", "pointclouds.correction.learning_rate", "0.01"),
    ("its mask, pixels a side", "pointclouds.correction.mask_size", "64"),
    ("a correction that turns the azimuth farther is refused, degrees", "pointclouds.correction_limit", "none"),
    ("points L", "pointclouds.large", "5000"),
    ("points S", "pointclouds.small", "2466"),
    ("points of the cube that PC-SIREN maps to the surface", "pointclouds.pcsiren_inputs", "random"),
    ("test images per shape", "pointclouds.test_views", "5"),
)
_SAME_PERCENT = 10.0  # wall times of training no farther apart than this are one budget
_ALL_VIEWS = "all"  # null in the file: the five views of the split


@dataclass(frozen=True)
class ReportConfig:
    """Section `report`.

    Args:
      examples: rows of every picture strip, from best to worst.
    """

    examples: int

    def __post_init__(self) -> None:
        if not 2 <= self.examples <= 20:
            raise checks.InputError(f"report.examples must be in 2..20; got {self.examples}")


def write(config_path: Path, out_dir: Path, settings: ReportConfig) -> None:
    """Read everything, draw the figures and write README.md, index.html, si3dr.csv and the figures."""
    results = stage_results.read_results(config_path)
    strips, rendered = _strips(config_path, results, settings.examples)
    page = build(results, strips, rendered)
    for name, content in page.files.items():
        storage.write_bytes(out_dir / name, content)
    storage.write_text(out_dir / "si3dr.csv", results.table.to_csv(index=False, lineterminator="\n"))
    storage.write_text(out_dir / "README.md", pages.markdown(page))
    storage.write_text(out_dir / "index.html", pages.html_page(page))


def _strips(config_path: Path, results: stage_results.Results, count: int) -> tuple[dict[str, bytes], int]:
    """Picture strips by category, and how many images they were chosen from."""
    root = Path(results.index["root"])
    drawn, rendered = {}, 0
    for name, entry in results.index["categories"].items():
        folder = config.artifact_dir(config_path, "pointclouds", name)
        ddf, pc_siren = (scoring.load_predictions(folder / f"{model}.safetensors") for model in ("ddf", "pcsiren"))
        rendered = len(ddf.metadata["rendered"])
        if rendered:
            truths = scoring.load_truth(config.artifact_dir(config_path, "samples", name))
            scores = results.per_image[results.per_image["category"] == name]
            place = (root, entry["synset"])
            drawn[name] = example_strips.strip(ddf, pc_siren, truths, place, scores, count)
    return drawn, rendered


def build(results: stage_results.Results, strips: Mapping[str, bytes], rendered: int) -> pages.Page:
    """The page from results already read.

    Args:
      strips: picture strips (WebP) by category.
      rendered: images per category that the examples were chosen from.
    """
    files = {f"strip_{name}.webp": content for name, content in strips.items()} | charts.draw(results)
    sections = [
        _results_section(results),
        _pictures_section(results, list(strips), rendered),
        _baselines_section(results),
        _one_cycle_section(results),
        _split_section(results),
        _cameras_section(results),
        _images_section(results),
        _azimuth_section(results),
        _evenness_section(results),
        _training_section(results),
        _data_section(results),
        _times_section(results),
        _limits_section(results),
    ]
    data = texts.SYNTHETIC if results.synthetic else texts.SHAPENET
    seeds = f" SEEDS={results.seeds}" if results.seeds > 1 else ""
    source = texts.fill(texts.SOURCE, name=results.name, seeds=seeds)
    lead = [texts.fill(texts.LEAD, name=results.name, data=data), source]
    return pages.Page(f"Results of the experiment {results.name}", lead, sections, files)


def _over_seeds(results: stage_results.Results, text: str) -> str:
    """A text on numbers of the long table, with what they are means over when there are several seeds."""
    return f"{text} {texts.fill(texts.SEEDS, seeds=results.seeds)}" if results.seeds > 1 else text


def _of_means(results: stage_results.Results, text: str) -> str:
    """A text on differences of numbers of the long table, with the same."""
    return f"{text} {texts.fill(texts.SEED_MEANS, seeds=results.seeds)}" if results.seeds > 1 else text


def _of_seed_zero(results: stage_results.Results, text: str) -> str:
    """A text on what is shown of seed 0 alone, which it says when there are others."""
    return f"{text} {texts.fill(texts.SEED_ZERO, seeds=results.seeds)}" if results.seeds > 1 else text


def _results_section(results: stage_results.Results) -> pages.Section:
    rows = results.per_image[results.per_image["method"] == scoring.PC_SIREN]
    large, small = (int(rows[rows["column"] == f"Pi_g-{size}"]["num_pred"].iloc[0]) for size in "LS")
    tau = results.setting("evaluate.tau_sq")
    caption = texts.fill(texts.RESULTS, tau=tau, large=f"{large:,}", small=f"{small:,}")
    if results.settings["pointclouds"]["shape_correction"] is not None:
        caption += " " + texts.fill(texts.SILHOUETTES)
    if results.paper_categories:
        caption += " " + texts.fill(texts.PAPER_COLUMNS)
    table = score_tables.paper_table(results.table, results.categories, _over_seeds(results, caption))
    return pages.Section("Results", [table, tuple(findings(results))])


def findings(results: stage_results.Results) -> list[str]:
    """What the tables say, in sentences made from their numbers."""
    scores = score_tables.Scores(results.table, scoring.MEASURED)
    found = []
    for method in (scoring.DDF, scoring.PC_SIREN):
        ratios = [
            f"{category} {mean / ours:.2f}"
            for category in results.categories
            if (ours := scores.value(category, (method, "Pi_g-L"), "chamfer_l2_sq_x1000"))
            and (mean := scores.value(category, (baselines.MEAN_SHAPE, "Pi_g-L"), "chamfer_l2_sq_x1000"))
        ]
        label = score_tables.METHOD_LABELS[method]
        found.append(texts.fill(texts.MEAN_SHAPE, label=label, ratios=", ".join(ratios)))
    changes = []
    for category in results.categories:
        before, after = (
            scores.value(category, (scoring.DDF, column), "chamfer_l2_sq_x1000")
            for column in ("Pi_pred-S", "Pi_corrected-S")
        )
        if before is not None and after is not None:
            changes.append(f"{category} {before:.3f} → {after:.3f}")
    return [*found, texts.fill(texts.CORRECTION, changes=", ".join(changes))] if changes else found


def _pictures_section(results: stage_results.Results, categories: list[str], rendered: int) -> pages.Section:
    blocks: list[str | pages.Figure] = [_of_seed_zero(results, texts.fill(texts.PICTURES, count=rendered))]
    for category in categories:
        caption = texts.fill(texts.STRIP, category=category.capitalize())
        alt = texts.fill(texts.STRIP_ALT, category=category)
        blocks.append(pages.Figure(f"strip_{category}.webp", caption, alt))
    return pages.Section("Pictures", blocks)


def _baselines_section(results: stage_results.Results) -> pages.Section:
    caption = _over_seeds(results, texts.fill(texts.BASELINES))
    table = score_tables.baseline_table(results.table, results.categories, caption)
    bars = pages.Figure("baselines.svg", texts.fill(texts.BARS), "bar charts of F-scores")
    caption = _of_means(results, texts.fill(texts.DISTANCES))
    distances = diagnosis.distance_table(results.table, results.categories, caption)
    return pages.Section("Baselines and ceilings", [bars, table, distances])


def _one_cycle_section(results: stage_results.Results) -> pages.Section:
    caption = texts.fill(texts.ONE_CYCLE, cycles=results.setting("pointclouds.cloud.cycles"))
    table = score_tables.one_cycle_table(results.table, results.categories, _over_seeds(results, caption))
    return pages.Section("One projection cycle", [table])


def _split_section(results: stage_results.Results) -> pages.Section:
    caption = _of_means(results, texts.fill(texts.SPLIT))
    table = diagnosis.split_table(results.table, results.categories, caption)
    return pages.Section("Shape and camera", [table])


def _cameras_section(results: stage_results.Results) -> pages.Section:
    caption = _over_seeds(results, texts.fill(texts.CAMERAS))
    table = score_tables.camera_table(results.table, results.categories, caption)
    caption = _of_seed_zero(results, texts.fill(texts.CAMERA_CURVES))
    curve = pages.Figure("cameras.svg", caption, "cumulative distributions of azimuth errors per category")
    return pages.Section("Cameras", [table, curve])


def _images_section(results: stage_results.Results) -> pages.Section:
    blocks = []
    for name, text in (("shapes", texts.SHAPES), ("images", texts.SCATTER)):
        caption = _of_seed_zero(results, texts.fill(text))
        blocks.append(pages.Figure(f"{name}.svg", caption, f"scatter plots of Chamfer distances of {name}"))
    return pages.Section("Shape by shape, image by image", blocks)


def _azimuth_section(results: stage_results.Results) -> pages.Section:
    caption = _of_seed_zero(results, texts.fill(texts.AZIMUTH, sectors=figures.SECTORS, range=figures.RANGE))
    alt = "Chamfer distances and azimuth errors over the azimuth of the camera"
    return pages.Section("Errors by azimuth", [pages.Figure("azimuth.svg", caption, alt)])


def _evenness_section(results: stage_results.Results) -> pages.Section:
    caption = _over_seeds(results, texts.fill(texts.EVENNESS))
    table = diagnosis.evenness_table(results.table, results.categories, caption)
    return pages.Section("Evenness of the clouds", [table])


def _training_section(results: stage_results.Results) -> pages.Section:
    rows: list[list[str]] = []
    for model, logs in results.logs.items():
        for category, log in logs.items():
            last = log.tail(max(1, len(log) // 20))["loss"].mean()
            steps, seconds = int(log["step"].iloc[-1]), float(log["seconds"].iloc[-1])
            rows.append([model, category, f"{steps:,}", f"{log['loss'].iloc[0]:.3f}", f"{last:.3f}", duration(seconds)])
    header = ["", "", "steps", "first loss", "last loss (mean of 5 %)", "time"]
    layout = [("", len(header), False)]
    caption = _of_seed_zero(results, texts.TRAINING)
    table = pages.Table(caption, layout, header, rows, labels=2, rule_every=len(results.categories))
    caption = _of_seed_zero(results, texts.CURVES)
    curves = pages.Figure("losses.svg", caption, "loss curves per model and category")
    return pages.Section("Training", [curves, budget(results), table])


def budget(results: stage_results.Results) -> str:
    """The wall time that each model trained for, over all categories, and by how much the two differ; of several seeds
    the median.
    """
    seconds = {
        model: statistics.median([stage_results.training_seconds(logs), *results.further_seconds.get(model, [])])
        for model, logs in results.logs.items()
    }
    least, most = min(seconds.values()), max(seconds.values())
    spent = ", ".join(f"{model} {duration(value)}" for model, value in seconds.items())
    more = 100 * (most / least - 1) if least > 0 else 0.0
    text = texts.SAME_BUDGET if more <= _SAME_PERCENT else texts.OTHER_BUDGET
    told = texts.fill(text, spent=spent, more=f"{more:.0f}")
    return f"{told} {texts.fill(texts.SEED_MEDIANS, seeds=results.seeds)}" if results.seeds > 1 else told


def _data_section(results: stage_results.Results) -> pages.Section:
    rows = [_data_row(results, category, entry["shapes"]) for category, entry in results.index["categories"].items()]
    header = ["", "train shapes", "test shapes", "points", "hidden, %", "watertight", "triangles", "mean", "Hausdorff"]
    layout = [("", 3, False), ("true clouds (test)", 2, False), ("training meshes", 2, False)]
    layout.append(("surface lost, % of diagonal, median / max", 2, False))
    blocks: list[str | tuple[str, ...] | pages.Table] = [pages.Table(texts.fill(texts.DATA), layout, header, rows)]
    errors = [f"`{name}` {value:.2g}" for name, value in results.largest_packing_errors().items()]
    blocks.append(f"Largest rounding errors of the stored samples: {', '.join(errors)}.")
    if len(results.failures):
        blocks.append(f"{len(results.failures)} shapes were left out:")
        blocks.append(
            tuple(f"`{row['id']}` ({row['stage']}): {row['reason']}" for row in results.failures.to_dict("records"))
        )
    else:
        blocks.append("No shape was left out.")
    return pages.Section("Data", blocks)


def _data_row(results: stage_results.Results, category: str, shapes: list[dict]) -> list[str]:
    tests = results.shapes[results.shapes["category"] == category]
    measures = results.measures[category]
    lost = [100.0 * measures[name] for name in ("mean_distance", "hausdorff")]
    return [
        category,
        str(sum(bool(shape["train_views"]) for shape in shapes)),
        str(sum(bool(shape["test_views"]) for shape in shapes)),
        f"{tests['points'].median():,.0f}",
        f"{100 * tests['hidden_share'].mean():.1f}",
        f"{int(measures['watertight'].astype(bool).sum())} of {len(measures)}",
        f"{measures['faces'].median():,.0f}",
        *(f"{values.median():.2f} / {values.max():.2f}" for values in lost),
    ]


def _times_section(results: stage_results.Results) -> pages.Section:
    rows = [
        [
            name,
            "not timed" if cost.seconds is None else duration(cost.seconds),
            *map(_mib, (cost.peak_mib, cost.worker_peak_mib)),
        ]
        for name, cost in results.costs.items()
    ]
    known = [cost.seconds for cost in results.costs.values() if cost.seconds is not None]
    rows.append(["together", duration(sum(known, 0.0)), "", ""])
    caption = _of_seed_zero(results, texts.fill(texts.TIMES, threads=os.cpu_count()))
    header = ["stage", "time", "memory, MiB", "of a worker, MiB"]
    return pages.Section("Times and memory", [pages.Table(caption, [("", len(header), False)], header, rows)])


def _mib(value: float | None) -> str:
    return "–" if value is None else f"{value:,.0f}"


def _limits_section(results: stage_results.Results) -> pages.Section:
    given = [(name, results.setting(key), paper) for name, key, paper in SETTINGS]
    changed = [row for row in given if row[1] not in (row[2], _ALL_VIEWS)]
    limits = [texts.LIMIT_SYNTHETIC] if results.synthetic else []
    limits += [texts.LIMIT_SIZES] if changed else []
    limits += [texts.LIMIT_SEEDS if results.seeds > 1 else texts.LIMIT_SEED, texts.LIMIT_QUOTED]
    blocks: list[tuple[str, ...] | pages.Table] = [tuple(texts.fill(text, seeds=results.seeds) for text in limits)]
    if changed:
        blocks.append(pages.Table(texts.SETTINGS, [("", 3, False)], ["", "here", "paper"], changed))
    return pages.Section("What does not reproduce", blocks)


def duration(seconds: float) -> str:
    """Seconds, minutes or hours, whichever reads best."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.1f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
