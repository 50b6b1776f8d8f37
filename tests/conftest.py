"""Shape checks at run time, the folder of real meshes, and one way to compare arrays."""

import functools
import os
from pathlib import Path
from typing import Any

import jaxtyping
import pytest

# Before any test imports the package: annotations such as Float[Tensor, "n 3"] are then checked in every call.
jaxtyping.install_import_hook("ddf", "beartype.beartype")

os.environ.setdefault("OMP_NUM_THREADS", "1")  # of the processes that tests start: the cores have their workers

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """The folder beside the repository with real meshes and lists; tests that need it are marked `real`."""
    folder = ROOT.parent / "shared"
    if not (folder / "meshes").is_dir():
        pytest.skip("../shared/meshes is not there")
    return folder


@pytest.fixture
def few_hits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Distances of a field are measured to a tenth of the usual hits, which take ten seconds to draw."""
    from ddf.fields import checked_cloud

    monkeypatch.setattr(checked_cloud, "draw", functools.partial(checked_cloud.draw, count=checked_cloud.COUNT // 10))


@pytest.fixture
def quick_completion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scans are completed in a second, and badly."""
    from ddf.fit import completion

    quick = completion.CompletionConfig(rays=100, draws=8, starts=1, kept=1, axes=8, steps=4, samples=4)
    monkeypatch.setattr(completion, "CompletionConfig", lambda: quick)


@pytest.fixture(params=["float32", "float64"])
def dtype(request: pytest.FixtureRequest):
    """The two types of numbers in which hard inputs are tried."""
    import torch

    return getattr(torch, request.param)


def pytest_configure(config: pytest.Config) -> None:
    import torch

    torch.set_num_threads(1)  # predictable on shared machines; the tests are small


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: "/examples/" not in item.nodeid)  # the file that takes longest comes first


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Of `-m faults`, how many are noticed, by room."""
    rooms: dict[str, list[bool]] = {}
    for outcome in ("passed", "failed"):
        for report in terminalreporter.stats.get(outcome, []):
            if (name := report.nodeid.partition("test_a_fault_is_noticed[")[2]) and report.when == "call":
                rooms.setdefault(name.partition(":")[0], []).append(outcome == "passed")
    for room, noticed in sorted(rooms.items()):
        terminalreporter.write_line(f"{room}: {sum(noticed)} of {len(noticed)} faults noticed")
