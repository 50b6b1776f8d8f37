"""One GPU: steps of both models, rays of a field and a cloud at the paper's size, each against the CPU.

Steps are those of configs/paper.yaml on random data, in float32 and tf32: medians of whole steps, kernels and
their time, peak memory. Errors are against float64 (fields) and against the same step or cloud on the CPU in float32
(loss, gradients, hits). Needs torch, numpy and safetensors, and what reads the config; none of the packages that handle
meshes. Writes reports/gpu/check.json and check.md.
"""

import argparse
import contextlib
import copy
import dataclasses
import json
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args
from unittest import mock

import torch
from torch import Tensor
from torch.nn import functional
from torch.profiler import ProfilerActivity, profile

from bench.gpu import trial
from bench.lib import measuring
from ddf.core import checks
from ddf.data.batches import resident
from ddf.fields import cloud_projection, model_files, passes, pddf
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.training import training_loop
from ddf_lab.report import pages

ON_DEMAND = "python -m bench gpu_check, with a GPU"
OUT = measuring.PAGES / "gpu"
WARM_UP, CHECKED = 3, 8192  # calls before the timed ones; rays whose error is taken
CLOUD = {"num_directions": 16, "cycles": 3}  # n_v and N_H of the timed cloud
Precision = Literal["float32", "tf32"]
PRECISIONS: tuple[Precision, ...] = get_args(Precision)
WITHOUT: dict[str, Callable[[], contextlib.AbstractContextManager[Any]]] = {
    "data on the device": lambda: mock.patch.object(resident, "room", lambda device: 0),
    "compiled passes": lambda: mock.patch.object(passes, "compiles", lambda device: False),
}
Gradients = dict[str, Tensor]  # float64, on the CPU, by parameter


@dataclass(frozen=True)
class Sizes:
    """Sections of an experiment, and how much of everything is measured.

    fields: hidden layers of the fields whose rays are timed, by name. compared_images: of the step that is made on the
    CPU too.
    """

    train: reconstruction_settings.TrainConfig
    ddf: reconstruction_settings.DDFConfig
    pcsiren: reconstruction_settings.PCSirenConfig
    cloud: cloud_projection.CloudConfig
    fields: dict[str, tuple[int, ...]]
    rays: int = 2**20
    cloud_points: int = 5000
    repeats: int = 8
    compared_images: int = 2

    @property
    def sections(self) -> dict[str, trial.Section]:
        """Of both models by name."""
        return {"ddf": self.ddf, "pcsiren": self.pcsiren}


def full() -> Sizes:
    """Of configs/paper.yaml, with a cloud of fewer directions."""
    train = reconstruction_settings.TrainConfig()
    ddf, pcsiren = reconstruction_settings.DDFConfig(), reconstruction_settings.PCSirenConfig()
    cloud = dataclasses.replace(reconstruction_settings.PointcloudsConfig().cloud, **CLOUD)
    return Sizes(train, ddf, pcsiren, cloud, {"paper's widths": train.decoder.hidden, "4 x 192": (192,) * 4})


def tiny() -> Sizes:
    """The same in seconds on a CPU; its figures say nothing."""
    whole, hidden = full(), (16, 12)
    loop, decoder = (
        dataclasses.replace(whole.train.loop, threads=1),
        dataclasses.replace(whole.train.decoder, hidden=hidden),
    )
    train = dataclasses.replace(
        whole.train, image_size=32, encoder_width=4, latent_features=6, batch_size=2, decoder=decoder, loop=loop
    )
    ddf = dataclasses.replace(whole.ddf, counts=dict.fromkeys(whole.ddf.counts, 6), mask_size=8)
    pcsiren = dataclasses.replace(whole.pcsiren, points=20, truth_points=20)
    cloud = dataclasses.replace(whole.cloud, num_directions=4, cycles=2)
    return Sizes(train, ddf, pcsiren, cloud, {"tiny": hidden}, rays=256, cloud_points=50, repeats=2)


@contextlib.contextmanager
def placed(device: str) -> Iterator[None]:
    """While this lasts, the package works on this device."""
    try:
        with mock.patch.object(model_files, "device", lambda: torch.device(device)):
            yield
    finally:
        torch.use_deterministic_algorithms(False)  # a training on the CPU asks for them; cuBLAS then refuses to work


def seconds_of(work: Callable[[], object], repeats: int) -> list[float]:
    """Of calls in turn, each until the device is done."""
    found = []
    for call in range(WARM_UP + repeats):
        started = trial.now()
        work()
        if call >= WARM_UP:
            found.append(trial.now() - started)
    return found


def on_device(work: Callable[[], object]) -> dict[str, float]:
    """Kernels that one call launches (on a CPU, operators), and the seconds that they take together."""
    cuda = model_files.device().type == "cuda"
    with profile(activities=[ProfilerActivity.CUDA if cuda else ProfilerActivity.CPU]) as profiled:
        work()
        trial.now()
    events = [e for e in profiled.events() or [] if e.device_type.name == ("CUDA" if cuda else "CPU")]
    return {"kernels": len(events), "busy_s": sum(event.time_range.elapsed_us() for event in events) / 1e6}


def step_rows(sizes: Sizes) -> list[dict[str, Any]]:
    """A row per model and precision, then the DDF without what a GPU has of its own."""
    rows = [_step_row(name, precision, sizes) for name in sizes.sections for precision in PRECISIONS]
    for without, switched_off in WITHOUT.items():
        with switched_off():
            row = _step_row("ddf", "tf32", sizes)
        rows.append({**row, "what": f"{row['what']}, without {without}"})
    return rows


def _step_row(name: str, precision: Precision, sizes: Sizes) -> dict[str, Any]:
    loop = dataclasses.replace(sizes.train.loop, matmul=precision)
    train = dataclasses.replace(sizes.train, loop=loop)
    training_loop.prepare(loop)
    tried = trial.trial(train, sizes.sections[name])
    losses, numbers = [], iter(range(10**9))

    def step() -> None:
        losses.append(tried.backward(next(numbers)))
        tried.optimiser.step()

    cuda = model_files.device().type == "cuda"
    if cuda:
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats()
    whole = seconds_of(step, sizes.repeats)
    peak = torch.cuda.max_memory_allocated() / 2**30 if cuda else None
    size = {"images": train.batch_size, "parameters": pddf.count_parameters(tried.model)}
    row = measuring.row(f"{name} step, {precision}", size | {"device": model_files.device().type}, whole, {})
    return {**row, "loss": float(losses[-1]), "peak_gib": peak, **on_device(step)}


def field_rows(sizes: Sizes) -> list[dict[str, Any]]:
    """A row per field and precision: rays a second of visibility and depth, with the error against float64."""
    rows = []
    for name, hidden in sizes.fields.items():
        torch.manual_seed(0)
        decoder = dataclasses.replace(sizes.train.decoder, hidden=hidden)
        field = pddf.PDDF(sizes.ddf.field.of(decoder)).requires_grad_(False)
        exact = _answer(field.double(), *random_rays(CHECKED, torch.float64, torch.device("cpu")))
        for precision in PRECISIONS:
            torch.set_float32_matmul_precision("high" if precision == "tf32" else "highest")
            dtype, place = torch.float32, model_files.device()
            own, rays = copy.deepcopy(field).to(place, dtype), random_rays(sizes.rays, dtype, place)
            seconds = seconds_of(lambda own=own, rays=rays: _answer(own, *rays), sizes.repeats)
            found = _answer(own, *random_rays(CHECKED, dtype, place))
            off = [(a.cpu().double() - b).abs() for a, b in zip(found, exact, strict=True)]
            error = {"visibility_mean": float(off[0].mean()), "depth_median": float(off[1].median())}
            size = {"rays": sizes.rays, "hidden": list(hidden), "device": place.type}
            row = measuring.row(f"field, {name}, {precision}", size, seconds, error)
            rows.append({**row, "million_rays_per_s": sizes.rays / row["median_s"] / 1e6})
    return rows


@torch.inference_mode()
def _answer(field: pddf.PDDF, positions: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
    raw = field(positions, directions, None)
    return pddf.visibility(raw), field.depth(raw)


def random_rays(count: int, dtype: torch.dtype, place: torch.device) -> tuple[Tensor, Tensor]:
    """Positions uniform in the box, directions on the sphere: the same whatever type and device."""
    random = torch.Generator().manual_seed(0)
    drawn = torch.randn((count, 6), generator=random, dtype=torch.float64)
    positions, directions = torch.special.ndtr(drawn[:, :3]) * 2 - 1, functional.normalize(drawn[:, 3:], dim=-1)
    return positions.to(place, dtype), directions.to(place, dtype)


def cloud_rows(sizes: Sizes) -> list[dict[str, Any]]:
    """A whole cloud of a field with random weights: projection of all cycles, and the choice of the points."""
    training_loop.prepare(sizes.train.loop)
    torch.manual_seed(0)
    model = reconstruction_models.DDFModel(sizes.train, sizes.ddf.field).to(model_files.device()).eval()
    with torch.no_grad():
        latents = torch.zeros((1, sizes.train.latent_features), device=model_files.device())
        modulations = [values[0] for values in model.modulations(latents)]
    generator = torch.Generator(model_files.device()).manual_seed(0)

    def draw() -> None:
        cycles = cloud_projection.sample(model.field, modulations, sizes.cloud_points, sizes.cloud, generator)
        cloud_projection.select(cycles, [sizes.cloud_points], sizes.cloud)

    size = {"points": sizes.cloud_points, "device": model_files.device().type}
    return [{**measuring.row("cloud", size, seconds_of(draw, sizes.repeats), {}), **on_device(draw)}]


def gradients(sizes: Sizes, model: str, device: str, precision: Precision) -> tuple[float, Gradients]:
    """Loss and gradients of the first step with few images, from the same weights and data on every device."""
    loop = dataclasses.replace(sizes.train.loop, matmul=precision)
    train = dataclasses.replace(sizes.train, batch_size=sizes.compared_images, loop=loop)
    with placed(device):
        training_loop.prepare(loop)
        tried = trial.trial(train, sizes.sections[model])
        loss = tried.backward(0)
        found = {name: p.grad for name, p in tried.model.named_parameters() if p.grad is not None}
        return float(loss), {name: grad.detach().cpu().double() for name, grad in found.items()}


def differences(own: tuple[float, Gradients], truth: tuple[float, Gradients]) -> dict[str, float]:
    """Relative difference of the losses and of all gradients together, their cosine, the worst parameter's difference.

    Raises:
      ValueError: the gradients are not of the same parameters.
    """
    (loss, mine), (exact, theirs) = own, truth
    if mine.keys() != theirs.keys():
        raise ValueError(f"gradients of other parameters: {sorted(mine.keys() ^ theirs.keys())}")
    both = [torch.cat([each[name].flatten() for name in theirs]) for each in (mine, theirs)]
    apart = {name: float((mine[name] - theirs[name]).norm()) for name in theirs}
    largest = {name: max(float(theirs[name].norm()), 1e-6 * float(both[1].norm())) for name in theirs}
    return {
        "loss_relative": abs(loss - exact) / abs(exact),
        "gradient_relative": float((both[0] - both[1]).norm() / both[1].norm()),
        "gradient_cosine": float(functional.cosine_similarity(*both, dim=0)),
        "worst_parameter_relative": max(apart[name] / largest[name] for name in theirs),
    }


@contextlib.contextmanager
def drawn_on_the_cpu() -> Iterator[None]:
    """While this lasts, torch draws with a generator of the CPU for every device: the same numbers on all."""

    def moved(draw: Any) -> Any:
        return lambda *size, generator, dtype, device: draw(*size, generator=generator, dtype=dtype).to(device)

    with contextlib.ExitStack() as stack:
        for name in ("rand", "randn"):
            stack.enter_context(mock.patch.object(torch, name, moved(getattr(torch, name))))
        yield


def hits(sizes: Sizes, device: str) -> Tensor:
    """Of the first cycle of a cloud of a plain field with random weights; float64, on the CPU."""
    torch.manual_seed(0)
    field = pddf.PDDF(sizes.ddf.field.of(sizes.train.decoder)).requires_grad_(False).to(device)
    with drawn_on_the_cpu():
        generator = torch.Generator().manual_seed(0)
        cycle, *_ = cloud_projection.sample(field, None, sizes.cloud_points, sizes.cloud, generator)
    return cycle.points.cpu().double()


def parity_rows(sizes: Sizes, device: str) -> list[dict[str, Any]]:
    """Errors of the device against the CPU in float32, without times."""
    found = []
    for model in sizes.sections:
        truth = gradients(sizes, model, "cpu", "float32")
        for precision in PRECISIONS:
            error = differences(gradients(sizes, model, device, precision), truth)
            size = {"images": sizes.compared_images, "device": device}
            found.append({"what": f"{model} gradients, {precision}", "size": size, "error": error})
    training_loop.prepare(sizes.train.loop)
    off = (hits(sizes, device) - hits(sizes, "cpu")).norm(dim=-1)
    error = {"hit_median": float(off.median()), "hit_q99": float(off.quantile(0.99))}
    found.append({"what": "hits of a cloud", "size": {"points": len(off), "device": device}, "error": error})
    return found


def machine(device: str) -> dict[str, Any]:
    """What it was measured on."""
    found = {"cpu": measuring.cpu_name(), "python": platform.python_version(), "torch": torch.__version__}
    found["threads"] = torch.get_num_threads()
    if device == "cuda":
        memory = torch.cuda.get_device_properties(0).total_memory / 2**30
        found |= {"gpu": torch.cuda.get_device_name(0), "gpu_gib": round(memory, 1), "cuda": torch.version.cuda}
    return found


def page(record: Mapping[str, Any]) -> pages.Page:
    """A table of each kind of rows that is there: what was measured, milliseconds, and every other number."""
    told = record["machine"]
    names = "; ".join(f"{name} {value}" for name, value in told.items())
    lead = f"Made by `python -m bench gpu_check` on {told.get('gpu', 'the CPU alone')}, in {record['took_s']:.0f} s."
    sections = [_section(name, rows) for name, rows in record.items() if isinstance(rows, list)]
    return pages.Page("One GPU", [f"{lead} {names}."], sections)


def _section(name: str, rows: Sequence[Mapping[str, Any]]) -> pages.Section:
    numbers = [
        {"ms": 1e3 * row["median_s"] if "median_s" in row else None}
        | {
            key: value
            for key, value in row.items()
            if isinstance(value, float | int) and key not in ("median_s", "samples")
        }
        | row["error"]
        for row in rows
    ]
    header = [
        key
        for key in dict.fromkeys(key for each in numbers for key in each)
        if any(e.get(key) is not None for e in numbers)
    ]
    lines = [
        [
            f"{row['what']}, {row['size']['device']}",
            *("–" if each.get(key) is None else measuring.number(each[key]) for key in header),
        ]
        for row, each in zip(rows, numbers, strict=True)
    ]
    titles = ["", *map(measuring.title, header)]
    return pages.Section(name.capitalize(), [pages.Table("Medians.", titles, lines)])


def check(how: Sizes, device: str, out: Path) -> None:
    """Measure everything; both files are written after every section, so that a stopped check leaves what it has."""
    started = time.perf_counter()
    record: dict[str, Any] = {"machine": machine(device)}
    sections: dict[str, Callable[[], list[dict[str, Any]]]] = {
        "steps": lambda: step_rows(how),
        "fields": lambda: field_rows(how),
        "clouds": lambda: cloud_rows(how),
        "parity": lambda: parity_rows(how, device),
    }
    out.mkdir(parents=True, exist_ok=True)
    with placed(device):
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
    check(tiny() if arguments.tiny else full(), arguments.device, arguments.out)
