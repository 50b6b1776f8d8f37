"""Memory, disk and time against the number of shapes, and a projection to the published setting.

Runs every stage on 30 and on 300 synthetic shapes with small sizes, each as `make` runs it, both side by side, and
reads the peak memory that the stages note, which is that of their own processes; reads disk and memory of the reference
run from artifacts/cpu where there is one; measures what a shape costs at the settings of configs/paper.yaml. Writes
reports/bench/growth.json and reports/growth.md.
"""

import csv
import functools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent import futures
from pathlib import Path
from typing import Any

import yaml

from bench.growth import projection
from bench.lib import display, measuring
from ddf_lab import run
from ddf_lab.report import pages

ROOT = measuring.ROOT
CONFIG, PAPER = ROOT / "configs" / "cpu.yaml", ROOT / "configs" / "paper.yaml"
STEP = measuring.OUT / "full_size_step.json"
GPU = measuring.REPORTS / "gpu" / "check.json"  # of `gpu_check`, where one was measured
CATEGORY, SIZES = "chair", (30, 300)
LIMIT_MIB = 4096
COUNTS = {"U": 1200, "A": 1200, "B": 600, "S": 600, "T": 600, "O": 600}
SHARD_SIZE = 10  # cpu.yaml has 40: what a training keeps open would then hold all of 300 shapes
SMALL = {  # of cpu.yaml, so that 300 shapes take a minute or two; everything else is as there
    "dataset": {"views": 5},
    "meshes": {"faces": 2000, "measure_points": 1000, "shard_size": SHARD_SIZE},
    "samples": {"counts": COUNTS, "cloud_points": 1000, "shard_size": SHARD_SIZE},
    "train": {"train_views": None, "step_shares": None},
    "ddf": {"steps": 3},
    "pcsiren": {"steps": 3},
    "pointclouds": {"large": 500, "small": 250, "test_views": 5, "rendered": 2},  # images that fill a batch
    "evaluate": {"oracle_points": 250},
    "export": {"outputs": ["visibility", "depth", "normals"], "batches": [1, 7], "precisions": []},
}
STAGES = (*run.STAGES, "export_onnx", "report")
WHOLE = (*run.WHOLE, "report")
MACHINES = {"2 cores": 2, "64 cores": 64}
GIB = 2**30


def small_config(shapes: int) -> dict[str, Any]:
    """cpu.yaml with one category of so many shapes and SMALL in its sections."""
    settings = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))
    for section, values in SMALL.items():
        settings[section] |= values
    settings["dataset"]["categories"] = {CATEGORY: shapes}
    settings["pointclouds"]["cloud"] |= {"num_directions": 8, "recheck": []}
    settings["pointclouds"]["correction"]["steps"] = 1
    return settings


def run_stages(folder: Path, shapes: int) -> dict[str, dict[str, float]]:
    """What each stage notes of its run on so many shapes: seconds, and MiB of its process and of a worker."""
    name = f"growth{shapes}"
    (folder / "configs").mkdir(exist_ok=True)
    (folder / "configs" / f"{name}.yaml").write_text(yaml.safe_dump(small_config(shapes)), encoding="utf-8")
    notes = {}
    for stage in STAGES:
        category = [] if stage in WHOLE else ["--category", CATEGORY]
        command = [sys.executable, str(ROOT / "stages" / f"{stage}.py"), "--config", f"configs/{name}.yaml", *category]
        environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
        result = subprocess.run(command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)
        if result.returncode:
            raise SystemExit(f"{' '.join(command)} failed:\n{result.stderr}")
        print(f"{stage} on {shapes} shapes", file=sys.stderr)
        note = "-".join([stage, *category[1:]])
        notes[stage] = json.loads((folder / "artifacts" / name / "times" / f"{note}.json").read_text())
    return notes


def workers() -> int:
    """Processes that a map over shapes starts on this machine."""
    return max(2, os.cpu_count() or 1)


def reference_memory(artifacts: Path) -> dict[str, dict[str, float]]:
    """The largest figures that the stages of the reference run noted; without those that noted no memory."""
    found: dict[str, dict[str, float]] = {}
    for stage in STAGES:
        paths = sorted((artifacts / "times").glob(f"{stage}*.json"))
        notes = [note for note in map(_read, paths) if note is not None and "peak_mib" in note]
        if notes:
            found[stage] = {key: max(note[key] for note in notes) for key in ("peak_mib", "worker_peak_mib")}
    return found


def reference_disk(artifacts: Path) -> list[dict[str, Any]]:
    """Bytes of every artefact of the reference run, and units to divide them by."""
    index = _read(artifacts / "dataset" / "index.json")
    if index is None:
        return []
    shapes = [shape for entry in index["categories"].values() for shape in entry["shapes"]]
    scores = artifacts / "evaluate" / "per_image.csv"
    images = _counts(scores)[1] if scores.exists() else 0
    parts = {
        "dataset: meshes": ("dataset/ShapeNetCore.v1", "shape", len(shapes)),
        "dataset: renders": ("dataset/ShapeNetRendering", "shape", len(shapes)),
        "meshes": ("meshes", "shape", len(shapes)),
        "samples": ("samples", "shape", len(shapes)),
        "train_ddf": ("train_ddf", "category", len(index["categories"])),
        "train_pcsiren": ("train_pcsiren", "category", len(index["categories"])),
        "pointclouds": ("pointclouds", "test image", images),
        "evaluate": ("evaluate", "test image", images),
    }
    rows = []
    for what, (folder, unit, count) in parts.items():
        files = [path for path in (artifacts / folder).rglob("*") if path.is_file()]
        if files and count:
            size = sum(path.stat().st_size for path in files)
            rows.append({"what": what, "unit": unit, "units": count, "files": len(files), "bytes": size})
    return rows


def _counts(scores: Path) -> tuple[int, int]:
    """Rows of a table of scores, and images that they are of."""
    with scores.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return len(rows), len({(row["category"], row["id"], row["view"]) for row in rows})


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def paper_costs(folder: Path, images: dict[str, float]) -> dict[str, Any]:
    """CPU seconds and bytes per unit at the settings of paper.yaml; see `shape_costs`."""
    from bench.growth import (
        shape_costs,  # here: the kernel counts this process's memory as a peak of the stages that it starts
    )

    paper = run.Run.read(PAPER)
    index = folder / "artifacts" / f"growth{SIZES[0]}" / "dataset" / "index.json"
    os.chdir(folder)  # the index names its files from here
    return {
        "dataset": {"cpu_s": shape_costs.check(index, CATEGORY, 10)},
        **shape_costs.prepare(paper, folder),
        "pointclouds": shape_costs.reconstruct(paper),
        "evaluate": shape_costs.evaluate(paper, paper.given["samples"]["cloud_points"]) | images,
        "steps": {f"train_{model}": paper.given[model]["steps"] for model in ("ddf", "pcsiren")},
    }


def project(
    costs: Mapping[str, Any], step: Mapping[str, Any] | None, gpu: Mapping[str, Any] | None
) -> list[dict[str, Any]]:
    """A row per stage: units, what one costs, hours by machine and bytes; None is what was not measured.

    Args:
      step: a step's rows on the CPU. gpu: on one GPU.
    """
    split, evaluate = projection.Split.of(projection.LINES), costs["evaluate"]
    cloud = costs["pointclouds"]
    maps = {
        "dataset": ("shape", split.shapes, costs["dataset"]["cpu_s"], 0.0),
        "meshes": ("shape", split.shapes, costs["meshes"]["cpu_s"], split.shapes * costs["meshes"]["bytes"]),
        "samples": ("shape", split.shapes, costs["samples"]["cpu_s"], split.shapes * costs["samples"]["bytes"]),
        "pointclouds": ("test image", split.test_images, cloud["cpu_s"], _cloud_bytes(cloud, split)),
        "evaluate": (
            "test image",
            split.test_images,
            evaluate["case_cpu_s"] * evaluate["cases_per_image"]
            + evaluate["pair_cpu_s"] * split.pairs / split.test_images,
            split.test_images * evaluate["bytes_per_image"],
        ),
    }
    rows: dict[str, dict[str, Any]] = {}
    for stage, (unit, units, seconds, size) in maps.items():
        hours: dict[str, float | None] = {
            name: projection.map_hours(seconds, units, cores) for name, cores in MACHINES.items()
        }
        rows[stage] = {
            "unit": unit,
            "units": units,
            "seconds": seconds,
            "hours": hours | {"one GPU": None},
            "bytes": size,
        }
    for stage, model in (("train_ddf", "ddf"), ("train_pcsiren", "pcsiren")):
        rows[stage] = _training(stage, model, costs, step, gpu)
    return [{"stage": stage, **rows[stage]} for stage in run.STAGES]


def _cloud_bytes(cloud: Mapping[str, Any], split: projection.Split) -> int:
    sizes = (cloud["large"], cloud["small"], cloud["features"])
    return projection.bytes_of_clouds(*sizes, split.train_images, split.test_images)


def _training(
    stage: str, model: str, costs: Mapping[str, Any], step: Mapping[str, Any] | None, gpu: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Three trainings, one per category; PC-SIREN has as many parameters as the DDF, but for its last layer."""
    steps, count = costs["steps"][stage], len(projection.LINES)
    on_cpu, on_gpu = projection.find_step(step, model, "cpu"), projection.find_step(gpu, model, "cuda")
    hours: dict[str, float | None] = dict.fromkeys([*MACHINES, "one GPU"])
    if step is not None and on_cpu is not None:
        hours |= {
            name: projection.training_hours(on_cpu["median_s"], step["threads"], steps, count, cores)
            for name, cores in MACHINES.items()
        }
    if on_gpu is not None:
        hours["one GPU"] = projection.training_hours(on_gpu["median_s"], 1, steps, count, 1)
    return {
        "unit": "step",
        "units": steps * count,
        "seconds": None if on_cpu is None else on_cpu["median_s"],
        "hours": hours,
        "bytes": count * projection.bytes_of_training(costs["pointclouds"]["parameters"]),
    }


def page(record: Mapping[str, Any]) -> pages.Page:
    """Four tables, each with what it takes for granted."""
    lead = [
        f"Made by `python -m bench growth` on {measuring.cpu_name()}, {os.cpu_count()} CPU threads. Peak "
        "memory is what the kernel counted for the stage's process, and for the largest of its worker processes."
    ]
    sections = [_growth_section(record), _memory_section(record), _disk_section(record), _projection_section(record)]
    return pages.Page("Memory, disk and time against the number of shapes", lead, sections)


def _table(caption: str, header: Sequence[str], rows: Sequence[Sequence[str]], labels: int = 1) -> pages.Table:
    return pages.Table(caption, [("", len(header), False)], header, rows, labels=labels)


def _growth_section(record: Mapping[str, Any]) -> pages.Section:
    rows = []
    for stage in STAGES:
        cells = [stage]
        for key in ("peak_mib", "worker_peak_mib"):
            values = [record["growth"][str(size)][stage][key] for size in SIZES]
            known = all(values)  # 0 is no worker
            cells += [f"{value:,.0f}" if known else "–" for value in values]
            cells.append(f"{1024 * projection.slope(SIZES, values):+.0f}" if known else "–")
        rows.append(cells)
    sizes = [f"{size} shapes, MiB" for size in SIZES]
    header = ["stage", *sizes, "KiB a shape", *[f"worker, {size}" for size in sizes], "KiB a shape"]
    caption = (
        f"Every stage as `make` runs it, on synthetic chairs in shards of {SHARD_SIZE}, with small sizes (fewer "
        "samples, points, views and steps) so that it takes a minute or two."
    )
    cloud, most = record["costs"]["pointclouds"], max(test for _, test in projection.LINES.values())
    held = projection.bytes_of_ddf_clouds(cloud["large"], cloud["small"])
    note = (
        "What no shard limits: `pointclouds` holds the predicted clouds of one category until all are there, and "
        "`evaluate` reads them beside the true ones. Of the DDF, at the sizes of configs/paper.yaml, they take "
        f"{held / 2**10:.0f} KiB an image, {held * most / GIB:.1f} GiB for the {most:,} test images of the largest "
        "category. Decoded images are read from a mapped file, whose pages count here and go when memory is short: 4 "
        "size² bytes each."
    )
    return pages.Section(f"From {SIZES[0]} to {SIZES[1]} shapes", [_table(caption, header, rows), note])


def _memory_section(record: Mapping[str, Any]) -> pages.Section:
    title = "Memory of the reference run"
    if not record["reference_memory"]:
        return pages.Section(title, ["Not measured: artifacts/cpu has no notes of memory (`make reproduce-table`)."])
    rows = []
    for stage, note in record["reference_memory"].items():
        most = note["peak_mib"] + record["workers"] * note["worker_peak_mib"]
        verdict = "yes" if most <= LIMIT_MIB else "no"
        worker = f"{note['worker_peak_mib']:,.0f}" if note["worker_peak_mib"] else "–"
        rows.append([stage, f"{note['peak_mib']:,.0f}", worker, f"{most:,.0f}", verdict])
    header = ["stage", "process, MiB", "worker, MiB", "together at most, MiB", "≤ 4 GiB"]
    caption = (
        f"cpu.yaml, the largest of its categories. Together: the process and {record['workers']} workers, as if "
        "all had their peaks at once and shared no page, which they do."
    )
    return pages.Section(title, [_table(caption, header, rows)])


def _disk_section(record: Mapping[str, Any]) -> pages.Section:
    title = "Disk of the reference run"
    if not record["reference_disk"]:
        return pages.Section(title, ["Not measured: there is no artifacts/cpu (`make reproduce-table`)."])
    rows = [
        [
            row["what"],
            f"{row['bytes'] / 2**20:.1f}",
            str(row["files"]),
            f"{row['bytes'] / row['units'] / 1024:,.1f}",
            row["unit"],
        ]
        for row in record["reference_disk"]
    ]
    header = ["artefact", "MiB", "files", "KiB", "for each"]
    return pages.Section(title, [_table("cpu.yaml, all categories.", header, rows)])


def _projection_section(record: Mapping[str, Any]) -> pages.Section:
    machines = [*MACHINES, "one GPU"]
    rows = [
        [
            row["stage"],
            f"{row['units']:,}",
            row["unit"],
            _number(row["seconds"]),
            *(_number(row["hours"][name]) for name in machines),
            _number(row["bytes"] / GIB),
        ]
        for row in record["projection"]
    ]
    maps = [row for row in record["projection"] if row["unit"] != "step"]
    for title, parts in (("without the trainings", maps), ("together", record["projection"])):
        totals = [projection.together([row["hours"][name] for row in parts]) for name in machines]
        size = sum(row["bytes"] for row in parts)
        rows.append([title, "", "", "", *map(_number, totals), _number(size / GIB)])
    header = ["stage", "units", "unit", "s a unit", *(f"hours, {name}" for name in machines), "GiB"]
    split, evaluate = projection.Split.of(projection.LINES), record["costs"]["evaluate"]
    no_gpu = all(row["hours"]["one GPU"] is None for row in record["projection"])
    caption = (
        f"configs/paper.yaml on the {split.shapes:,} chairs, planes and cars of ShapeNet v1: {split.train_images:,} "
        f"training and {split.test_images:,} test images, the lines of the lists of the Pixel2Mesh split. One stage "
        "after another."
    )
    assumed = (
        "Meshes, samples, clouds and scores: CPU seconds measured on synthetic shapes (one of each category), taken to "
        "be linear in units and cores. ShapeNet's meshes differ; one of millions of triangles costs more.",
        f"A cloud: a DDF of full size with random weights, {record['costs']['pointclouds']['large']:,} points "
        "extrapolated from few, and all steps of the correction from few.",
        f"Evaluation: {evaluate['cases_per_image']:.0f} comparisons per image of "
        f"{1e3 * evaluate['case_cpu_s']:.1f} ms, and the oracle row's {split.pairs:,} pairs of a test and a "
        f"training shape of {1e3 * evaluate['pair_cpu_s']:.1f} ms: the one cost that grows with the square of "
        "the shapes.",
        "Trainings: the measured step (reports/bench/full_size_step.json) times the steps of paper.yaml, three "
        "categories; on 64 cores side by side, none faster than it was measured.",
        "Disk: arrays as written, without the data set itself, which is only checked; trainings as model and "
        "checkpoint in float32.",
        *(["One GPU: no stage was measured on one."] if no_gpu else ["One GPU: of all stages the trainings alone."]),
    )
    return pages.Section("Projection to the published setting", [_table(caption, header, rows), assumed])


def _number(value: float | None) -> str:
    """Two digits, or as many as stand before the point."""
    if value is None:
        return "not measured"
    return f"{value:,.0f}" if value >= 10 else f"{value:.2g}"


def _gpu_steps() -> dict[str, Any] | None:
    """Rows of steps on one GPU, float32 first."""
    record = _read(GPU)
    return None if record is None else {"rows": record["steps"]}


def _line(what: str, value: Any) -> dict[str, Any]:
    """A finding as the row of a benchmark that times nothing."""
    return {"what": what, "size": {}, "error": {}, "found": value}


SECTION = display.Section(elsewhere="../growth.md")


def main() -> None:
    """Measure and write both files."""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with futures.ThreadPoolExecutor(len(SIZES)) as pool:
            notes = pool.map(functools.partial(run_stages, folder), SIZES)
            growth = {str(size): note for size, note in zip(SIZES, notes, strict=True)}
        evaluated = folder / "artifacts" / f"growth{SIZES[-1]}" / "evaluate"
        cases, images = _counts(evaluated / "per_image.csv")
        size = sum(path.stat().st_size for path in evaluated.iterdir())
        artifacts = ROOT / "artifacts" / "cpu"
        memory, disk = reference_memory(artifacts), reference_disk(artifacts)
        costs = paper_costs(folder, {"cases_per_image": cases / images, "bytes_per_image": size / images})
        os.chdir(ROOT)
    found = {
        "workers": workers(),
        "growth": growth,
        "reference_memory": memory,
        "reference_disk": disk,
        "costs": costs,
        "projection": project(costs, _read(STEP), _gpu_steps()),
    }
    measuring.write("growth", os.cpu_count() or 1, [_line(what, value) for what, value in found.items()])
    out = measuring.PAGES / "growth.md"
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(pages.markdown(page(found)), encoding="utf-8")
    print(f"{out}: {time.perf_counter() - started:.0f} s")
