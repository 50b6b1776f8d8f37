"""The package as users get it: a wheel in fresh environments, where the commands of the pages run."""

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import _page_inputs
import pytest

import ddf
from ddf.core import extras

ROOT = Path(__file__).resolve().parents[3]
UV = ROOT / ".venv" / "bin" / "uv"
HEAVY = ("torch", "torchvision", "pandas", "matplotlib", "open3d", "trimesh", "scipy", "onnxruntime", "numpy")
BROUGHT = {"": (), "torch": ("joblib", "onnx", "onnxruntime", "open3d", "torch", "trimesh")}  # by extras
PYTHONS = ("3.11", "3.12", "3.13")
BASE_BYTES = 450e6
ALONE = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONDONTWRITEBYTECODE")}
README, QUICK_START, API, EXAMPLES = (
    (ROOT / page).read_text() for page in ("README.md", "docs/quickstart.md", "docs/api.md", "examples/README.md")
)
NOT_RUN = ("own_shapenet.py", "FIELD.onnx", "chair.npz")  # they ask for files of the user's


@pytest.mark.parametrize(
    "program",
    [
        f"import sys, ddf, ddf.cli.frame\nassert not {{*{HEAVY!r}}} & set(sys.modules)",
        "import sys, ddf\nassert 'load' in dir(ddf) and 'ddf.api' not in sys.modules\nddf.load, ddf.__version__",
        "import ddf, ddf.fields.field_file\nassert ddf.fit.__module__ == 'ddf.api.field', ddf.fit",
    ],
    ids=["nothing heavy is imported", "names are listed and lazy", "a room takes no public name"],
)
def test_the_package_in_a_python_of_its_own(program):
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def section(extra: str) -> list[str]:
    """Lines of shell of the quick start that need one extra; the README's, too, for the base install."""
    heading = f'pip install ".[{extra}]"' if extra else "pip install ."
    (found,) = re.findall(rf"(?ms)^## With `{re.escape(heading)}`$(.*?)(?=^## |\Z)", QUICK_START)
    shell = "".join(re.findall(r"(?ms)^```sh\n(.*?)^```$", found if extra else found + README))
    lines = [line for line in shell.splitlines() if line.startswith("ddf ")]
    return [*(section("")[:1] if extra else ()), *lines]  # all begin with the fit of the first page


def scripts(extra: str, folder: Path) -> list[str]:
    """Calls of the examples that need one extra, as each says at its top; snippets of pages, too, for the base."""
    needs = f"`.[{extra}]`" if extra else ""
    named = re.findall(rf"(?m)^\| \[(\w+\.py)\].*\| {re.escape(needs)} ?\|$", EXAMPLES)
    texts = ((ROOT / "examples" / name).read_text() for name in named)
    said = [re.findall(r"(?m)^python (examples/\S+(?: \S+)*)", text) for text in texts]
    calls = [call.replace("MESH.obj", "shape.obj") for each in said for call in each]
    found = [f"python {ROOT}/{call}" for call in calls if not any(word in call for word in NOT_RUN)]
    for name, page in {"readme": README, "api": API}.items() if not extra else ():
        code = "\n".join(re.findall(r"(?ms)^```python\n(.*?)^```$", page))
        (folder / f"of_{name}.py").write_text(code, encoding="utf-8")
        found.append(f"python of_{name}.py")
    return found


def without(extra: str, program: str, *words: str, cwd: Path) -> str:
    """What a program prints that cannot import what its extra does not bring."""
    hidden = sorted({*extras.EXTRA_OF, "onnxruntime"} - {*BROUGHT[extra]})
    program = f"import sys; sys.modules.update(dict.fromkeys({hidden!r}))\n{program}"
    done = subprocess.run([sys.executable, "-c", program, *words], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.timeout(600)
@pytest.mark.parametrize("extra", BROUGHT)
def test_the_commands_of_the_pages_need_no_package_of_another_extra(extra, tmp_path):
    """As the walk in fresh environments, in this one."""
    _page_inputs.write(tmp_path)
    program = "import shlex, ddf.cli\nfor line in sys.argv[1:]: assert ddf.cli.main(shlex.split(line)[1:]) == 0, line"
    lines = [line for line in dict.fromkeys(section(extra)) if "--minutes" not in line]
    without(extra, program, *lines, cwd=tmp_path)


LIBRARY = """
import numpy as np, ddf
rabbit, beside = ddf.load("rabbit"), np.eye(4)
pictures = rabbit.render(35, 25, size=256, outputs=("depth", "normals"))
assert pictures["normals"].shape == (256, 256, 3) and 0.1 < np.isfinite(pictures["depth"]).mean() < 0.9
beside[0, 3] = 1.5
scene = ddf.compose([rabbit, ddf.load("armchair")], [np.eye(4), beside])
assert np.isfinite(scene.render(35, 25, size=256)["depth"]).any()
assert rabbit.query([[0.0, 0.45, 5.0]], [[0.0, 0.0, -1.0]])["visibility"][0] > 0.5
assert ddf.compare(np.zeros((1, 3)), [[0.0, 0.0, 0.005]]).f_score_tau == 1.0
open("triangle.obj", "w").write("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nf 1 2 3\\n")
mesh = ddf.read_mesh("triangle.obj")
assert mesh.faces.tolist() == [[0, 1, 2]]
fitted = ddf.fit(mesh, out="field")
assert fitted.points(50).shape == (50, 3) and len(fitted.surface(resolution=16).faces) > 10
assert fitted.query([[0.2, 0.2, 1.0]], [[0.0, 0.0, -1.0]])["depth"].round(3) == [1.0]
assert ddf.cast(mesh, [[0.2, 0.2, 1.0]], [[0.0, 0.0, -1.0]]).depth == [1.0]
assert ddf.load("field").export("field.html").is_file()
"""


def test_the_library_needs_no_package_of_an_extra(tmp_path):
    without("", LIBRARY, cwd=tmp_path)


@pytest.mark.parametrize(
    ("call", "extra"),
    [
        ("ddf.load('rabbit-network')", "torch"),
        ("ddf.load('rabbit').surface(10, 'poisson')", "torch"),
        ("ddf.load('rabbit').export('field.onnx')", "torch"),
        ("ddf.fit('shape.obj', steps=1)", "torch"),
        ("ddf.reconstruct('shape.obj', 'chair')", "torch"),
        ("ddf.torch.Field(ddf.load('rabbit'))", "torch"),
        ("ddf.load('alone.onnx')", "onnx"),
    ],
)
def test_what_needs_another_extra_names_it(call, extra, tmp_path):
    _page_inputs.write(tmp_path)
    (tmp_path / "alone.onnx").touch()
    program = f"import ddf\ntry: {call}\nexcept ValueError as error: print(error)"
    told = without("", program, cwd=tmp_path)
    assert " needs " in told and told.endswith(f': pip install "directed-distance-fields[{extra}]"\n')


def interpreter(version: str) -> Path | None:
    """A Python of this version on this machine."""
    named = [shutil.which(f"python{version}"), *(Path.home() / ".pyenv/versions").glob(f"{version}.*/bin/python")]
    asked = ["-c", f"import sys; sys.exit('.'.join(map(str, sys.version_info[:2])) != '{version}')"]
    found = (name for name in filter(None, named) if subprocess.run([name, *asked], check=False).returncode == 0)
    return next(map(Path, found), None)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    if not UV.is_file():
        pytest.skip("uv is not in .venv: run `make setup`")
    out = tmp_path_factory.mktemp("dist")
    build = [UV, "build", "-q", "--no-build-isolation", "--offline", "-o", out, ROOT]
    subprocess.run(build, check=True, timeout=120, env={**ALONE, "VIRTUAL_ENV": str(ROOT / ".venv")})
    return next(out.glob("*.whl"))


def environment(folder: Path, version: str, wheel: Path, extra: str) -> Path:
    """The folder of the commands of a fresh environment; from uv's cache, else from the registry, else skipped."""
    python = interpreter(version)
    if python is None:
        pytest.skip(f"there is no Python {version} on this machine")
    subprocess.run([UV, "venv", "-q", "-p", python, folder / "env"], check=True, timeout=60)
    what = f"{wheel}[{extra}]" if extra else str(wheel)
    own = [UV, "pip", "install", "-q", "-p", folder / "env", "-c", ROOT / "requirements.lock", what]
    for how in (["--offline"], []):
        done = subprocess.run([*own, *how], capture_output=True, text=True, timeout=900)
        if done.returncode == 0:
            return folder / "env" / "bin"
    pytest.skip(f"the packages can be had neither from uv's cache nor from a registry: {done.stderr[-300:]}")


def run(commands: Path, folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    path = f"{commands}:/usr/bin:/bin"
    own = {**ALONE, "PATH": path}
    return subprocess.run(line, shell=True, cwd=folder, env=own, capture_output=True, text=True, timeout=600)


WALKS = [(extra, version) for extra in ("", "torch", "experiments") for version in PYTHONS]  # the first one always


@pytest.mark.timeout(3000)
@pytest.mark.parametrize(
    ("extra", "version"),
    [pytest.param(*walk, marks=[pytest.mark.slow] * (i > 0)) for i, walk in enumerate(WALKS)],
    ids=[f"{extra or 'base'}-{version}" for extra, version in WALKS],
)
def test_the_commands_of_the_pages_run_in_the_extra_that_they_name(extra, version, wheel, tmp_path):
    commands = environment(tmp_path, version, wheel, extra)
    _page_inputs.write(tmp_path)
    assert section(extra)
    print(f"\nPython {version}, pip install .{extra and f'[{extra}]'}: CPU seconds")
    for line in [*section(extra), *scripts(extra, tmp_path)]:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = run(commands, tmp_path, line.replace("--minutes 2", "--minutes 0.3"))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(f"{after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime:7.1f}  {line}", flush=True)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
    doctor = json.loads(run(commands, tmp_path, "ddf doctor --json").stdout)
    assert doctor["missing"] == [] and doctor["extras"]["torch"] == bool(extra)
    for name in ("run", "info"):
        done = run(commands, tmp_path, f"ddf {name} configs/cpu.yaml")
        assert done.returncode == 2 and re.fullmatch(rf"ddf {name}: error: .*checkout.*\n", done.stderr)
    if extra:
        return
    files = [file for file in (tmp_path / "env").rglob("*") if not file.is_symlink() and file.suffix != ".pyc"]
    assert sum(file.stat().st_size for file in files) <= BASE_BYTES
    assert run(commands, tmp_path, "python -c 'import ddf_lab'").returncode == 1


@pytest.mark.slow
def test_an_onnx_file_is_asked_in_its_own_extra(wheel, tmp_path):
    ddf.load("rabbit-network").export(tmp_path / "field.onnx")
    done = run(environment(tmp_path, PYTHONS[0], wheel, "onnx"), tmp_path, "ddf render field.onnx picture.png")
    assert done.returncode == 0 and (tmp_path / "picture.png").is_file(), done.stderr


@pytest.mark.slow
def test_the_wheel_holds_the_library_and_the_sdist_docs_and_examples(wheel):
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.split("/")[0] for name in archive.namelist()}
    assert tops == {"ddf", f"{wheel.name.split('-py3')[0]}.dist-info"}
    (sdist,) = wheel.parent.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    listing = ["git", "ls-files", "docs", "examples", "src/ddf"]
    tracked = subprocess.run(listing, cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(tracked.stdout.splitlines()) <= names
