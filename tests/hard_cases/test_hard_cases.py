"""The hard cases, one test per case and type; the page `reports/hard_cases.md` is written from the same list."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import torch

import hard_cases
from ddf.core import checks
from hard_cases import case, fuzz_readers


def _parameters():
    found = []
    for each, dtype in itertools.product(hard_cases.CASES, hard_cases.DTYPES):
        known = each.known.get(dtype)
        marks = [pytest.mark.xfail(reason=known, strict=True)] if known else []
        found.append(pytest.param(each, dtype, id=f"{each.group}-{each.name}-{str(dtype)[6:]}", marks=marks))
    return found


@pytest.mark.parametrize(("hard", "dtype"), _parameters())
def test_hard_case(hard, dtype):
    outcome = hard.check(dtype)
    assert outcome.passed, outcome.came


def test_names_are_unique_and_every_row_is_told():
    names = [(each.group, each.name) for each in hard_cases.CASES]
    assert len(set(names)) == len(names) > 70
    assert all(each.given and each.expected for each in hard_cases.CASES)


def test_committed_page_is_of_this_list():
    page = Path(__file__).resolve().parents[2] / "reports" / "hard_cases.json"
    rows = json.loads(page.read_text(encoding="utf-8"))["rows"]
    listed = [(row["group"], row["case"], row["given"], row["expected"], row["passed"]) for row in rows]
    assert listed == [(c.group, c.name, c.given, c.expected, not c.known) for c in hard_cases.CASES]


@pytest.mark.parametrize("kind", fuzz_readers.others())
def test_broken_files_are_read_or_refused_in_one_line(kind, tmp_path):
    files, read = fuzz_readers.others()[kind]
    found = fuzz_readers.run(100, files, lambda data, _: read(data, tmp_path))
    assert found["read"] and found["refused"] > 50 and found["slowest_s"] < 5


def test_close_allows_so_much_and_no_more():
    assert case.close([1.0, 2.0], [1.0, 2.5], 0.5).passed
    assert not case.close([1.0, 2.0], [1.0, 2.5], [1.0, 0.4]).passed
    assert case.close([np.inf], [np.inf], 0.0).passed
    for found, expected in (([np.nan], [np.nan]), ([np.inf], [-np.inf]), ([np.inf], [1.0]), ([1.0, 1.0], [1.0])):
        assert not case.close(found, expected, 1e9).passed
    assert case.exact(torch.tensor([0.5]), [0.5]).passed
    assert not case.exact(torch.tensor([0.5]), [np.nextafter(0.5, 1)]).passed


def test_an_endless_tolerance_is_refused():
    with pytest.raises(ValueError, match="allowed must be finite"):
        case.close([1.0], [2.0], np.inf)


def _refuse():
    raise checks.InputError("rays must be straight; got a curve")


def test_refusals_need_the_message_and_the_kind():
    assert case.refused(_refuse, "must be straight").passed
    assert not case.refused(_refuse, "must be bent").passed
    assert not case.refused(lambda: 1, "").passed
    with pytest.raises(ZeroDivisionError):
        case.refused(lambda: 1 / 0, "division")


def test_every_and_worst_fail_with_any_of_them():
    good, bad = case.Outcome("fine", True), case.Outcome("broken", False)
    assert case.every(good, good) == case.Outcome("fine", True)
    assert case.every(good, bad) == case.Outcome("fine; broken", False)
    assert case.worst(bad, good, bad) == bad
    assert case.worst(bad, good).passed is False
    assert case.worst(case.Outcome("near", True, 0.9), case.Outcome("far", True, 0.1)).came == "near"
    assert not case.true("so", [True, False]).passed
