"""The package as users get it: a wheel in a fresh environment outside the checkout; and what starting it imports."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
UV = ROOT / ".venv" / "bin" / "uv"
HEAVY = ("torch", "torchvision", "pandas", "matplotlib", "open3d", "trimesh", "scipy", "onnxruntime", "numpy")


def test_import_and_version_take_nothing_heavy():
    program = f"import sys, ddf, ddf.cli.frame\nprint(sorted(set({HEAVY!r}) & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout.strip() == "[]"


def test_names_are_listed_and_lazy():
    program = "import sys, ddf\nassert 'load' in dir(ddf) and 'ddf.api' not in sys.modules\nddf.load"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_a_room_takes_no_public_name():
    program = "import ddf, ddf.fit.field_file\nassert ddf.fit.__module__ == 'ddf.api.field', ddf.fit"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


@pytest.mark.slow
def test_base_install_queries_renders_composes_and_compares_without_torch(tmp_path):
    if not UV.is_file():
        pytest.skip("uv is not in .venv: run `make setup`")
    build = [UV, "build", "--wheel", "-q", "--no-build-isolation", "--offline", "-o", tmp_path / "dist", ROOT]
    subprocess.run(build, check=True, timeout=120, env={**os.environ, "VIRTUAL_ENV": str(ROOT / ".venv")})
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    subprocess.run([UV, "venv", "-q", "-p", sys.executable, tmp_path / "env"], check=True, timeout=60)
    python = tmp_path / "env" / "bin" / "python"
    install = [UV, "pip", "install", "-q", "--python", python, "-c", ROOT / "requirements.lock", wheel]
    for how in (["--offline"], []):  # from uv's cache, else from the registry
        done = subprocess.run([*install, *how], capture_output=True, text=True, timeout=200)
        if done.returncode == 0:
            break
    else:
        pytest.skip(f"the packages can be had neither from uv's cache nor from a registry: {done.stderr[-300:]}")
    size = sum(file.stat().st_size for file in (tmp_path / "env").rglob("*") if not file.is_symlink())
    assert size < 350e6
    script = [python, Path(__file__).parent / "_base_install.py"]
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    run = subprocess.run(script, capture_output=True, text=True, cwd=tmp_path, env=alone, timeout=120)
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout)
    assert Path(result["file"]).is_relative_to(tmp_path)
    assert result["heavy"] == []
    assert set(result["told"]) == {"points", "surface", "cast", "fit", "reconstruct"}
    for name, line in result["told"].items():
        assert line.startswith("this needs ") and line.endswith(': pip install "directed-distance-fields[torch]"'), name
