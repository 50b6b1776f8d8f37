"""`ddf doctor`: what this machine has, what is missing and the command for it. Imports nothing that may be missing."""

import importlib
import importlib.util
import os
import platform
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ddf.cli.declare import command
from ddf.core import extras

LIBRARIES = {  # that packages load at import, and the Debian packages that bring them
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
}
COMMANDS = {"make": "make", "flock": "util-linux", "git": "git"}  # that `make` runs, and the packages that bring them
MIN_DISK_GIB, MIN_MEMORY_GIB = 5.0, 4.0
_LARGE = ("torch", "torchvision", "open3d", "pymeshlab")
_COSTS = {"onnx": "ONNX files, 100 MB", "las": "clouds as LAS files, 1 MB"} | extras.COSTS
_EXTRA_OF = extras.EXTRA_OF | {"onnx": "onnx", "onnxruntime": "onnx"}  # which torch brings too
_LOCK = Path(__file__).resolve().parents[3] / "requirements.lock"
_CHECKOUT = _LOCK.is_file()  # `make setup` brings all there; elsewhere extras are a choice


@command("experiment")
def doctor(*, fast: bool = False) -> dict[str, Any]:
    """What this machine has, what is missing and the command for it.

    Args:
      fast: do not try to import the large packages.

    Examples:
      ddf doctor --fast
      ddf doctor
    """
    import ctypes

    missing: list[dict[str, str]] = []

    def lacks(is_missing: object, what: str, command: str) -> None:
        if is_missing:
            missing.append({"what": what, "command": command})

    setup = "make setup" if _CHECKOUT else f"pip install {extras.DISTRIBUTION}"
    packages, wrong = _packages()
    lacks(wrong, f"packages: {', '.join(wrong)}", setup)
    libraries = {name: _loaded(ctypes.CDLL, name) for name in LIBRARIES}
    absent = " ".join(LIBRARIES[name] for name, found in libraries.items() if found != "ok")
    needed = _CHECKOUT or _is_there("open3d")  # which loads them
    lacks(absent and needed, f"system libraries: {absent}", f"sudo apt-get install {absent}")
    for name, package in COMMANDS.items():
        lacks(_CHECKOUT and shutil.which(name) is None, f"command {name}", f"sudo apt-get install {package}")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    disk = shutil.disk_usage(Path.cwd()).free / 2**30
    for what, gib, least in (("memory", memory, MIN_MEMORY_GIB), ("disk", disk, MIN_DISK_GIB)):
        lacks(_CHECKOUT and gib < least, f"{what}: {gib:.1f} GiB, {least:g} needed", "use a larger machine")
    what = f"Python 3.11, 3.12 or 3.13 (this is {platform.python_version()})"
    lacks(not (3, 11) <= sys.version_info[:2] <= (3, 13), what, setup + " PYTHON=python3.11" * _CHECKOUT)
    imports = {} if fast else {name: _loaded(importlib.import_module, name) for name in _LARGE}
    for name, found in imports.items():
        lacks(found != "ok" and _is_there(name), f"{name} does not load: {found}", setup)
    result: dict[str, Any] = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": packages,
        "libraries": libraries,
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(memory, 1),
        "disk_free_gib": round(disk, 1),
        "extras": {extra: all(_is_there(name) for name, of in _EXTRA_OF.items() if of == extra) for extra in _COSTS},
        "imports": imports,
        "gpu": _gpu() if imports.get("torch") == "ok" else None,
        "missing": missing,
        "ok": not missing,
    }
    verdict = "see MISSING above" if missing else "all is there"
    return result | {"table": _table(result), "verdict": verdict, "doubtful": bool(missing)}


def _packages() -> tuple[dict[str, str | None], list[str]]:
    """Versions of the pinned packages, without requirements.lock of the package's own; and which are wrong."""
    import importlib.metadata  # takes long, and other commands do without

    if _CHECKOUT:
        pins = dict(re.findall(r"(?m)^([A-Za-z0-9._-]+)==(\S+)$", _LOCK.read_text()))
    else:
        try:
            every = importlib.metadata.requires(extras.DISTRIBUTION) or []
        except importlib.metadata.PackageNotFoundError:  # a copy of the files
            every = []
        needed = [item for item in every if "extra ==" not in item]
        pins = {re.split(r"[^\w.-]", item)[0]: None for item in needed}
    found: dict[str, str | None] = {}
    for name in pins:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
    wrong = [name for name, pin in pins.items() if found[name] is None or pin not in (None, found[name])]
    return found, [f"{name} {pins[name] or ''} (is {found[name] or 'absent'})" for name in wrong]


def _is_there(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


def _loaded(load: Callable[[str], object], name: str) -> str:
    """`ok` where a library or a package loads, else why not: what a package misses of the system shows only then."""
    try:
        load(name)
    except (ImportError, OSError) as error:
        return " ".join(str(error).split())
    return "ok"


def _gpu() -> str | None:
    import torch

    return torch.cuda.get_device_name(0) if torch.cuda.is_available() else None


def _table(result: dict[str, Any]) -> dict[str, Any]:
    versions = result["packages"].values()
    choices = {name: (_COSTS[name], extras.command(name)) for name in result["extras"] if not _CHECKOUT}
    there = {True: "installed", False: "not installed; a choice"}
    return {
        "Python": f"{result['python']} on {result['platform']}",
        "cores": result["cores"],
        "memory": f"{result['memory_gib']} GiB; {result['disk_free_gib']} GiB of disk free here",
        "GPU": result["gpu"] or "none (not needed)",
        "packages": f"{sum(version is not None for version in versions)} of {len(versions)} installed",
        "libraries": f"{sum(found == 'ok' for found in result['libraries'].values())} of {len(LIBRARIES)} found",
        **{f"extra {n}": f"{cost}; {there[result['extras'][n]]}: {how}" for n, (cost, how) in choices.items()},
        **{f"MISSING {i}": f"{each['what']}: {each['command']}" for i, each in enumerate(result["missing"], 1)},
    }
