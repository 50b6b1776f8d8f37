"""Fingerprints change with configuration, data and code, and with nothing else."""

import sys
import types
from dataclasses import dataclass

import pytest

from ddf.core import provenance


@dataclass(frozen=True)
class Settings:
    faces: int
    names: tuple[str, ...] = ("a",)


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package `ddf` of its own: a imports b (inside a function) and c.d; e is imported by nobody."""
    root = tmp_path / "ddf"
    (root / "c").mkdir(parents=True)
    sources = {
        "__init__.py": '"""Doc."""\n',
        "a.py": '"""Doc."""\nimport os\nfrom ddf.c import d\ndef f():\n    """Doc."""\n    from ddf import b\n',
        "b.py": "X = 1\n",
        "c/__init__.py": "",
        "c/d.py": "import ddf.a\n",
        "e.py": "import ddf.b as b\n",
    }
    for name, text in sources.items():
        (root / name).write_text(text)
        monkeypatch.setitem(sys.modules, f"ddf.{name[0]}", types.SimpleNamespace(__file__=root / name))
    monkeypatch.setattr(provenance, "SOURCES", tmp_path)
    return root


def _names(files) -> list[str]:
    return [file.relative_to(provenance.SOURCES / "ddf").as_posix() for file in files]


def test_closure_follows_every_import_form_and_cycles(package):
    expected = ["__init__.py", "a.py", "b.py", "c/__init__.py", "c/d.py"]
    assert _names(provenance.import_closure(package / "a.py")) == expected
    assert _names(provenance.import_closure(package / "e.py")) == ["__init__.py", "b.py", "e.py"]
    script = package.parent / "script.py"
    script.write_text("from ddf import e\n")
    assert _names(provenance.import_closure(script)) == ["__init__.py", "b.py", "e.py"]


def test_relative_imports_are_refused(package):
    (package / "e.py").write_text("from . import b\n")
    with pytest.raises(ValueError, match=r"e\.py:1: imports must be absolute"):
        provenance.import_closure(package / "e.py")


def _version(root, file: str, text: str) -> str:
    (root / file).write_text(text)
    return provenance.fingerprint(None, (), "ddf.a")


def test_code_version_ignores_comments_and_docstrings_but_not_code(package):
    first = _version(package, "b.py", "X = 1\n")
    assert _version(package, "b.py", '"""New."""\n# comment\nX = 1  # more\n') == first
    assert _version(package, "e.py", "import ddf.b as b\nY = 2\n") == first
    assert _version(package, "b.py", "X = 2\n") != first
    assert _version(package, "b.py", "X = '1'\n") != first
    assert _version(package, "b.py", "X = 1\n") == first


def test_fingerprint_follows_config_sources_and_code(package, tmp_path):
    source = tmp_path / "data.bin"
    source.write_bytes(b"1")
    first = provenance.fingerprint(Settings(3), [source], "ddf.b")
    assert provenance.fingerprint(Settings(3), [source], "ddf.b") == first
    moved = tmp_path / "elsewhere"
    moved.write_bytes(b"1")
    assert provenance.fingerprint(Settings(3), [moved], ["ddf.b"]) == first
    others = [
        provenance.fingerprint(Settings(4), [source], "ddf.b"),
        provenance.fingerprint(Settings(3, ("a", "b")), [source], "ddf.b"),
        provenance.fingerprint(Settings(3), [], "ddf.b"),
        provenance.fingerprint(Settings(3), [source], "ddf.a"),
    ]
    source.write_bytes(b"2")
    others.append(provenance.fingerprint(Settings(3), [source], "ddf.b"))
    assert len({first, *others}) == 6


def test_record_names_sources_with_their_checksums(tmp_path):
    source = tmp_path / "data.bin"
    source.write_bytes(b"")
    empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    record = provenance.record("f", 3, [source])
    made = provenance.fingerprint("f", [source])
    assert record == {"fingerprint": made, "seed": 3, "sources": {source.as_posix(): empty}}
