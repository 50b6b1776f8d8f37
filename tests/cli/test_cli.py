"""The command line's frame: JSON alone on stdout, one line for errors, commands imported when they are called."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

import ddf.cli
from ddf.core import checks, stage_notes, storage
from ddf.pipeline import experiment_cost

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def command(monkeypatch):
    """Replaces the command `doctor` by one that does what the test says."""

    def install(run):
        module = SimpleNamespace(add_arguments=lambda parser: parser.add_argument("word", nargs="?"), run=run)
        monkeypatch.setitem(sys.modules, "ddf.cli.doctor", module)

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
            "text": "for people",
        }

    command(run)
    assert ddf.cli.main(["doctor", "hello", "--json"]) == 0
    captured = capfd.readouterr()
    assert json.loads(captured.out) == {
        "word": "hello",
        "nested": {"array": [0, 1], "number": 0.5, "flag": True},
        "infinite": None,
        "path": "a/b",
    }
    assert "native chatter" in captured.err


def test_people_get_lines(command, capsys):
    command(lambda args: {"a": {"b": 1}, "c": "x"})
    assert ddf.cli.main(["doctor"]) == 0
    assert capsys.readouterr().out == "a.b: 1\nc: x\n"
    command(lambda args: {"a": 1, "text": "summary\n"})
    assert ddf.cli.main(["doctor"]) == 0
    assert capsys.readouterr().out == "summary\n"


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
    assert ddf.cli.main(["doctor", "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"ddf doctor: error: {line}\n"


@pytest.mark.parametrize("error", [ValueError("a bug"), KeyError("a bug"), RuntimeError("a bug")])
def test_bugs_keep_their_traceback(command, error):
    def run(args):
        raise error

    command(run)
    with pytest.raises(type(error), match="a bug"):
        ddf.cli.main(["doctor"])


@pytest.mark.parametrize("arguments", [[], ["nothing"], ["doctor", "--nothing"], ["info"], ["--nothing"]])
def test_wrong_arguments_are_one_line_and_code_2(capsys, arguments):
    with pytest.raises(SystemExit) as caught:
        ddf.cli.main(arguments)
    assert caught.value.code == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1


@pytest.mark.parametrize("name", ddf.cli.COMMANDS)
def test_every_command_has_help(name, capsys):
    with pytest.raises(SystemExit) as caught:
        ddf.cli.main([name, "--help"])
    assert caught.value.code == 0
    assert "--json" in capsys.readouterr().out


def test_help_imports_no_command_and_no_torch():
    program = (
        "import sys, ddf.cli\ntry:\n    ddf.cli.main(['--help'])\nexcept SystemExit:\n    print('torch' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout.splitlines()[-1] == "False"


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


def test_info_counts_and_lists(capsys):
    assert ddf.cli.main(["info", str(ROOT / "configs" / "paper.yaml"), "--no-steps", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["parameters"]["ddf"] == 25_647_367
    assert found["parameters"]["pc_siren"] == 25_645_574
    assert found["parameters"]["single_shape"] == 1_581_572
    assert found["stages"][0] == "dataset@paper"
    assert found["stages"][-1] == "report@paper"
    assert "train_ddf@paper-chair" in found["stages"]
    cost = found["cost"]
    assert cost["shapes"] == {"chair": None, "plane": None, "car": None, "all": None} and cost["samples"] is None
    assert cost["per_shape"] == {"samples": 80_000, "bytes": 80_000 * 14 + 8_000 * 13}
    assert cost["disk_bytes"] == {"samples": None, "trainings": 3 * 4 * 4 * (25_647_367 + 25_645_574)}
    assert cost["steps"] == {"ddf": 100_000, "pcsiren": 100_000} and cost["trainings"] == 6
    assert cost["steps_in_all"] == {"ddf": 300_000, "pcsiren": 300_000}
    assert cost["training_time"] is None


def test_info_states_the_time_of_the_trainings_from_measured_steps(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(experiment_cost.os, "cpu_count", lambda: 1)
    before = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    assert ddf.cli.main(["info", str(ROOT / "configs" / "smoke.yaml"), "--json"]) == 0
    assert before == (torch.get_num_threads(), torch.are_deterministic_algorithms_enabled())
    cost = json.loads(capsys.readouterr().out)["cost"]
    assert cost["shapes"] == {"primitives": 12, "all": 12} and cost["samples"] == 12 * 8_000
    time = cost["training_time"]
    assert time["threads"] == 1 and time["device"] in ("cpu", "cuda")
    hours = 0.0
    for name, steps in cost["steps_in_all"].items():
        assert time[name]["step_seconds"] > 0 and 2 <= time[name]["measured_images"] <= time["batch_size"] == 4
        assert time[name]["hours"] == pytest.approx(time[name]["step_seconds"] * steps / 3600)
        hours += time[name]["hours"]
    assert time["hours"] == pytest.approx(hours)


def test_info_counts_the_steps_that_each_category_has(tmp_path):
    path = tmp_path / "mine.yaml"
    text = (ROOT / "configs" / "smoke.yaml").read_text()
    path.write_text(text.replace("step_shares: null", "step_shares: {primitives: 0.5}"))
    cost = experiment_cost.predict(path, measured=False)
    assert cost["steps_in_all"] == {name: round(stated / 2) for name, stated in cost["steps"].items()}


def test_info_counts_the_shapes_that_the_dataset_stage_has_listed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shapes = [{"id": name, "train_views": [0], "test_views": []} for name in "abc"]
    index = {"categories": {"chair": {"synset": "03001627", "shapes": shapes}}}
    storage.write_json(Path("artifacts/paper/dataset/index.json"), index)
    found = experiment_cost.count_shapes(Path("configs/paper.yaml"), {"chair": None, "car": 7})
    assert found == {"chair": 3, "car": 7}


def test_info_names_an_unknown_key(tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text((ROOT / "configs" / "cpu.yaml").read_text().replace("encoder_width:", "encoder_widht:"))
    assert ddf.cli.main(["info", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"ddf info: error: {path}: train: unknown key 'encoder_widht'")
    assert len(error.splitlines()) == 1


def _stage(tmp_path: Path, body: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    script = tmp_path / "do_it.py"
    head = '"""Do it."""\nfrom ddf.core import checks\nfrom ddf.pipeline import stage\n'
    main = "stage.main(run, __doc__, category=True, seed=True)"
    script.write_text(f"{head}def run(config, category, seed):\n    {body}\n{main}\n")
    command = [sys.executable, str(script), *arguments]
    variables = {**os.environ, "PYTHONPATH": str(ROOT / "src"), **environment}
    return subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True)


def test_stage_scripts_pass_arguments_and_note_their_time(tmp_path):
    result = _stage(tmp_path, "print(config, category)", "--config", "configs/a.yaml", "--category", "chair")
    assert (result.returncode, result.stdout, result.stderr) == (0, "configs/a.yaml chair\n", "")
    times = json.loads((tmp_path / stage_notes.time_path(Path("configs/a.yaml"), "do_it", "chair")).read_text())
    assert times["seconds"] >= 0
    assert times["worker_peak_mib"] == 0  # it started none


def test_stage_scripts_note_the_memory_of_their_own_process_and_of_workers(tmp_path):
    spend = "joblib.Parallel(n_jobs=2)(joblib.delayed(bytearray)(n << 20) for n in (1, 300))"
    body = f"import joblib; own = bytearray(200 << 20); own[::4096] = own[::4096]; {spend}"
    result = _stage(tmp_path, body, "--config", "configs/a.yaml", "--category", "chair")
    assert (result.returncode, result.stderr) == (0, "")
    noted = json.loads((tmp_path / stage_notes.time_path(Path("configs/a.yaml"), "do_it", "chair")).read_text())
    assert 200 < noted["peak_mib"]
    assert 300 < noted["worker_peak_mib"]


def test_stages_of_further_seeds_have_a_lock_and_a_time_of_their_own(tmp_path):
    arguments = ("--config", "configs/a.yaml", "--category", "chair", "--seed")
    result = _stage(tmp_path, "print(config, category, seed)", *arguments, "2")
    assert (result.returncode, result.stdout, result.stderr) == (0, "configs/a.yaml chair 2\n", "")
    assert {path.name for path in (tmp_path / "artifacts/a/times").iterdir()} == {
        "do_it-chair-2.json",
        "do_it-chair-2.lock",
    }
    result = _stage(tmp_path, "pass", *arguments, "-1")
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1].endswith("argument --seed: must be a whole number, 0 or more; got '-1'")


def test_stage_scripts_end_with_one_line_and_code_2(tmp_path):
    result = _stage(tmp_path, "raise checks.InputError('no')", "--config", "a.yaml", "--category", "chair")
    assert (result.returncode, result.stderr) == (2, "ddf: error: no\n")
    (tmp_path / "artifacts" / "b").mkdir(parents=True)
    (tmp_path / "artifacts" / "b" / "times").write_text("in the way")
    result = _stage(tmp_path, "pass", "--config", "b.yaml", "--category", "chair")
    assert result.returncode == 2
    assert result.stderr.startswith("ddf: error: ")
    assert len(result.stderr.splitlines()) == 1
