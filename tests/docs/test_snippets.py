"""What the pages tell people to type and to open is there: fenced blocks run, or are listed and their parts exist."""

import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import _page_inputs
import pytest

import ddf.cli
from ddf.cli import frame
from ddf.core import config

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
MAKEFILE = (ROOT / "Makefile").read_text()

# Lines of shell that are only parsed, with what runs them elsewhere or keeps them from running.
NOT_RUN = {
    r"make ": "an experiment, or the set-up of the whole environment; tests/stages runs stages on tiny data",
    r"ddf (export|reconstruct|generate) .*artifacts/": "needs a trained experiment; tests/cli runs it on tiny ones",
    r"ddf generate (chair|plane)": "half a minute of a core; tests/cli runs it on tiny models",
    r"ddf reconstruct .*/sample_": "a minute of a busy core; tests/cli runs it on tiny models",
    r"ddf complete |whole_chair": "needs a scan; tests/ddf/cli/model/test_cli_complete.py runs it",
    r"ddf points ": "half a minute of a core; tests/cli runs it",
    r"ddf run ": "an experiment; tests/stages runs stages on tiny data",
    r"ddf fit |my_field|my_network|surface\.ply": "two minutes; tests/ddf/api/test_install.py runs it",
    r"pip install ": "tests/ddf/api/test_install.py does in fresh environments",
    r"ddf shapes add ": "needs meshes; tests/ddf/data/public/test_adding.py runs it",
    r"ddf split /path": "needs ShapeNet; tests/cli runs it on a listing",
    r"\. .venv/bin/activate": "changes the shell that runs it",
}
# Snippets of Python that are only compiled.
NOT_RUN_PYTHON = {
    "dask_jobqueue": "needs SLURM",
    "onnxruntime.InferenceSession": "tests/stages/test_stage_export_onnx.py runs it on what the stage wrote",
}


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a page in one language, in order."""
    return [text for name, text in re.findall(r"(?ms)^```(\w*)\n(.*?)^```$", page.read_text()) if name == language]


def lines(page: Path) -> list[str]:
    """The lines of shell of a page, continued ones joined, without comments."""
    joined = "\n".join(blocks(page, "sh")).replace("\\\n", " ")
    return [shlex.join(words) for line in joined.splitlines() if (words := shlex.split(line, comments=True))]


def not_run(line: str, table: dict[str, str]) -> bool:
    return any(re.search(pattern, line) for pattern in table)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_lines_of_shell_are_well_formed(page, monkeypatch):
    monkeypatch.setattr("ddf.core.processes.guarded", lambda *_: 0)  # arguments are parsed, nothing runs
    monkeypatch.chdir(ROOT)
    for line in lines(page):
        words = shlex.split(line)
        while re.match(r"[A-Z_]+=", words[0]):
            words = words[1:]
        if words[0] == "ddf":
            assert ddf.cli.main(words[1:]) == 0, line
        elif words[0] == "make":
            _check_make(words[1:])
        elif words[0] == "python" and words[1].endswith(".py"):
            assert (ROOT / words[1]).is_file(), line
        elif words[:3] == ["python", "-m", "pytest"]:
            assert all((ROOT / word).exists() for word in words[3:] if "/" in word), line
        elif words[:2] == ["pip", "install"]:
            _check_extras(words[2:])
        else:
            assert not_run(line, NOT_RUN), f"{page.name}: nothing tells whether this line is right: {line}"


def _check_make(words: list[str]) -> None:
    """Targets and variables are the Makefile's, and files that are named exist."""
    for word in words:
        name, equals, value = word.partition("=")
        if equals:
            assert re.search(rf"(?m)^{name} *\?=", MAKEFILE), f"make has no variable {name}"
            assert name != "CONFIG" or config.named_file(Path(value).stem), f"{value}: no such experiment"
        else:
            stage = name.removeprefix("stage-")
            assert re.search(rf"(?m)^{name}:", MAKEFILE) or (ROOT / "stages" / f"{stage}.py").is_file(), name


def _check_extras(words: list[str]) -> None:
    """What is installed from this folder has the extras that are asked for."""
    known = set(re.findall(r"(?m)^(\w+) = \[", (ROOT / "pyproject.toml").read_text()))
    for word in words:
        found = re.fullmatch(r"\.(?:\[([\w,]+)\])?", word)
        assert word.startswith("-") or (found and set(filter(None, (found[1] or "").split(","))) <= known), word


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_the_text_names_exists(page):
    """Modules and functions of ddf, files, make targets, config keys and scripts, in code within a line."""
    text = re.sub(r"(?ms)^```.*?^```$", "", page.read_text())
    for span in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text):
        if re.fullmatch(r"ddf(\.[a-z_0-9]+)+(\.[A-Z]\w+)?(\.\w+)?", span):
            assert found_in_source(span) or found_in_configs(span), span
        elif span.startswith("make ") and "<" not in span and "/path" not in span:
            _check_make(shlex.split(span)[1:])
        elif re.match(r"(src|tests|stages|configs|bench|docs|reports|examples)/[^\s<*{]*$", span):
            assert (ROOT / span).exists() or re.search(r"reports/NAME", span), span
        elif span.startswith("python -m bench "):
            assert list((ROOT / "bench").rglob(f"{span.split()[3]}.py")), span


def found_in_source(name: str) -> bool:
    """Whether a dotted name is a package, a module, or something that one of these defines."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        place = ROOT / "src" / Path(*parts[:cut])
        file = place.with_suffix(".py") if place.with_suffix(".py").is_file() else place / "__init__.py"
        if file.is_file():
            defined = r"(?m)^ *(?:(?:async )?def |class )?{}\b *[(:=]"
            return all(re.search(defined.format(word), file.read_text()) for word in parts[cut:])
    return False


def found_in_configs(name: str) -> bool:
    """Whether a dotted name such as ddf.field.mirror is a key of configs/cpu.yaml, at any depth."""
    text = (ROOT / "configs/cpu.yaml").read_text()
    return all(re.search(rf"(?m)\b{word}:", text) for word in name.split("."))


@pytest.mark.slow  # those of README and quickstart run in tests/ddf/api/test_install.py each time
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
@pytest.mark.timeout(3600)  # of many commands, on a busy machine
def test_commands_run(page, tmp_path):
    for name in ("configs", "pipeline.yaml", "stages"):
        (tmp_path / name).symlink_to(ROOT / name)
    _page_inputs.write(tmp_path)
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    for line in lines(page):
        if not not_run(line, NOT_RUN):
            done = subprocess.run(
                line, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=900
            )
            assert done.returncode == 0, f"{line}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_snippets_of_python_run_in_order(page, tmp_path):
    snippets = blocks(page, "python")
    for snippet in snippets:
        compile(snippet, page.name, "exec")
    program = "\n".join(snippet for snippet in snippets if not not_run(snippet, NOT_RUN_PYTHON))
    if program:
        words = [sys.executable, "-c", program]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=240)
        assert done.returncode == 0, f"{page.name}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_links_exist(page):
    text = page.read_text()
    assert set(re.findall(r"(?:^    |`)ddf ([a-z]+)\b", text, re.MULTILINE)) <= set(frame.COMMANDS)
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if not link.startswith("http")]
    assert [link for link in links if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("given", ["/my data/~ (1)", "~/shapes", "a$b", "a'b\"c"])
def test_recipes_get_the_root_of_data_as_it_was_given(tmp_path, given):
    (tmp_path / "Makefile").write_text(f"include {ROOT / 'Makefile'}\nshown:\n\t@env\n")
    shown = subprocess.run(["make", "shown", f"DATA={given}"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"DATA={given}" in shown.stdout.splitlines()


def test_the_page_of_commands_is_current():
    written = runpy.run_path(str(ROOT / "docs" / "commands.py"))["text"]()
    assert (ROOT / "docs" / "commands.md").read_text(encoding="utf-8") == written, "run: python docs/commands.py"


@pytest.mark.parametrize("name", frame.COMMANDS)
def test_examples_are_well_formed(name, monkeypatch):
    monkeypatch.setattr("ddf.core.processes.guarded", lambda *_: 0)  # arguments are parsed, nothing runs
    for example in frame.COMMANDS[name].docstring.examples:
        assert example.startswith(f"ddf {name}")
        assert ddf.cli.main(shlex.split(example)[1:]) == 0, example


@pytest.mark.parametrize("recipe", sorted((ROOT / "docs" / "recipes").glob("*.diff")), ids=lambda recipe: recipe.stem)
def test_recipes_apply_to_the_code_as_it_is(recipe):
    subprocess.run(["git", "apply", "--check", recipe], cwd=ROOT, check=True)
