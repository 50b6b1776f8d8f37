"""The command line's frame: JSON alone on stdout, one line for errors, commands imported when they are called."""

import errno
import importlib.metadata
import json
import os
import signal
import subprocess
import sys
import types
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest

from ddf import cli
from ddf.cli import declare, frame
from ddf.core import checks, processes

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def command(monkeypatch):
    """Replaces the command `doctor` by one that does, or raises, what the test says."""

    def install(run):
        def doctor(word: Annotated[str | None, declare.Arg(nargs="?")]) -> dict[str, Any]:
            """Does what the test says."""
            if isinstance(run, BaseException):
                raise run
            return run(types.SimpleNamespace(word=word))

        monkeypatch.setitem(frame.COMMANDS, "doctor", declare.command("experiment")(doctor))

    return install


def test_json_is_one_object_whatever_libraries_print(command, capfd):
    def run(args):
        print("chatter")
        os.write(1, b"native chatter\n")
        nested = {"array": np.arange(2), "number": np.float32(0.5), "flag": np.bool_(True)}
        for_people = {"table": {"for": "people"}, "verdict": "for people"}
        return {"word": args.word, "nested": nested, "infinite": float("inf"), "path": Path("a/b"), **for_people}

    command(run)
    assert cli.main(["doctor", "hello", "--json"]) == 0
    captured = capfd.readouterr()
    nested = {"array": [0, 1], "number": 0.5, "flag": True}
    assert json.loads(captured.out) == {"word": "hello", "nested": nested, "infinite": None, "path": "a/b"}
    assert "native chatter" in captured.err


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (checks.InputError("a.obj: has\nno faces"), "a.obj: has no faces"),
        (OSError(errno.ENOSPC, "No space left on device", "out.ply"), "No space left on device: out.ply"),
        (PermissionError(errno.EROFS, "Read-only file system"), "Read-only file system"),
        (FileNotFoundError("x does not exist; run the stage"), "x does not exist; run the stage"),
        (MemoryError("Unable to allocate 9 TiB"), "not enough memory: Unable to allocate 9 TiB"),
        (
            ModuleNotFoundError("No module named 'torch'", name="torch"),
            'this needs torch: pip install "directed-distance-fields[torch]"',
        ),
    ],
)
def test_errors_of_the_user_are_one_line_and_code_2(command, refusal, error, line):
    command(error)
    assert refusal("doctor", "--json") == f"ddf doctor: error: {line}\n"


@pytest.mark.parametrize(
    "error",
    [ModuleNotFoundError("a bug", name="nothing"), ValueError("a bug"), KeyError("a bug"), RuntimeError("a bug")],
)
def test_bugs_keep_their_traceback(command, error):
    command(error)
    with pytest.raises(type(error), match="a bug"):
        cli.main(["doctor"])


def _fresh(program, *arguments, **environment):
    """A python of its own, with nothing imported yet; standard error goes where it is asked for."""
    command = [sys.executable, *arguments, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, timeout=120)


@pytest.mark.parametrize(
    ("lines", "kept_out"),
    [
        ([[name, "--help"] for name in frame.COMMANDS], ["torch", "matplotlib", "pandas", "PIL", "pymeshlab"]),
        ([["--version"]], ["numpy"]),
    ],
)
def test_help_and_version_import_nothing_that_takes_long(lines, kept_out):
    call = f"import contextlib, sys, ddf.cli\nfor line in {lines!r}:\n    with contextlib.suppress(SystemExit):\n"
    found = _fresh(f"{call}        ddf.cli.main(line)\nprint(set({kept_out!r}) & set(sys.modules))")
    *_, first, last = found.stdout.splitlines()
    assert last == "set()"
    assert lines[0][-1] == "--help" or first == f"ddf {importlib.metadata.version('directed-distance-fields')}"


def test_negative_values_are_no_options():
    given = ["--camera", "-30,10,.9", "-n", "-5", "--noise", "-.5", "a", "-.5", "--", "-1"]
    assert frame.with_negative_values(given) == ["--camera=-30,10,.9", "-n-5", "--noise=-.5", "a", "-.5", "--", "-1"]
    assert frame.with_negative_values(["--camera=1", "-2"]) == ["--camera=1", "-2"]


@pytest.mark.parametrize(("mode", "arguments"), [("utf8=0", []), ("utf8=1", ["--json"])])
def test_what_an_ascii_terminal_cannot_show_is_escaped(arguments, mode, tmp_path):
    program = [sys.executable, "-X", mode, "-c", "import sys, ddf.cli; sys.exit(ddf.cli.main())"]
    ascii_only = {**os.environ, "LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONCOERCECLOCALE": "0"}
    (tmp_path / "tür").write_text("a file")

    def get(out):
        words = [*program, "models", "get", "rabbit", str(tmp_path / out), *arguments]
        return subprocess.run(words, capture_output=True, env=ascii_only, timeout=120)

    done, refused = get("völlig"), get("tür")
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii() and b"/v\\" in done.stdout and b"llig" in done.stdout
    assert (tmp_path / "völlig" / "card.md").exists()
    assert refused.returncode == 2 and refused.stdout == b""
    assert refused.stderr.isascii() and refused.stderr.count(b"\n") == 1
    assert b"is a file; give a folder" in refused.stderr


@pytest.mark.parametrize(("given", "seen"), [(None, "PASSIVE"), ("active", "active")])
def test_threads_wait_without_spinning_unless_the_user_says_otherwise(command, answer, monkeypatch, given, seen):
    monkeypatch.delenv("OMP_WAIT_POLICY", raising=False)
    if given:
        monkeypatch.setenv("OMP_WAIT_POLICY", given)
    command(lambda args: {"policy": os.environ["OMP_WAIT_POLICY"]})
    assert answer("doctor")["policy"] == seen


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_one_line_with_what_is_kept_and_the_command_that_goes_on(command, capsys, number):
    command(lambda args: os.kill(os.getpid(), number))
    assert cli.main(["doctor"]) == 128 + number
    assert capsys.readouterr().err == "ddf doctor: interrupted\n"

    command(processes.Interrupted(number, "step 7 is kept; go on by:"))
    assert cli.main(["doctor", "a b"]) == 128 + number
    assert capsys.readouterr().err == "ddf doctor: interrupted: step 7 is kept; go on by: ddf doctor 'a b'\n"


def test_an_interrupted_command_with_a_file_says_that_it_is_not_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("ddf.geometry.mesh_io.load_surface", lambda path: os.kill(os.getpid(), signal.SIGINT))
    out = tmp_path / "out.ply"
    assert cli.main(["mesh", "in.obj", str(out)]) == 130
    kept = f"{out} is not written; start again by: ddf mesh in.obj {out}"
    assert capsys.readouterr().err == f"ddf mesh: interrupted: {kept}\n"
    assert cli.main(["fit", "in.obj", str(tmp_path / "new")]) == 130
    assert f"{tmp_path / 'new'} is not written; start again by: ddf fit" in capsys.readouterr().err


@pytest.mark.parametrize("closed", [(), (1,), (0, 1, 2)])
@pytest.mark.parametrize("words", [["models"], ["models", "--json"]])
def test_closed_streams_are_no_fault(closed, words):
    def close():
        for number in closed:
            os.close(number)

    program = [sys.executable, "-c", "import sys, ddf.cli; sys.exit(ddf.cli.main())", *words]
    done = subprocess.run(program, capture_output=True, preexec_fn=close, timeout=60)
    assert (done.returncode, done.stderr, bool(done.stdout)) == (0, b"", not closed)


def test_a_link_to_a_folder_that_is_not_there_is_told(tmp_path, refusal):
    link, missing = tmp_path / "link", tmp_path / "no" / "there"
    link.symlink_to(missing)
    told = refusal("models", "get", "rabbit", link)
    assert told.endswith(f"a link to {missing}, which is not there; make that folder\n")
    export = ("export", "rabbit", (tmp_path / "x.onnx"))
    export[-1].symlink_to(missing)
    assert f"there is no folder {tmp_path / 'no'}; make it" in refusal(*export)


@pytest.mark.parametrize("link", [None, "symlink_to", "hardlink_to"])
def test_no_output_replaces_an_input_under_any_name(tmp_path, refusal, link):
    mesh, out = tmp_path / "a.obj", tmp_path / ("b.obj" if link else "a.obj")
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    rays, lists = tmp_path / "r.npz", tmp_path / "train_list.txt"
    np.savez(rays, positions=np.zeros((1, 3)), directions=np.eye(3)[:1])
    lists.write_text('{"03001627": ["a"]}')
    if link:
        getattr(out, link)(mesh)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    for read, words in (
        (mesh, ("mesh", mesh, out)),
        (mesh, ("cast", mesh, "--rays", rays, "--out", out)),
        (rays, ("cast", mesh, "--rays", rays, "--out", rays)),
        (lists, ("split", lists, "--out", tmp_path)),
    ):
        assert f"{read} is read and would be replaced by the output" in refusal(*words)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("line", "found"),
    [("ddf ren", {"render "}), ("ddf fit a b --min", {"--minutes "}), ("ddf render f o.png --up ", {"y", "z"})],
)
def test_the_shell_is_told_how_a_line_may_go_on(line, found, tmp_path):
    answer = tmp_path / "answer"
    environment = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n"}
    _fresh("import ddf.cli; ddf.cli.main()", **environment, _ARGCOMPLETE_STDOUT_FILENAME=str(answer))
    assert set(answer.read_text().split("\n")) == found


def test_a_folder_that_is_not_there_is_named_before_the_work(tmp_path, refusal):
    (tmp_path / "nothing").mkdir()
    missing = tmp_path / "no" / "such"
    export = ("export", tmp_path / "nothing", missing / "x.onnx")
    hint = f"there is no folder {missing}; make it, or add --make-folders"
    assert refusal(*export) == f"ddf export: error: {missing}/x.onnx: {hint}\n"
    assert "nothing" in refusal(*export, "--make-folders") and missing.is_dir()
    assert "not a regular file" in refusal("export", tmp_path / "nothing", tmp_path)


def test_doctor_runs_where_nothing_is_installed():
    program = "import sys; sys.modules['torch'] = None; import ddf.cli; sys.exit(ddf.cli.main(['doctor', '--json']))"
    # -S: without site-packages, as on a machine where the set-up has not run.
    found = json.loads(_fresh(program, "-S", PYTHONPATH=str(ROOT / "src")).stdout)
    assert found["ok"] is False and found["packages"]["torch"] is None
    assert found["extras"] == dict.fromkeys(("onnx", "las", "torch", "experiments"), False)
    assert "make setup" in [entry["command"] for entry in found["missing"]]
