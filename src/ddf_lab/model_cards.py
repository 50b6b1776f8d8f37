"""The models that come with the package: patches and networks of a few shapes, reconstruction models, a card each.

A card says what a model is of, how it was trained and what it reaches.
"""

import dataclasses
import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from ddf.core import storage
from ddf.data import shapenet, splits
from ddf.data.public import manifest
from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.fields import framed_field, model_files, shape_field
from ddf.fit import (
    fit_folder,
    fit_settings,
    fitting,
    held_out,
    inspection,
    latent_prior,
    patch_fitting,
    shape_samples,
)
from ddf.geometry import mesh_io
from ddf.models import out_of_distribution, reconstruction_settings
from ddf.training import line_steps
from ddf_lab.evaluation import card_scores, groups
from ddf_lab.run import Run, class_of

CARD, INDEX, SOURCES = "card.md", "index.json", "sources.csv"
FIT = fit_settings.FitConfig()
STEPS = 6000  # of a field's fit: what two quiet cores do in two to four minutes
SAMPLES = 3  # images beside a reconstruction model: first views of its first test shapes
LICENCE = "MIT, as this repository. Shapes and images are made by its own code; nothing else went in."
FIELDS = {  # of `showcase.SHAPES`: what each shows
    "rabbit": "A sitting rabbit: one smooth closed surface.",
    "nested": "A box with a window and a cube inside: inner structure, which a field from outside cannot hold.",
    "armchair": "An upholstered armchair: flat faces, a deep seat.",
    "airliner": "An airliner: thin wings, a tail and engines.",
}


def write_all(run: Run, fitted: Path, out: Path) -> None:
    """The shipped models that an experiment gives, one folder each, and the index of all.

    One that trained on real shapes gives reconstructions (seed 0) alone, of categories whose training shapes ask for
    credit at most.

    Args:
      fitted: folder of the fits; one that is there already is not repeated.
    Raises:
      FileNotFoundError: the experiment has no trained model.
    """
    dataset, synthetic = shapenet.Dataset.open(run.index), storage.read_json(run.index)["source"] == "synthetic"
    fields = FIELDS.items() if synthetic else ()
    made = [each for name, summary in fields for each in write_fields(name, summary, fitted / name, out)]
    free = [n for n in dataset.categories if all(row.free for row in _seen(run, dataset, n))]
    made += [write_reconstruction(run, dataset, name, out / name) for name in free]
    every = {entry["name"]: entry for entry in ([] if synthetic else read_index(out)) + made}
    write_index(out, list(every.values()))


def _seen(run: Run, dataset: shapenet.Dataset, category: str) -> list[manifest.Row]:
    """The real shapes that trained a category, each as often as it did: with its variations."""
    rows = {row.id: row for row in run.section(class_of("dataset")).rows() if row.category == category}
    return [rows[name] for shape, _ in dataset.views(category, "train") if (name := shape.partition("--")[0]) in rows]


def write_fields(name: str, summary: str, fitted: Path, out: Path) -> list[dict[str, Any]]:
    """One of `showcase.SHAPES` as patches and as a network, by the recipes of `ddf fit`; their entries.

    Args:
      fitted: folder of the network's fit. out: folder of all models.
    """
    mesh, loop = showcase.SHAPES[name](), dataclasses.replace(FIT.loop, threads=1)
    settings = dataclasses.replace(FIT, steps=STEPS, minutes=None, loop=loop)
    result = fitting.fit(mesh, settings, fitted, force=True)
    patches, own = patch_fitting.patches(mesh), f"{name}-network"
    patches.save(out / name)
    write_weights(fitted, out / own)
    network = shape_field.load(out / own)  # with the rounded weights
    inside, counts = fit_folder.in_cube(mesh)[0], sample_types.each(settings.held_out)
    samples = shape_samples.draw_samples(inside, settings.drawing, counts, "held_out")
    told = [
        f"{result['steps']:,} steps, seed {loop.seed}, {result['parameters']:,} parameters, on a CPU.",
        f"{sum(settings.samples.values()):,} oriented points of the six types.",
        "Matrices are stored in float16.",
    ]
    jumps = "Nothing is learned; curvature jumps between patches."
    blurred = "Depths are blurred at occlusion edges; curvature is rough near sharp edges."
    kept = f"{len(patches.tree.codes):,} patches; wanted: {patches.tolerance:g} of half the longest side from the mesh."
    errors = fitting.held_out_errors(network.field, samples), held_out.errors(held_out.of_framed(patches), samples)
    return [
        _field_card(out / name, summary, mesh, [kept], errors[1], patches, jumps),
        _field_card(out / own, f"{summary} The paper's network.", mesh, told, errors[0], network, blurred),
    ]


def _field_card(
    out: Path,
    summary: str,
    mesh: mesh_io.Mesh,
    made: Sequence[str],
    errors: Mapping[str, Any],
    field: framed_field.FramedField,
    limit: str,
) -> dict[str, Any]:
    inner, shape = inspection.wrong_inside(field, inspection.beside(field, mesh)), out.name.partition("-")[0]
    sections = {
        "Data": [f"`{showcase.__name__}.SHAPES['{shape}']`: {len(mesh.faces):,} triangles, made by this repository."],
        "Fit": made,
        "Scores": [
            "Held-out errors, 10,000 samples a type; the longest side of the shape is 2.",
            f"Mean depth error: {', '.join(f'{kind} {value:.4f}' for kind, value in errors['depth_l1'].items())}.",
            f"Median angle of normals: {errors['normal_angle_deg_median']:.1f} degrees.",
            f"Interior error: {inner:.1f} % of rays from within the box.",
        ],
        "Limits": [f"One shape alone. {limit}"],
        "Licence": [LICENCE],
    }
    return write_card(out, out.name, "field", summary, sections)


def write_reconstruction(run: Run, dataset: shapenet.Dataset, name: str, out: Path) -> dict[str, Any]:
    """Weights, sample images and card of the models that the experiment trained on a category; its entry.

    The model of images is that of train_ddf_image. Shapes of latents are of train_ddf, where that is done; else those
    that are there stay.
    """
    trained = run.folder("train_ddf_image", name)
    if not (trained / model_files.MODEL).exists():
        raise FileNotFoundError(f"{trained / model_files.MODEL}: no trained model; run make train CONFIG={run.file}")
    given = run.section(reconstruction_settings.TrainConfig)
    train, section, _ = run.section(line_steps.ImageTrainConfig).started(given, name)
    record = {"train": dataclasses.asdict(train), "section": dataclasses.asdict(section)}
    weights = write_weights(trained, out, record)
    if (run.folder("train_ddf", name) / model_files.MODEL).exists():
        latent_prior.write(run.folder("train_ddf", name), out)
    for number, (shape, views) in enumerate(dataset.views(name, "test")[:SAMPLES]):
        image = shapenet.image_path(dataset.root, dataset.category(name).synset, shape, views[0])
        shutil.copyfile(image, out / f"sample_{number}.png")
    told = card_scores.tell_apart(out, name, run.root / "kinds")
    seen, shapes = _seen(run, dataset, name), dataset.views(name, "train")
    write_sources(seen, out / SOURCES)
    data = [f"{len(shapes) - len(seen)} procedural {name}s in ShapeNet's layout, {len(splits.VIEWS)} views each."]
    if seen:
        real, views = len({row.id for row in seen}), max(len(v) for _, v in shapes)
        data.append(f"{real} of other people (`{SOURCES}`) and {len(seen) - real} variations, {views} views each.")
    data.append(f"`sample_0.png` to `sample_{SAMPLES - 1}.png` show test shapes, which training never saw.")
    latents = storage.load_metadata(out / latent_prior.SHAPES)["steps"]
    own = " with `dataset.own`" if any(row.package == manifest.OWN for row in seen) else ""
    sections = {
        "Data": data,
        "Training": [
            f"Seed 0 of `{run.file}`{own}: {section.steps:,} steps, {_count(weights):,} parameters.",
            f"Images are reduced to {train.image_size} x {train.image_size} pixels.",
            f"`{latent_prior.SHAPES}`: a DDF of latents, {latents:,} steps, for `ddf complete` and `ddf generate`.",
            "Matrices are stored in float16.",
        ],
        "Scores": [
            f"These weights on test shapes of `{run.file}`: D_C x 1000 / F(τ) x 100, with 5,000 points.",
            *_scores(dataclasses.replace(run, category=name), out),
        ],
        "Limits": [
            "Trained on renders alone: real photographs are outside of what it knows.",
            f"It makes a {name} of any object, and warns of some: next line.",
            told,
            "Images without alpha are cut out by their background or `--mask`.",
            *related(seen),
        ],
        "Licence": licence(seen),
    }
    return write_card(out, name, "reconstruction", f"Camera and field of a {name} from one RGBA image.", sections)


def related(seen: Sequence[manifest.Row]) -> list[str]:
    """How many of the real shapes are of the makers, or are aircraft of the types, of public test shapes."""
    rows = {row.id: row for row in seen}
    tests = [row for row in manifest.of({row.category for row in seen}) if row.split == "test"]
    apart = {row.id for row in manifest.unrelated([*rows.values(), *tests])}
    families = sorted({row.family for name, row in rows.items() if name not in apart})
    count = sum(name not in apart for name in rows)
    told = (
        f"{count} of {len(rows)} shapes of other people are of makers or types of test shapes: {', '.join(families)}."
    )
    return [told] if count else []


def licence(seen: Sequence[manifest.Row]) -> list[str]:
    """Under which licence a model is, and whose shapes it has seen."""
    if not seen:
        return [LICENCE]
    return ["MIT, as this repository. Renders of shapes of these people trained it:", *groups.makers(seen)]


def write_sources(rows: Sequence[manifest.Row], path: Path) -> None:
    """Title, author, licence and source of each real shape once, as CC BY asks."""
    each = sorted({row.id: row for row in rows}.values(), key=lambda row: row.id)
    told = [(r.id, r.creator, r.licence, r.source or f"{r.package} (Debian): {r.path}") for r in each]
    storage.write_rows(path, [("title", "author", "licence", "source"), *told])


def _scores(run: Run, folder: Path) -> list[str]:
    """What the shipped weights of the run's category reach on its test shapes: on real ones alone, where there are."""
    kind = groups.REAL if storage.read_json(run.index)["source"] == "both" else ""
    means, said = card_scores.measure(run, folder, kind), []
    for group in means.index.unique("category"):
        reached = []
        for camera, column in (("true", "Pi_g"), ("predicted", "Pi_pred"), ("corrected", "Pi_corrected")):
            chamfer, share = (means[group, column, name] for name in ("chamfer_l2_sq_x1000", "f_score_tau_x100"))
            reached.append(f"{camera} camera {chamfer:.3f} / {share:.1f}")
        said.append(f"{group}s: {', '.join(reached)}.".capitalize())
    return said


def _count(weights: Path) -> int:
    """Trained parameters of a file: all floating tensors but the running statistics of normalisation."""
    tensors, _ = out_of_distribution.parted(storage.load_tensors(weights, framework="torch")[0])
    kept = [v for k, v in tensors.items() if not k.rpartition(".")[2].startswith(("running_", "num_batches"))]
    return int(sum(torch.numel(value) for value in kept))


def write_weights(folder: Path, out: Path, changes: Mapping[str, Any] | None = None) -> Path:
    """The model of a folder with `rounded` weights and `changes` to its record, in `out`; returns the file."""
    tensors, record = storage.load_tensors(folder / model_files.MODEL, framework="torch")
    file = out / model_files.MODEL
    storage.save_tensors(file, model_files.rounded(tensors), record | dict(changes or {}) | {"weights": "float16"})
    return file


def write_card(out: Path, name: str, kind: str, summary: str, sections: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """The card of a model as Markdown: a sentence, then bullets under headings; its entry of the index."""
    bullets = {heading: "\n".join(f"- {each}" for each in own) for heading, own in sections.items()}
    parts = [f"# {name}", summary, *(part for heading, own in bullets.items() for part in (f"## {heading}", own))]
    storage.write_text(out / CARD, "\n\n".join(parts) + "\n")
    return {"name": name, "kind": kind, "summary": summary}


def read_index(root: Path) -> list[dict[str, Any]]:
    """The entries that `write_index` was given."""
    models = storage.read_json(root / INDEX)["models"]
    return [{key: value for key, value in model.items() if key != "files"} for model in models]


def write_index(root: Path, entries: Sequence[Mapping[str, Any]]) -> None:
    """index.json of the folder of models: the entries that `write_card` gave, and files with their sizes."""
    models = []
    for entry in entries:
        files = sorted(path for path in (root / entry["name"]).iterdir() if path.is_file())
        models.append({**entry, "files": {path.name: path.stat().st_size for path in files}})
    storage.write_text(root / INDEX, json.dumps({"models": models}, indent=2) + "\n")
