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
from ddf.cli import commands, declare, frame
from ddf.core import checks, processes

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def command(monkeypatch):
    """Replaces the command `doctor` by one that does what the test says."""

    def install(run):
        def doctor(word: Annotated[str | None, declare.Arg(nargs="?")]) -> dict[str, Any]:
            """Does what the test says."""
            return run(types.SimpleNamespace(word=word))

        monkeypatch.setitem(commands.COMMANDS, "doctor", declare.command("experiment")(doctor))

    return install


def test_json_is_one_object_whatever_libraries_print(command, capfd):
    def run(args):
        print("chatter")
        os.write(1, b"native chatter\n")
        return {
            "word": args.word,
            "nested": {"array": np.arange(2), "number": np.float32(0.5), "flag": np.bool_(True)},
            "infinite": float("inf"),
            "path": Path("a/b"),
            "table": {"for": "people"},
            "verdict": "for people",
        }

    command(run)
    assert cli.main(["doctor", "hello", "--json"]) == 0
    captured = capfd.readouterr()
    assert json.loads(captured.out) == {
        "word": "hello",
        "nested": {"array": [0, 1], "number": 0.5, "flag": True},
        "infinite": None,
        "path": "a/b",
    }
    assert "native chatter" in captured.err


def test_people_get_a_table_and_a_verdict(command, capsys):
    command(lambda args: {"a": {"b": 1}, "long": "x"})
    assert cli.main(["doctor"]) == 0
    assert capsys.readouterr().out == "a.b   1\nlong  x\n"
    command(lambda args: {"a": 1, "table": {"shown": 2}, "verdict": "good"})
    assert cli.main(["doctor"]) == 0
    assert capsys.readouterr().out == "shown  2\ngood\n"


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (checks.InputError("a.obj: has\nno faces"), "a.obj: has no faces"),
        (OSError(errno.ENOSPC, "No space left on device", "out.ply"), "No space left on device: out.ply"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "a.obj"), "No such file or directory: a.obj"),
        (PermissionError(errno.EROFS, "Read-only file system"), "Read-only file system"),
        (FileNotFoundError("x does not exist; run the stage"), "x does not exist; run the stage"),
    ],
)
def test_errors_of_the_user_are_one_line_and_code_2(command, capsys, error, line):
    def run(args):
        raise error

    command(run)
    assert cli.main(["doctor", "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"ddf doctor: error: {line}\n"


def test_a_package_of_an_extra_that_is_not_there_is_one_line(command, capsys):
    def run(args):
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    command(run)
    assert cli.main(["doctor"]) == 2
    error = capsys.readouterr().err
    assert "torch" in error and "pip install" in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "error",
    [ModuleNotFoundError("a bug", name="nothing"), ValueError("a bug"), KeyError("a bug"), RuntimeError("a bug")],
)
def test_bugs_keep_their_traceback(command, error):
    def run(args):
        raise error

    command(run)
    with pytest.raises(type(error), match="a bug"):
        cli.main(["doctor"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["reconstrct", "a.png"], "'reconstrct'; there are mesh, cast, "),
        (["reconstrct", "a.png"], "(did you mean reconstruct?) (see ddf --help)"),
        (["fit", "--minuts=3", "a", "b"], "ddf fit: error: unrecognized arguments: --minuts=3; the options are -h, "),
        (["fit", "--minuts", "3", "a", "b"], "(did you mean --minutes?) (see ddf fit --help)"),
        (["fit", "--kind", "sin", "a", "b"], "'sin'; there are patches, sine (did you mean sine?)"),
    ],
)
def test_unknown_words_are_answered_with_the_nearest(arguments, said, capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(arguments)
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


@pytest.mark.parametrize("arguments", [["nothing"], ["doctor", "--nothing"], ["info"], ["--nothing"]])
def test_wrong_arguments_are_one_line_and_code_2(capsys, arguments):
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    assert caught.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_every_command_has_help_with_examples(name, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main([name, "--help"])
    assert caught.value.code == 0
    shown = capsys.readouterr().out
    assert "--json" in shown and f"examples:\n  ddf {name}" in shown


def test_the_help_names_every_command_in_its_room(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert cli.main([]) == 0
    bare = capsys.readouterr().out
    with pytest.raises(SystemExit) as caught:
        cli.main(["--help"])
    assert caught.value.code == 0 and capsys.readouterr().out == bare
    for name, command in commands.COMMANDS.items():
        assert " ".join(bare.split()).count(f" {name} {command.summary}") == 1
        assert command.room in commands.ROOMS
    assert max(map(len, bare.splitlines())) <= 80


def _fresh(program, *arguments, **environment):
    """A python of its own, with nothing imported yet; standard error goes where it is asked for."""
    command = [sys.executable, *arguments, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, timeout=120)


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_help_imports_no_torch_and_no_picture_library(name):
    done = "print({'torch', 'matplotlib', 'pandas', 'PIL', 'open3d', 'pymeshlab'} & set(sys.modules))"
    result = _fresh(
        f"import sys, ddf.cli\ntry:\n    ddf.cli.main(['{name}', '--help'])\nexcept SystemExit:\n    {done}"
    )
    assert result.stdout.splitlines()[-1] == "set()"


def test_version_is_that_of_the_package_and_imports_nothing_of_it(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"ddf {importlib.metadata.version('directed-distance-fields')}\n"
    done = "print('numpy' in sys.modules)"
    result = _fresh(f"import sys, ddf.cli\ntry:\n    ddf.cli.main(['--version'])\nexcept SystemExit:\n    {done}")
    assert result.stdout.splitlines()[-1] == "False"


def test_negative_values_are_no_options():
    given = ["--camera", "-30,10,.9", "-n", "-5", "--flag", "a", "-.5", "--", "-1"]
    assert frame.with_negative_values(given) == ["--camera=-30,10,.9", "-n-5", "--flag", "a", "-.5", "--", "-1"]
    assert frame.with_negative_values(["--camera=1", "-2"]) == ["--camera=1", "-2"]


@pytest.mark.parametrize("mode", ["utf8=0", "utf8=1"])
@pytest.mark.parametrize("arguments", [[], ["--json"]])
def test_what_an_ascii_terminal_cannot_show_is_escaped(arguments, mode, tmp_path):
    (tmp_path / "stühle.json").write_text(json.dumps({"03001627": ["a", "b"]}))
    program = [sys.executable, "-X", mode, "-c", "import sys, ddf.cli; sys.exit(ddf.cli.main())"]
    ascii_only = {**os.environ, "LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONCOERCECLOCALE": "0"}

    def split(source):
        words = [*program, "split", str(tmp_path / source), "--out", str(tmp_path / "völlig"), *arguments]
        return subprocess.run(words, capture_output=True, env=ascii_only, timeout=120)

    done = split("stühle.json")
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.isascii() and b"/v\\" in done.stdout and b"llig" in done.stdout
    assert (tmp_path / "völlig" / "train_list.txt").exists()
    refused = split("tür")
    assert refused.returncode == 2 and refused.stdout == b""
    assert refused.stderr.isascii() and refused.stderr.count(b"\n") == 1 and b"no such file or folder" in refused.stderr


@pytest.mark.parametrize(("given", "seen"), [(None, "PASSIVE"), ("active", "active")])
def test_threads_wait_without_spinning_unless_the_user_says_otherwise(command, capsys, monkeypatch, given, seen):
    monkeypatch.delenv("OMP_WAIT_POLICY", raising=False)
    if given:
        monkeypatch.setenv("OMP_WAIT_POLICY", given)
    command(lambda args: {"policy": os.environ["OMP_WAIT_POLICY"]})
    assert cli.main(["doctor", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["policy"] == seen


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_one_line_with_what_is_kept_and_the_command_that_goes_on(command, capsys, tmp_path, number):
    command(lambda args: os.kill(os.getpid(), number))
    assert cli.main(["doctor"]) == 128 + number
    assert capsys.readouterr().err == "ddf doctor: interrupted\n"

    def run(args):
        raise processes.Interrupted(number, "step 7 is kept; go on by:")

    command(run)
    assert cli.main(["doctor", "a b"]) == 128 + number
    assert capsys.readouterr().err == "ddf doctor: interrupted: step 7 is kept; go on by: ddf doctor 'a b'\n"


def test_an_interrupted_command_with_a_file_says_that_it_is_not_written(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("ddf.geometry.mesh_io.load_surface", lambda path: os.kill(os.getpid(), signal.SIGINT))
    out = tmp_path / "out.ply"
    assert cli.main(["mesh", "in.obj", str(out)]) == 130
    assert (
        capsys.readouterr().err
        == f"ddf mesh: interrupted: {out} is not written; start again by: ddf mesh in.obj {out}\n"
    )


@pytest.mark.parametrize("link", [None, "symlink_to", "hardlink_to"])
def test_an_output_that_is_an_input_is_refused_under_every_name(tmp_path, capsys, link):
    mesh, out = tmp_path / "a.obj", tmp_path / ("b.obj" if link else "a.obj")
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    np.savez(tmp_path / "r.npz", positions=np.zeros((1, 3)), directions=np.eye(3)[:1])
    if link:
        getattr(out, link)(mesh)
    before, rays = mesh.read_bytes(), str(tmp_path / "r.npz")
    for words in (["mesh", str(mesh), str(out)], ["cast", str(mesh), "--rays", rays, "--out", str(out)]):
        assert cli.main(words) == 2
        assert f"{mesh} is read and would be replaced by the output" in capsys.readouterr().err
    assert cli.main(["cast", str(mesh), "--rays", rays, "--out", rays]) == 2
    assert "r.npz is read and would be replaced" in capsys.readouterr().err and mesh.read_bytes() == before


def test_no_file_that_is_read_is_replaced_in_an_output_folder(tmp_path, capsys):
    lists = tmp_path / "train_list.txt"
    lists.write_text('{"03001627": ["a"]}')
    assert cli.main(["split", str(lists), "--out", str(tmp_path)]) == 2
    assert "is read and would be replaced" in capsys.readouterr().err and lists.read_text() == '{"03001627": ["a"]}'


@pytest.mark.parametrize(
    ("line", "found"),
    [("ddf ren", {"render "}), ("ddf fit a b --min", {"--minutes "}), ("ddf render f o.png --up ", {"y", "z"})],
)
def test_the_shell_is_told_how_a_line_may_go_on(line, found, tmp_path):
    answer = tmp_path / "answer"
    environment = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n"}
    _fresh("import ddf.cli; ddf.cli.main()", **environment, _ARGCOMPLETE_STDOUT_FILENAME=str(answer))
    assert set(answer.read_text().split("\n")) == found


def test_a_folder_that_is_not_there_is_named_before_the_work(tmp_path, capsys):
    (tmp_path / "nothing").mkdir()
    missing = tmp_path / "no" / "such"
    arguments = ["export", str(tmp_path / "nothing"), str(missing / "x.onnx")]
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert (
        error == f"ddf export: error: {missing}/x.onnx: there is no folder {missing}; make it, or add --make-folders\n"
    )
    assert cli.main([*arguments, "--make-folders"]) == 2
    assert missing.is_dir() and "nothing" in capsys.readouterr().err
    assert cli.main(["export", str(tmp_path / "nothing"), str(tmp_path)]) == 2
    assert "not a regular file" in capsys.readouterr().err


def test_doctor_runs_where_nothing_is_installed():
    program = "import sys; sys.modules['torch'] = None; import ddf.cli; sys.exit(ddf.cli.main(['doctor', '--json']))"
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    # -S: without site-packages, as on a machine where the set-up has not run.
    command = [sys.executable, "-S", "-c", program]
    result = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    found = json.loads(result.stdout)
    assert found["ok"] is False
    assert found["packages"]["torch"] is None
    assert "make setup" in [entry["command"] for entry in found["missing"]]
    assert {"avx2", "avx512_bf16"} <= set(found["cpu"]["features"])
    assert found["threads"]["usable"] >= 1
