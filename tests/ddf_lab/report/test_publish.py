"""Pages move to reports/ whole, and without what was there before."""

import json

import pytest

from ddf_lab.report import publish
from ddf_lab.run import Run


def test_a_page_replaces_the_one_before(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = Run(tmp_path / "own.yaml", {"figures": []})
    with pytest.raises(FileNotFoundError, match=r"artifacts/own/report: no page; `ddf run .*own\.yaml` makes it"):
        publish.publish(run)
    run.page.mkdir(parents=True)
    for name in ("README.md", "a.webp"):
        (run.page / name).write_text(name)
    (tmp_path / "reports" / "own").mkdir(parents=True)
    (tmp_path / "reports" / "own" / "old.svg").write_text("")
    out = publish.publish(run)
    assert {path.name for path in out.iterdir()} == {"README.md", "a.webp", publish.INPUTS}
    assert json.loads((out / publish.INPUTS).read_text()) == publish.shipped("field")
    assert {"rabbit", "nested"} <= publish.shipped("field").keys()
