"""One GPU: steps of both models, rays of a field, a cloud and casts on meshes at full size, each against the CPU.

Steps are those of configs/paper.yaml on random data, in float32, tf32 and bfloat16: medians of whole steps, parts timed
apart (each then waits for the device), kernels and their time, peak memory. Errors are against float64 (fields) and
against the same step on the CPU in float32 (loss, gradients). Needs torch, numpy and safetensors, and what
reads the config; none of the packages that handle meshes. Writes reports/gpu/check.json and check.md.
"""

import argparse
import json
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from bench.gpu import casts, parity, rates, sizes
from bench.lib import display, measuring
from ddf.core import checks
from ddf_lab.report import pages

ON_DEMAND = "python -m bench gpu_check, with a GPU"
OUT = measuring.PAGES / "gpu"
TITLE = "One GPU"
PARTS = ("data", "encoders", "field", "mask", "other", "backward", "optimiser")


def machine(device: str) -> dict[str, Any]:
    """What it was measured on."""
    found = {"cpu": measuring.cpu_name(), "python": platform.python_version(), "torch": torch.__version__}
    found["threads"] = torch.get_num_threads()
    if device == "cuda":
        memory = torch.cuda.get_device_properties(0).total_memory / 2**30
        found |= {"gpu": torch.cuda.get_device_name(0), "gpu_gib": round(memory, 1), "cuda": torch.version.cuda}
    return found


def page(record: Mapping[str, Any]) -> pages.Page:
    """What was measured, a section each."""
    told = record["machine"]
    names = "; ".join(f"{name} {value}" for name, value in told.items())
    where = told.get("gpu", "the CPU alone")
    lead = [f"Made by `python -m bench gpu_check` on {where}, in {record['took_s']:.0f} s. {names}."]
    builders: dict[str, Callable[[Sequence[Mapping[str, Any]]], pages.Section]] = {
        "steps": _steps, "fields": _fields, "clouds": _clouds, "casts": _casts, "parity": _parity
    }  # fmt: skip
    return pages.Page(TITLE, lead, [build(record[name]) for name, build in builders.items() if name in record])


def _ms(seconds: float | None) -> str:
    return "–" if seconds is None else display.number(1e3 * seconds)


def _table(caption: str, header: Sequence[str], lines: Sequence[Sequence[str]]) -> pages.Table:
    return pages.Table(caption, [("", len(header), False)], header, lines)


def _steps(rows: Sequence[Mapping[str, Any]]) -> pages.Section:
    whole = [
        [
            row["what"],
            _ms(row["median_s"]),
            " – ".join(map(_ms, row["quartiles_s"])),
            f"{row['kernels']:,}",
            _ms(row["busy_s"]),
            "–" if row["peak_gib"] is None else f"{row['peak_gib']:.2f}",
        ]
        for row in rows
    ]
    parts = [[row["what"], *(_ms(row["parts_s"].get(part)) for part in PARTS)] for row in rows]
    size = rows[0]["size"]
    caption = f"{size['images']} images a step. Busy: all kernels of one step together."
    return pages.Section(
        "Steps",
        [
            _table(caption, ["", "ms", "q1 – q3", "kernels", "busy, ms", "peak, GiB"], whole),
            _table("Parts, ms: each waits for the device, so that together they take longer.", ["", *PARTS], parts),
        ],
    )


def _fields(rows: Sequence[Mapping[str, Any]]) -> pages.Section:
    lines = [
        [
            row["what"],
            display.number(row["million_rays_per_s"]),
            display.number(row["error"]["depth_median"]),
            display.number(row["error"]["visibility_mean"]),
        ]
        for row in rows
    ]
    header = ["", "million rays/s", "depth, median error", "visibility, mean error"]
    caption = f"Visibility and depth of {rows[0]['size']['rays']:,} rays, random weights; errors against float64."
    return pages.Section("Fields", [_table(caption, header, lines)])


def _clouds(rows: Sequence[Mapping[str, Any]]) -> pages.Section:
    size = rows[0]["size"]
    caption = f"{size['points']:,} points, n_v {size['num_directions']}, N_H {size['cycles']}, random weights."
    lines = [[row["what"], _ms(row["median_s"]), f"{row['kernels']:,}", _ms(row["busy_s"])] for row in rows]
    return pages.Section("Clouds", [_table(caption, ["", "ms", "kernels", "busy, ms"], lines)])


def _casts(rows: Sequence[Mapping[str, Any]]) -> pages.Section:
    lines = [
        [
            row["what"],
            _ms(row["median_s"]),
            display.number(row["billion_tests_per_s"]),
            f"{row['error']['other_hits']:,}",
            f"{row['error']['depth_max']:.2g}",
        ]
        for row in rows
    ]
    size = rows[0]["size"]
    caption = (
        f"{size['rays']:,} rays on each of {size['meshes']} meshes of {size['triangles']:,} triangles. Other hits and "
        f"the largest error of a depth: of {size['checked']} rays, against float64."
    )
    header = ["", "ms", "billion rays x triangles a second", "other hits", "depth, largest error"]
    return pages.Section("Casts", [_table(caption, header, lines)])


def _parity(rows: Sequence[Mapping[str, Any]]) -> pages.Section:
    names = list(dict.fromkeys(name for row in rows for name in row["error"]))
    lines = [
        [
            f"{row['what']}, {row['size']['device']}",
            *(f"{row['error'][name]:.3g}" if name in row["error"] else "–" for name in names),
        ]
        for row in rows
    ]
    caption = "Against the CPU in float32, from the same weights and data."
    return pages.Section("Against the CPU", [_table(caption, ["", *map(display.title, names)], lines)])


def check(how: sizes.Sizes, device: str, out: Path) -> None:
    """Measure everything; both files are written after every section, so that a stopped check leaves what it has."""
    started = time.perf_counter()
    record: dict[str, Any] = {"machine": machine(device)}
    with parity.placed(device):
        sections: dict[str, Callable[[], list[dict[str, Any]]]] = {
            "steps": lambda: rates.step_rows(how),
            "fields": lambda: rates.field_rows(how),
            "clouds": lambda: rates.cloud_rows(how),
            "casts": lambda: casts.rows(how, device),
            "parity": lambda: parity.rows(how, device),
        }
        out.mkdir(parents=True, exist_ok=True)
        for name, measure in sections.items():
            record[name] = measure()
            record["took_s"] = round(time.perf_counter() - started, 1)
            (out / "check.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
            (out / "check.md").write_text(pages.markdown(page(record)), encoding="utf-8")
            print(f"{name}: {record['took_s']:.0f} s", flush=True)
    print(out / "check.md")


def main(given: Sequence[str]) -> None:
    """Measure and write; without a GPU one line says so."""
    parser = argparse.ArgumentParser("python -m bench gpu_check", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--device", choices=("cuda", "cpu"), default="cuda", help="cpu: to try the check itself")
    parser.add_argument("--tiny", action="store_true", help="sizes of no meaning, in seconds")
    parser.add_argument("--out", type=Path, default=OUT, help="folder (default: %(default)s)")
    arguments = parser.parse_args(given)
    if arguments.device == "cuda" and not torch.cuda.is_available():
        raise checks.InputError(
            f"torch {torch.__version__} finds no CUDA device; `--device cpu --tiny` tries the check without one"
        )
    check(sizes.tiny() if arguments.tiny else sizes.full(), arguments.device, arguments.out)
