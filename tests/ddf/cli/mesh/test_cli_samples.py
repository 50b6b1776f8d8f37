"""`ddf samples` end to end."""

import json

import pytest

from ddf import cli
from ddf.core import storage


def test_samples_are_the_same_bytes_for_the_same_seed(soup, tmp_path, capfd):
    outs = [tmp_path / f"{i}.safetensors" for i in range(3)]
    for out, seed in zip(outs, ("1", "1", "2"), strict=True):
        assert cli.main(["samples", str(soup), str(out), "--seed", seed, "--count", "400", "--json"]) == 0
    answer = json.loads(capfd.readouterr().out.splitlines()[0])
    assert answer["counts"] == {"U": 400, "A": 400, "B": 200, "S": 200, "T": 200, "O": 200}
    assert outs[0].read_bytes() == outs[1].read_bytes() != outs[2].read_bytes()
    arrays, metadata = storage.load_tensors(outs[0])
    assert arrays["U.positions"].shape == (400, 3) and arrays["O.normals"].shape == (200, 2)
    assert metadata["seed"] == 1 and set(metadata["field_from_raw"]) == {"scale", "rotation", "translation"}


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["samples", "{soup}", "{out}.safetensors", "--count", "0"], "--count"),
        (["samples", "{soup}", "{out}.safetensors", "--epsilon", "-1"], "epsilon_o"),
    ],
)
def test_bad_input_is_one_line_and_code_two(arguments, reason, refuses):
    refuses(arguments, reason)


def test_what_the_reader_left_out_is_said(tmp_path, capfd):
    (tmp_path / "half.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2\nf 1 3 4\n")
    mesh, out = str(tmp_path / "half.obj"), str(tmp_path / "out.safetensors")
    assert cli.main(["samples", mesh, out, "--count", "40"]) == 0
    said = "of the file: 1 faces of fewer than three corners are left out"
    assert capfd.readouterr().out.rstrip().endswith(said)
    assert cli.main(["samples", mesh, out, "--count", "40", "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["left_out"] == [said.split(": ")[1]]
