"""Portions of long work: made once, found again, and never taken for others."""

import pytest
import torch

from ddf.core import notes

ROWS = [3, 4]


def _made(value, calls):
    def make():
        calls.append(value)
        return {"points": torch.full((len(ROWS), 3), value)}

    return make


def test_portion_is_made_once_and_found_again(tmp_path):
    kept, calls = notes.Portions(tmp_path / "new", "a"), []
    first = kept.get("clouds", ROWS, _made(1.0, calls))
    again = kept.get("clouds", ROWS, _made(2.0, calls))
    assert calls == [1.0]
    assert torch.equal(first["points"], torch.ones(2, 3))
    assert torch.equal(again["points"], first["points"])


@pytest.mark.parametrize(
    ("name", "rows", "fingerprint"), [("cameras", ROWS, "a"), ("clouds", [3, 4, 5], "a"), ("clouds", ROWS, "b")]
)
def test_portion_of_another_step_or_rows_or_fingerprint_is_not_used(name, rows, fingerprint, tmp_path):
    calls = []
    notes.Portions(tmp_path, "a").get("clouds", ROWS, _made(1.0, calls))
    found = notes.Portions(tmp_path, fingerprint).get(name, rows, _made(2.0, calls))
    assert calls == [1.0, 2.0]
    assert float(found["points"].max()) == 2.0


def test_damaged_portion_is_made_again(tmp_path):
    kept, calls = notes.Portions(tmp_path, "a"), []
    kept.get("clouds", ROWS, _made(1.0, calls))
    (path,) = tmp_path.glob("*.safetensors")
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    assert float(kept.get("clouds", ROWS, _made(1.0, calls))["points"].min()) == 1.0
    assert calls == [1.0, 1.0]


def test_work_that_fails_leaves_no_portion(tmp_path):
    def fail():
        raise FloatingPointError

    kept, calls = notes.Portions(tmp_path, "a"), []
    with pytest.raises(FloatingPointError):
        kept.get("clouds", ROWS, fail)
    kept.get("clouds", ROWS, _made(1.0, calls))
    assert calls == [1.0]


def test_clearing_leaves_other_files(tmp_path):
    for fingerprint in "ab":
        notes.Portions(tmp_path, fingerprint).get("clouds", [ord(fingerprint)], _made(1.0, []))
    (tmp_path / "ddf.safetensors").write_text("result")
    notes.Portions(tmp_path, "a").clear()
    assert [path.name for path in tmp_path.iterdir()] == ["ddf.safetensors"]
