"""`python -m ddf_lab.engine.stale` (`make stale`): pages and benchmarks in reports/ that other code than today's made.

A page keeps in `code.json` a hash of code and settings of every stage behind it, a benchmark's file one of the code of
each row. Words alone change none. What keeps none is older than this.
"""

import hashlib
import json
import sys
from pathlib import Path

from ddf.core import errors, provenance, storage
from ddf_lab.engine import graph, stage
from ddf_lab.evaluation import seeds
from ddf_lab.run import Run

CODE, REPORTS, BENCH = "code.json", Path("reports"), Path("bench")


def of_page(run: Run, made: bool = False) -> dict[str, str]:
    """Today's hash of every stage behind a page; `made`: of those alone whose every output is as today's would be."""
    items = graph.expand(run, seeds.read_count(run) if made else 1)
    items = graph.needed(items, [items[-1].stage])
    old = {item.stage for item in items if made and not stage.note(item, stage.checksums(item)).fits()}
    return {item.stage: _hash(stage.made_by(item)) for item in items if item.stage not in old}


def of_bench(file: Path) -> str:
    """Today's hash of a benchmark and all that it imports, of bench/ too; `file` in its folder."""
    root, found, waiting = next(each.parent for each in file.parents if each.name == BENCH.name), set[Path](), [file]
    while waiting:
        found.add(own := waiting.pop())
        names = (name.replace(".", "/") for name in provenance.imported_modules(own) if name.startswith("bench."))
        waiting += [each for name in names if (each := root / f"{name}.py").is_file() and each not in found]
    return _hash([provenance.script_version(each, stage.FRAME) for each in sorted(found)])


def _hash(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:12]


def listed() -> list[str]:
    """A line for each page and file that is old: which stages, how many rows."""
    found = dict[Path, list[str]]()
    for page in sorted(REPORTS.glob("*/README.md")):
        if page.parent.name != BENCH.name:
            told = storage.read_json(kept) if (kept := page.with_name(CODE)).is_file() else {}
            today = of_page(Run.read(page.parent.name))
            found[page.parent] = [name for name, own in today.items() if told.get(name) != own]
    for file in sorted(REPORTS.glob("bench/*.json")):
        code, rows = of_bench(next(BENCH.rglob(f"{file.stem}.py"))), storage.read_json(file)["rows"]
        found[file] = [f"{old} of {len(rows)} rows"] if (old := sum(row.get("code") != code for row in rows)) else []
    return [f"{place}: {', '.join(old)}" for place, old in found.items() if old]


if __name__ == "__main__":
    raise SystemExit(errors.guarded(lambda: sys.stdout.write("".join(f"{line}\n" for line in listed())), "stale"))
