"""`ddf doctor`: what this machine has, what is missing and the command for it. Imports nothing that may be missing."""

import importlib
import importlib.util
import os
import platform
import re
import shutil
import sys
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
CPU_FLAGS = ("avx2", "fma", "avx512f", "avx512_bf16", "amx_bf16")  # that numerical libraries choose their code by
MIN_DISK_GIB, MIN_MEMORY_GIB = 5.0, 4.0
_LARGE = ("torch", "torchvision", "open3d", "pymeshlab")
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
    missing: list[dict[str, str]] = []

    def lacks(what: str, command: str) -> None:
        missing.append({"what": what, "command": command})

    setup = "make setup" if _CHECKOUT else f"pip install {extras.DISTRIBUTION}"
    packages, wrong = _packages()
    if wrong:
        lacks(f"packages: {', '.join(wrong)}", setup)
    libraries = {name: _loads(name) for name in LIBRARIES}
    absent = [LIBRARIES[name] for name, there in libraries.items() if not there]
    if absent and (_CHECKOUT or _is_there("open3d")):  # which loads them
        lacks(f"system libraries: {', '.join(absent)}", f"sudo apt-get install {' '.join(absent)}")
    commands = {name: shutil.which(name) is not None for name in COMMANDS}
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    disk = shutil.disk_usage(Path.cwd()).free / 2**30
    if _CHECKOUT:
        for name, there in commands.items():
            if not there:
                lacks(f"command {name}", f"sudo apt-get install {COMMANDS[name]}")
        if memory < MIN_MEMORY_GIB:
            lacks(f"memory: {memory:.1f} GiB, {MIN_MEMORY_GIB:g} needed", "use a larger machine")
        if disk < MIN_DISK_GIB:
            lacks(f"disk: {disk:.1f} GiB free, {MIN_DISK_GIB:g} needed", "free some space")
    if not (3, 11) <= sys.version_info[:2] <= (3, 13):
        what = f"Python 3.11, 3.12 or 3.13 (this is {platform.python_version()})"
        lacks(what, f"{setup} PYTHON=python3.11" if _CHECKOUT else setup)
    result: dict[str, Any] = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": packages,
        "libraries": libraries,
        "commands": commands,
        "cpu": _cpu(),
        "threads": {"cores": os.cpu_count(), "usable": _usable_threads()},
        "memory_gib": round(memory, 1),
        "disk_free_gib": round(disk, 1),
        "extras": {
            extra: all(_is_there(name) for name, of in extras.EXTRA_OF.items() if of == extra)
            for extra in set(extras.EXTRA_OF.values())
        },
    }
    if not fast:
        result["imports"] = {name: _import(name) for name in _LARGE}
        for name, found in result["imports"].items():
            if found != "ok" and _is_there(name):  # what is not there is told above
                lacks(f"{name} does not load: {found}", setup)
        result["gpu"] = _gpu() if result["imports"]["torch"] == "ok" else None
    result |= {"missing": missing, "ok": not missing}
    return result | {"table": _lines(result), "verdict": "see MISSING above" if missing else "all is there"}


def _packages() -> tuple[dict[str, str | None], list[str]]:
    """Versions of the pinned packages, without requirements.lock of the package's own; and which are wrong."""
    import importlib.metadata  # takes long, and other commands do without

    if _CHECKOUT:
        pins = dict(re.findall(r"(?m)^([A-Za-z0-9._-]+)==(\S+)$", _LOCK.read_text()))
    else:
        needed = [item for item in importlib.metadata.requires(extras.DISTRIBUTION) or [] if "extra ==" not in item]
        pins = {re.split(r"[^\w.-]", item)[0]: None for item in needed}
    found: dict[str, str | None] = {}
    for name in pins:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
    wrong = [name for name, pin in pins.items() if found[name] is None or pin not in (None, found[name])]
    return found, [
        f"{name} {pins[name] or ''}".strip() + (f" (is {found[name]})" if found[name] else "") for name in wrong
    ]


def _is_there(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


def _loads(library: str) -> bool:
    import ctypes

    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _cpu() -> dict[str, Any]:
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    model = re.search(r"model name\s*: (.*)", info)
    flags = set((re.search(r"flags\s*: (.*)", info) or ["", ""])[1].split())
    features = {name: name in flags for name in CPU_FLAGS}
    return {"model": model[1] if model else platform.processor(), "features": features}


def _usable_threads() -> int:
    """Cores that this process may use, of what a container's quota leaves."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = Path("/sys/fs/cgroup/cpu.max")
    if quota.is_file() and not quota.read_text().startswith("max"):
        share, period = map(int, quota.read_text().split()[:2])
        usable = min(usable, max(1, round(share / period)))
    return usable


def _import(name: str) -> str:
    """Whether a large package loads; a system library that it misses shows only then."""
    if sys.stderr.isatty():  # each takes seconds
        sys.stderr.write(f"loading {name}\n")
    try:
        importlib.import_module(name)
    except (ImportError, OSError) as error:
        return " ".join(str(error).split())
    return "ok"


def _gpu() -> str | None:
    import torch

    return torch.cuda.get_device_name(0) if torch.cuda.is_available() else None


def _lines(result: dict[str, Any]) -> list[str]:
    features = [name for name, there in result["cpu"]["features"].items() if there]
    lines = [
        f"Python     {result['python']} on {result['platform']}",
        f"CPU        {result['cpu']['model']}; {', '.join(features) or 'no vector extensions known'}",
        f"threads    {result['threads']['usable']} usable of {result['threads']['cores']}",
        f"memory     {result['memory_gib']} GiB; {result['disk_free_gib']} GiB of disk free here",
        f"GPU        {result.get('gpu') or 'none (not needed)'}",
        f"packages   {sum(v is not None for v in result['packages'].values())} of {len(result['packages'])} installed",
        f"libraries  {sum(result['libraries'].values())} of {len(result['libraries'])} found",
    ]
    lines += [
        f"extra      {name} ({extras.COSTS[name]}): "
        + ("installed" if there else f"not installed; a choice: {extras.command(name)}")
        for name, there in sorted(result["extras"].items())
        if not _CHECKOUT
    ]
    return lines + [f"MISSING    {entry['what']}\n           {entry['command']}" for entry in result["missing"]]
