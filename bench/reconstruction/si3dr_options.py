"""Switches of single-image reconstruction, each turned alone (`make ablate-options`), scored on validation shapes.
Trainings take as long as that of `base`, whose two other seeds show what chance alone does.

It runs on what `make reproduce-table` prepared (artifacts/cpu): the DDF of one category, trained with configs/cpu.yaml
(`base`) and with one setting changed, two side by side with one thread each. Every row is given as many steps as take
as long as those of `base`, by trials of both in turn (`times_base`: a step's time over one of `base`), so the machine
may be busier for one row than for another. No test shape is read. `difference` is the mean of D_C less that of `base`
on the same images, ± its standard error over shapes: what does not exceed two of them is no reason for a setting.
Switches of clouds and camera correction need no training and are rows on the model of `base`. Seconds are those of
the training, or of an image's clouds. Rows are kept in artifacts/si3dr_options and made again only when something that
they depend on has changed; one that was killed goes on from its checkpoint.
"""

import argparse
import concurrent.futures
import dataclasses
import functools
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.lib import display, measuring, overrides
from ddf.core import checks, config, provenance, storage
from ddf.data import sampling, shapenet
from ddf.data.batches import category_data
from ddf.metrics import metrics
from ddf.models.reconstruction import inference, reconstruction_models, settings
from ddf.training import step_timing, training_loop
from ddf.training.reconstruction import training_steps, training_truth
from ddf_lab.evaluation import scoring
from ddf_lab.run import Run

ON_DEMAND = "make ablate-options"
CONFIG = Path("configs/cpu.yaml")
OUT = Path("artifacts/si3dr_options")
PLAN, RESULT = "plan.json", "result.json"
SIDE_BY_SIDE = 2
TOLERANCE = 0.3  # relative; the number of steps depends on measured times
# what is changed, by the row's name: the key in configs/cpu.yaml and its other value, the paper's where they differ
TRAINED: Mapping[str, Mapping[str, Any]] = {
    "base": {},
    "base, second seed": {"train.loop.seed": 1},
    "base, third seed": {"train.loop.seed": 2},
    "azimuth as an angle": {"train.azimuth": "angle"},
    "AdamW alone": {"ddf.muon": None, "train.loop.muon": None},
    "learning rates of PC-SIREN": {"ddf.learning_rate": None, "ddf.muon": None},
    "encoders as fast as the field": {"ddf.encoder_learning_rate": None},
    "squared depth loss": {"ddf.weights.depth_huber": None},
    "depth by softplus": {"ddf.field.depth_activation": "softplus"},
    "bandwidth of directions as of positions": {"ddf.field.direction_scale": 1.0},
    "first frequency of 3": {"train.decoder.omega_first": 3.0},
    "samples cast while training": {"ddf.samples": "fresh"},
    "no proposed rays": {"ddf.proposals": None},
    "all pixels of the mask": {"ddf.mask_pixels": None},
}
DRAWN: Mapping[str, Mapping[str, Any]] = {
    "no jitter": {"pointclouds.cloud.jitter": 0.0},
    "no recheck": {"pointclouds.cloud.recheck": []},
    "most visible points": {"pointclouds.cloud.spread": None},
    "candidates without confidence too": {"pointclouds.cloud.least_confidence": 0.0},
    "uniform directions": {"pointclouds.cloud.aimed": 0.0},
    "strays as wanted as others": {"pointclouds.cloud.crowding": 0.0},
    "48 directions": {"pointclouds.cloud.num_directions": 48},
    "128 directions": {"pointclouds.cloud.num_directions": 128},
    "one cycle": {"pointclouds.cloud.cycles": 1},
    "radius free in the correction": {"pointclouds.correction.free": list(settings.CAMERA_NUMBERS)},
}
OPTIONS = TRAINED | DRAWN
COLUMNS = {"": ("L", "Pi_g"), "_predicted_camera": ("S", "Pi_pred"), "_corrected_camera": ("S", "Pi_corrected")}


@dataclasses.dataclass(frozen=True)
class Task:
    """What all rows share. steps: of `base`. views: the first ones of each validation shape. seed: of all."""

    category: str
    steps: int
    views: int
    seed: int

    @property
    def run(self) -> Run:
        """Where the category's data are."""
        return Run.read(CONFIG, self.category)


@dataclasses.dataclass(frozen=True)
class Settings:
    """The sections of cpu.yaml with a row's change."""

    train: settings.TrainConfig
    ddf: settings.DDFConfig
    pointclouds: settings.PointcloudsConfig

    @classmethod
    def of(cls, name: str, seed: int) -> "Settings":
        """Those of a row.

        Raises:
          InputError: cpu.yaml already has the value.
        """
        run = Run(CONFIG, overrides.changed(config.read(CONFIG), OPTIONS[name], str(CONFIG)), seed=seed)
        return cls(
            run.reseeded(settings.TrainConfig),
            run.reseeded(settings.DDFConfig),
            run.reseeded(settings.PointcloudsConfig),
        )


def folder(task: Task, name: str) -> Path:
    """Where a row is kept."""
    return OUT / task.category / re.sub(r"\W+", "-", name)


def split(task: Task, dataset: shapenet.Dataset) -> tuple[list, list]:
    """(id, views) of the shapes that are trained on, and of those held out for validation.

    Raises:
      InputError: none are held out.
    """
    samples = task.run.folder("samples")
    known = category_data.available(samples, dataset.train(task.category))
    held = category_data.available(samples, dataset.validation(task.category))
    if not held:
        raise checks.InputError(f"{CONFIG}: dataset.validation leaves no shape of {task.category} for validation")
    return known, [(shape, shown[: task.views]) for shape, shown in held]


@dataclasses.dataclass(frozen=True)
class Training:
    """A row's training, ready to start. key: fingerprint of everything that it depends on."""

    trainee: step_timing.Trainee[reconstruction_models.DDFModel]
    key: str


def prepared(task: Task, settings: Settings, dataset: shapenet.Dataset) -> Training:
    """A row's training as the stage does it, but for the shapes held out."""
    samples_dir = task.run.folder("samples")
    shown, _ = split(task, dataset)
    images = category_data.read_images(dataset, task.category, shown, settings.train.image_size)
    shapes = category_data.read_shapes(samples_dir, images.ids)
    truth = training_truth.read(
        shapes, settings.ddf, task.run.section(sampling.SamplesConfig), samples_dir, task.run.folder("meshes")
    )

    training_loop.prepare(settings.train.loop)
    model = reconstruction_models.ddf_model(settings.train, settings.ddf.field).to(training_loop.device())
    model.camera_head.fit(images.cameras)

    def groups(model: reconstruction_models.DDFModel) -> list[dict]:
        decays = settings.train.weight_decay_shape, settings.train.weight_decay_camera
        return model.parameter_groups(*decays, settings.ddf.encoder_share(settings.train.loop))

    def loss(model: reconstruction_models.DDFModel) -> training_loop.StepLoss:
        return functools.partial(
            training_steps.ddf_step,
            model,
            images,
            shapes,
            truth.samples,
            settings.train,
            settings.ddf,
            propose=truth.propose,
        )

    key = provenance.fingerprint(
        [dataclasses.asdict(task), settings.train, settings.ddf, images.digest(), truth.drawn],
        truth.sources,
        training_steps,
    )
    return Training(step_timing.Trainee(model, groups, loss, settings.ddf.loop(settings.train.loop)), key)


def planned(task: Task, settings: Settings, own: Training, dataset: shapenet.Dataset, path: Path) -> dict[str, Any]:
    """Steps that take as long as those of `base`, and `times_base`; measured once and kept in a file."""
    plan = storage.read_json(path) if path.exists() else {}
    if plan.get("fingerprint") != own.key:
        base, ratio = Settings.of("base", task.seed), 1.0
        loop = dataclasses.replace(settings.train.loop, seed=base.train.loop.seed)  # which changes no time
        if (dataclasses.replace(settings.train, loop=loop), settings.ddf) != (base.train, base.ddf):
            ratio = step_timing.times_as_long(own.trainee, prepared(task, base, dataset).trainee)
        plan = {"fingerprint": own.key, "steps": max(1, round(task.steps / ratio)), "times_base": ratio}
        storage.write_json(path, plan)
    return plan


def train(task: Task, name: str, settings: Settings, dataset: shapenet.Dataset) -> dict[str, float]:
    """Train the row's model; steps, `times_base` and seconds."""
    own, out = prepared(task, settings, dataset), folder(task, name)
    plan = planned(task, settings, own, dataset, out / PLAN)
    record, trainee = {"fingerprint": f"{own.key} {plan['steps']}"}, own.trainee
    training_loop.prepare(settings.train.loop)  # trials of other models came between
    start = trainee.groups(trainee.model), trainee.loss(trainee.model)
    training_loop.fit(trainee.model, *start, plan["steps"], trainee.loop, out, record, name)
    seconds = training_loop.read_log(out)[-1]["seconds"]
    return {"steps": plan["steps"], "times_base": plan["times_base"], "seconds": seconds}


def score(
    task: Task, name: str, settings: Settings, dataset: shapenet.Dataset
) -> tuple[dict[str, float], float, dict[str, float]]:
    """Means over the validation images, medians of camera errors; the seconds of an image's clouds; D_C x 1000 of each
    shape with the true camera.

    D_C and F of the large cloud with the true camera, of the small one with the predicted and the corrected camera.
    """
    training_loop.prepare(settings.train.loop)
    model = reconstruction_models.ddf_model(settings.train, settings.ddf.field)
    training_loop.load_model(model, folder(task, name if name in TRAINED else "base"))
    images = category_data.read_images(dataset, task.category, split(task, dataset)[1], settings.train.image_size)
    samples_dir = task.run.folder("samples")
    section = dataclasses.replace(settings.pointclouds, rendered=0, shape_correction=None)
    tensors, facts = inference.reconstruct_ddf(model, images, section, name)
    arrays = {key: value.numpy() for key, value in tensors.items()} | {"camera_true": images.cameras.numpy()}
    placed = category_data.read_shapes(samples_dir, images.ids).placements(images.shapes)
    arrays |= {key: value.numpy() for key, value in placed.items()}
    found = scoring.Predictions(OUT, [(str(row["id"]), int(row["view"])) for row in images.names()], arrays, facts)
    truths, scores, by_shape = scoring.load_truth(samples_dir), {}, {}
    for suffix, (size, camera) in COLUMNS.items():
        cloud = f"{size}.h{section.cloud.cycles}"
        values = [
            metrics.compare_clouds(found.cloud(cloud, row, camera), truths[shape].benchmark_points())
            for row, (shape, _) in enumerate(found.images)
        ]
        chamfer = [1e3 * value.chamfer_l2_sq for value in values]
        scores[f"chamfer_l2_sq_x1000{suffix}"] = float(np.mean(chamfer))
        scores[f"f_score_tau_x100{suffix}"] = float(np.mean([100 * value.f_score_tau for value in values]))
        if not suffix:
            by_shape = {
                shape: float(np.mean([chamfer[row] for row in rows]))
                for shape, rows in scoring.views_by_shape(found.images).items()
            }
    errors = scoring.camera_errors(scoring.DDF, found)
    predicted = errors[errors["column"] == "Pi_pred"]
    scores["azimuth_error_deg_median"] = float(predicted["azimuth_error_deg"].median())
    return scores, facts["seconds"]["cloud"], by_shape


def against_base(own: Mapping[str, float], base: Mapping[str, float]) -> str:
    """Mean difference of D_C x 1000 on the same shapes, ± its standard error."""
    gaps = np.array([own[shape] - base[shape] for shape in base])
    return f"{gaps.mean():+.3f} ± {gaps.std(ddof=1) / np.sqrt(len(gaps)):.3f}"


def make(task: Task, name: str) -> None:
    """Train where the row says so, score, and keep the row."""
    dataset = shapenet.Dataset.open(task.run.index)
    settings = Settings.of(name, task.seed)
    trained = train(task, name, settings, dataset) if name in TRAINED else {}
    error, cloud_seconds, by_shape = score(task, name, settings, dataset)
    size = dataclasses.asdict(task) | {"points": settings.pointclouds.large}
    row = measuring.row(name, size, [trained.get("seconds", cloud_seconds)], error, TOLERANCE)
    changed = ", ".join(f"{key}: {value}" for key, value in OPTIONS[name].items())
    told = {"changed": changed, "steps": trained.get("steps", 0), "times_base": trained.get("times_base")}
    told |= {"cloud_seconds": cloud_seconds}
    result = {"fingerprint": identity(task, name), "row": row | told, "chamfer_of_shapes": by_shape}
    storage.write_json(folder(task, name) / RESULT, result)


def identity(task: Task, name: str) -> str:
    """Of everything that a row depends on; a row without training, of its model too."""
    samples = storage.shard_files(task.run.folder("samples"), category_data.SAMPLES, "samples")
    sources = [task.run.index, *samples]
    sources += [] if name in TRAINED else [folder(task, "base") / training_loop.MODEL]
    settings = dataclasses.asdict(Settings.of(name, task.seed))
    return provenance.fingerprint([dataclasses.asdict(task), settings], sources, [training_steps, inference, scoring])


def kept(task: Task, name: str) -> dict[str, Any] | None:
    """The row if it is there and nothing that it depends on has changed."""
    path = folder(task, name) / RESULT
    if not path.exists() or (name not in TRAINED and not (folder(task, "base") / training_loop.MODEL).exists()):
        return None
    result = storage.read_json(path)
    if result["fingerprint"] != identity(task, name):
        return None
    base = storage.read_json(folder(task, "base") / RESULT)["chamfer_of_shapes"] if name != "base" else {}
    return result["row"] | ({"difference": against_base(result["chamfer_of_shapes"], base)} if base else {})


def run(task: Task, name: str) -> None:
    """`make` in a process of its own, unless the row is kept."""
    if kept(task, name) is None:
        given = [f"--{key.replace('_', '-')}={value}" for key, value in dataclasses.asdict(task).items()]
        if subprocess.run([sys.executable, "-m", "bench", "si3dr_options", *given, "--one", name]).returncode:
            raise checks.InputError(f"the row {name!r} failed; its own message is above")


def rows(task: Task, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The rows in order; `base`, with which all are compared, is made first, then two at a time."""
    with concurrent.futures.ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        for group in (["base"], TRAINED, DRAWN):
            list(pool.map(functools.partial(run, task), [name for name in group if name in names]))
    for name in names:
        found = kept(task, name)
        if found is None:
            raise checks.InputError(
                f"the row {name!r} is not there, although it was made: its inputs changed meanwhile"
            )
        yield found


SECTION = display.Section(
    views=(
        display.View(
            "chamfer_l2_sq_x1000",
            "1000 D_C",
            lambda _: "clouds of an image, model of base",
            keep=lambda row: not row.told.get("steps"),  # trainings take the same time, by design
        ),
    )
)


def main(arguments: Sequence[str]) -> None:
    """Make all rows and write them; --rows for some of them, printed and not written."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--category", default="car")
    parser.add_argument("--steps", type=int, default=400, help="of `base`; others take as long (default %(default)s)")
    parser.add_argument("--views", type=int, default=2, help="of each validation shape (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="added to all seeds of the config")
    parser.add_argument("--rows", nargs="+", choices=list(OPTIONS), help="these alone; prints instead of writing")
    parser.add_argument("--one", choices=list(OPTIONS), help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    task = Task(given.category, given.steps, given.views, given.seed)
    needed = task.run.folder("samples")
    if not needed.exists():
        print(f"si3dr_options: skipped, {needed} is not there; `make reproduce-table` makes it")
    elif given.one:
        make(task, given.one)
    elif given.rows:
        names = ["base", *given.rows]
        print(json.dumps(list(rows(task, list(dict.fromkeys(names)))), indent=1))
    else:
        measuring.write("si3dr_options", 1, list(rows(task, list(OPTIONS))))
