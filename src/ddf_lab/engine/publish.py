"""`python -m ddf_lab.engine.publish CONFIG` (`make publish`): the page of a run to reports/, where git keeps it.

Beside it lies what code made it (`stale`); its first line tells what is older than today's. A page whose pictures show
fields that come with the package says by `inputs.json` which ones.
"""

import shutil
import sys
from pathlib import Path

from ddf.core import errors, shipped_models, storage
from ddf.fields import model_files
from ddf_lab.engine import stale
from ddf_lab.run import Run

INPUTS = "inputs.json"


def publish(run: Run, root: Path = Path("reports")) -> Path:
    """Replace the folder of the experiment by its page; FileNotFoundError: there is none yet."""
    page, out = run.page, root / run.name
    if not (page / "README.md").is_file():
        raise FileNotFoundError(f"{page}: no page; `ddf run {run.file}` makes it")
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(page, out)
    fits = stale.of_page(run, made=True)
    storage.write_json(out / stale.CODE, fits)
    if old := [name for name in stale.of_page(run) if name not in fits]:
        text = (out / "README.md").read_text(encoding="utf-8")
        storage.write_text(out / "README.md", f"Stale, of older code or settings: {', '.join(old)}.\n\n{text}")
    if "figures" in run.given:
        storage.write_json(out / INPUTS, shipped("field"))
    return out


def shipped(kind: str) -> dict[str, str]:
    """Checksum of every model of a kind that comes with the package, by its name: `field` or `reconstruction`."""
    models = (model for model in shipped_models.listed() if model.kind == kind)
    return {model.name: storage.checksum(model.folder / model_files.MODEL) for model in models}


if __name__ == "__main__":
    raise SystemExit(errors.guarded(lambda: sys.stdout.write(f"{publish(Run.read(sys.argv[1]))}\n"), "publish"))
