"""The page of hard cases: what goes in, what must come out, what came out in float32 and in float64, pass or fail.

Runs the list that tests/hard_cases runs; writes reports/hard_cases.md and reports/hard_cases.json.
"""

import json
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import torch

from bench.lib import measuring
from ddf.core import storage
from ddf_lab.report import pages

sys.path.insert(0, str(measuring.ROOT / "tests"))  # a package of PyPI is called `tests` too
import hard_cases

OUT = measuring.PAGES
TITLE = "Hard cases"


def run(case: hard_cases.Case, dtype: torch.dtype) -> hard_cases.Outcome:
    """The outcome of one case; a crash is an outcome too."""
    try:
        return case.check(dtype)
    except Exception as error:  # whatever it is, the row fails and tells it
        return hard_cases.Outcome(f"{type(error).__name__}: {error}", False)


def measure(cases: Sequence[hard_cases.Case]) -> list[dict[str, Any]]:
    """One row per case, with an outcome for each type."""
    rows = []
    for case in cases:
        outcomes = {
            str(dtype).removeprefix("torch."): (run(case, dtype), case.known.get(dtype)) for dtype in hard_cases.DTYPES
        }
        rows.append(
            {
                "group": case.group,
                "case": case.name,
                "given": case.given,
                "expected": case.expected,
                "passed": all(outcome.passed for outcome, _ in outcomes.values()),
                "outcomes": {
                    name: {"came": outcome.came, "passed": outcome.passed, "known": known}
                    for name, (outcome, known) in outcomes.items()
                },
            }
        )
    return rows


def page(rows: Sequence[dict[str, Any]], versions: Mapping[str, str | None]) -> pages.Page:
    """A table per group."""
    failed = [row for row in rows if not row["passed"]]
    count = f"{len(rows)} cases in float32 and float64: {len(rows) - len(failed)} pass, {len(failed)} fail."
    told = "ε is the distance from 1 to the next number of the type; *error a of b*: the worst entry, b is allowed."
    packages = ", ".join(f"{name} {version}" for name, version in versions.items())
    lead = [
        count,
        f"Made by `python -m bench hard_cases` ({packages}, one thread) from the list that the tests run. {told}",
    ]
    groups = dict.fromkeys(row["group"] for row in rows)
    return pages.Page(
        TITLE, lead, [_section(group, [row for row in rows if row["group"] == group]) for group in groups]
    )


def _section(group: str, rows: Sequence[dict[str, Any]]) -> pages.Section:
    header = ["case", "what goes in", "what must come out", "float32", "float64", ""]
    lines = []
    for row in rows:
        came = [row["outcomes"][name]["came"] for name in ("float32", "float64")]
        verdict = "pass" if row["passed"] else pages.Cell("fail", best=True)
        lines.append([row["case"], row["given"], row["expected"], *came, verdict])
    passed = sum(row["passed"] for row in rows)
    faults = {f"**{row['case']}**: {o['known']}." for row in rows for o in row["outcomes"].values() if o["known"]}
    table = pages.Table(f"{passed} of {len(rows)} pass.", header, lines, labels=len(header))
    return pages.Section(group.capitalize(), [table, *([tuple(sorted(faults))] if faults else [])])


def main() -> None:
    """Run every case and write both files."""
    torch.set_num_threads(1)
    started = time.perf_counter()
    rows = measure(hard_cases.CASES)
    versions = {name: storage.version_of(name) for name in ("torch", "numpy", "open3d")}
    record = {"versions": versions, "rows": rows}
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "hard_cases.json").write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    (OUT / "hard_cases.md").write_text(pages.markdown(page(rows, versions)), encoding="utf-8")
    print(f"{OUT / 'hard_cases.md'}: {len(rows)} cases, {time.perf_counter() - started:.1f} s")
