"""`ddf doctor`: what this machine has, what is missing and the command for it. Imports nothing that may be missing."""

import argparse
import ctypes
import importlib
import importlib.metadata
import importlib.util
import os
import platform
import re
import shutil
import sys
from pathlib import Path
from typing import Any

from ddf.core import extras

# Library that a package loads at import, and the Debian package that brings it.
LIBRARIES = {
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
}
COMMANDS = ("make", "flock", "git")
# What the numerical libraries choose their fastest code by.
CPU_FLAGS = ("avx2", "fma", "avx512f", "avx512_bf16", "amx_bf16")
MIN_DISK_GIB, MIN_MEMORY_GIB = 5.0, 4.0
_IMPORTS = ("torch", "torchvision", "open3d", "pymeshlab")
EXAMPLES = ("ddf doctor", "ddf doctor --fast")
_LOCK = Path(__file__).resolve().parents[3] / "requirements.lock"
_CHECKOUT = _LOCK.is_file()  # `make setup` brings all there; elsewhere extras are a choice


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's own arguments."""
    parser.add_argument("--fast", action="store_true", help="do not try to import the large packages")


def run(args: argparse.Namespace) -> dict[str, Any]:
    """Look at everything; `missing` lists what to do, `ok` says that there is nothing to do."""
    missing: list[dict[str, str]] = []
    result: dict[str, Any] = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": _packages(missing),
        "libraries": _libraries(missing),
        "commands": _commands(missing),
        "cpu": _cpu(),
        "threads": _threads(),
        "memory_gib": _memory_gib(missing),
        "disk_free_gib": _disk_gib(missing),
    }
    result["extras"] = _extras()
    if not (3, 11) <= sys.version_info[:2] <= (3, 13):
        what = f"Python 3.11, 3.12 or 3.13 (this is {result['python']})"
        missing.append({"what": what, "command": _setup("PYTHON=python3.11")})
    if not args.fast:
        result["imports"] = _imports(missing)
        result["gpu"] = _gpu()
    result["missing"] = missing
    result["ok"] = not missing
    result["table"], result["verdict"] = _lines(result), "all is there" if result["ok"] else "see MISSING above"
    return result


def _packages(missing: list[dict[str, str]]) -> dict[str, str | None]:
    """Installed version of every pinned package; without requirements.lock, of the package's own requirements."""
    if _CHECKOUT:
        pins = dict(re.findall(r"(?m)^([A-Za-z0-9._-]+)==(\S+)$", _LOCK.read_text()))
    else:
        needed = [item for item in importlib.metadata.requires(extras.DISTRIBUTION) or [] if "extra ==" not in item]
        pins = {re.split(r"[^\w.-]", item)[0]: None for item in needed}
    found: dict[str, str | None] = {}
    wrong = []
    for name, pin in pins.items():
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
        if found[name] is None or pin not in (None, found[name]):
            wrong.append(f"{name} {pin or ''}".strip() + (f" (is {found[name]})" if found[name] else ""))
    if wrong:
        missing.append({"what": f"packages: {', '.join(wrong)}", "command": _setup()})
    return found


def _setup(options: str = "") -> str:
    """The command that installs this package's own requirements anew."""
    return f"make setup {options}".strip() if _CHECKOUT else f"pip install {extras.DISTRIBUTION}"


def _extras() -> dict[str, bool]:
    """Whether the modules of each extra are there. A choice, but in a checkout, where `_packages` tells what lacks."""
    names = extras.EXTRA_OF
    return {extra: all(_is_there(name) for name in names if names[name] == extra) for extra in set(names.values())}


def _is_there(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


def _libraries(missing: list[dict[str, str]]) -> dict[str, bool]:
    found = {}
    for name in LIBRARIES:
        try:
            ctypes.CDLL(name)
            found[name] = True
        except OSError:
            found[name] = False
    absent = [LIBRARIES[name] for name, there in found.items() if not there]
    if absent and (_CHECKOUT or _is_there("open3d")):  # which loads them
        command = f"sudo apt-get install {' '.join(absent)}"
        missing.append({"what": f"system libraries: {', '.join(absent)}", "command": command})
    return found


def _commands(missing: list[dict[str, str]]) -> dict[str, bool]:
    found = {name: shutil.which(name) is not None for name in COMMANDS}
    packages = {"flock": "util-linux"}
    missing.extend(  # of make and what it runs
        {"what": f"command {name}", "command": f"sudo apt-get install {packages.get(name, name)}"}
        for name, there in found.items()
        if _CHECKOUT and not there
    )
    return found


def _cpu() -> dict[str, Any]:
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    model = re.search(r"model name\s*: (.*)", info)
    flags = set((re.search(r"flags\s*: (.*)", info) or ["", ""])[1].split())
    return {
        "model": model[1] if model else platform.processor(),
        "features": {name: name in flags for name in CPU_FLAGS},
    }


def _threads() -> dict[str, int | None]:
    """Cores of the machine, those this process may use, and what a container's quota leaves of them."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota = Path("/sys/fs/cgroup/cpu.max")
    limit = None
    if quota.is_file() and not quota.read_text().startswith("max"):
        share, period = map(int, quota.read_text().split()[:2])
        limit = max(1, round(share / period))
    return {"cores": os.cpu_count(), "usable": min(usable, limit or usable)}


def _memory_gib(missing: list[dict[str, str]]) -> float:
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    if _CHECKOUT and total < MIN_MEMORY_GIB:
        missing.append(
            {"what": f"memory: {total:.1f} GiB, {MIN_MEMORY_GIB:g} needed", "command": "use a larger machine"}
        )
    return round(total, 1)


def _disk_gib(missing: list[dict[str, str]]) -> float:
    free = shutil.disk_usage(Path.cwd()).free / 2**30
    if _CHECKOUT and free < MIN_DISK_GIB:
        missing.append({"what": f"disk: {free:.1f} GiB free, {MIN_DISK_GIB:g} needed", "command": "free some space"})
    return round(free, 1)


def _imports(missing: list[dict[str, str]]) -> dict[str, str]:
    """Whether the large packages load; a system library that they miss shows only then."""
    results = {}
    for name in _IMPORTS:
        if sys.stderr.isatty():  # each takes seconds
            sys.stderr.write(f"loading {name}\n")
        try:
            importlib.import_module(name)
            results[name] = "ok"
        except (ImportError, OSError) as error:
            results[name] = " ".join(str(error).split())
            if _is_there(name):  # what is not there is told by `_packages` and `_extras`
                missing.append({"what": f"{name} does not load: {results[name]}", "command": _setup()})
    return results


def _gpu() -> str | None:
    try:
        import torch
    except (ImportError, OSError):
        return None
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
        f"extra      {name}: {'installed' if there else f'not installed; a choice: {extras.command(name)}'}"
        for name, there in sorted(result["extras"].items())
        if not _CHECKOUT
    ]
    lines += [f"MISSING    {entry['what']}\n           {entry['command']}" for entry in result["missing"]]
    return lines
