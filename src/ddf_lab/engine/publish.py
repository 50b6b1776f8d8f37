"""`python -m ddf_lab.engine.publish CONFIG` (`make publish`): the page of a run to reports/, where git keeps it.

Without CONFIG (`make stale`) pages and benchmarks there are listed that other code than today's made: a page keeps in
`code.json` a hash of code and settings of every stage behind it, a benchmark's file one of the code of each row. Words
alone change none. What keeps none is older than this. The first line of a listed page then says so too. One whose
pictures show fields that come with the package says by `inputs.json` which ones.
"""

import hashlib
import json
import shutil
import sys
from pathlib import Path

from ddf.core import processes, provenance, shipped_models, storage
from ddf.fields import model_files
from ddf_lab.engine import graph, stage
from ddf_lab.evaluation import seeds
from ddf_lab.run import Run

CODE, INPUTS, STALE = "code.json", "inputs.json", "Stale, of older code or settings: "
REPORTS, BENCH = Path("reports"), Path("bench")


def publish(run: Run) -> Path:
    """Replace the folder of the experiment by its page; FileNotFoundError: there is none yet."""
    page, out = run.page, REPORTS / run.name
    if not (page / "README.md").is_file():
        raise FileNotFoundError(f"{page}: no page; `ddf run {run.file}` makes it")
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(page, out)
    fits = of_page(run, made=True)
    storage.write_json(out / CODE, fits)
    _say(out / "README.md", [name for name in of_page(run) if name not in fits])
    if "figures" in run.given:
        storage.write_json(out / INPUTS, shipped("field"))
    return out


def _say(page: Path, old: list[str]) -> None:
    """In the first line of a page, which stages behind it are of older code; nothing where none is."""
    text = page.read_text(encoding="utf-8")
    bare = text.partition("\n\n")[2] if text.startswith(STALE) else text
    if (told := f"{STALE}{', '.join(old)}.\n\n{bare}" if old else bare) != text:
        storage.write_text(page, told)


def shipped(kind: str) -> dict[str, str]:
    """Checksum of every model of a kind that comes with the package, by its name: `field` or `reconstruction`."""
    models = (model for model in shipped_models.listed() if model.kind == kind)
    return {model.name: storage.checksum(model.folder / model_files.MODEL) for model in models}


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
            _say(page, found[page.parent])
    for file in sorted(REPORTS.glob("bench/*.json")):
        code, rows = of_bench(next(BENCH.rglob(f"{file.stem}.py"))), storage.read_json(file)["rows"]
        found[file] = [f"{old} of {len(rows)} rows"] if (old := sum(row.get("code") != code for row in rows)) else []
    return [f"{place}: {', '.join(old)}" for place, old in found.items() if old]


def main() -> None:
    """Publish the page of the experiment that is named, or list what is old."""
    lines = [publish(Run.read(sys.argv[1]))] if sys.argv[1:] else listed()
    sys.stdout.write("".join(f"{line}\n" for line in lines))


if __name__ == "__main__":
    raise SystemExit(processes.guarded(main, "publish"))
