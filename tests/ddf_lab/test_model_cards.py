"""The models that come with the package: small, whole, described, and as good as what they were rounded from."""

import dataclasses
import json
from pathlib import Path

import _models
import pandas as pd
import pytest
import torch
from _support import assert_close

import ddf
from ddf.core import storage
from ddf.data.public import manifest
from ddf.fields import model_files, shape_field, stored_fields
from ddf.fit import latent_prior
from ddf.models import line_field
from ddf_lab import model_cards

ROOT = Path(ddf.__file__).parent / "shipped"
INDEX = json.loads((ROOT / model_cards.INDEX).read_text())["models"]


def test_rounding_halves_matrices_and_keeps_the_rest():
    tensors = {"w": torch.randn(4, 3), "b": torch.randn(4), "n": torch.tensor(3)}
    found = model_files.rounded(tensors)
    assert [found[name].dtype for name in tensors] == [torch.float16, torch.float32, torch.int64]
    assert (found["w"].float() - tensors["w"]).abs().max() <= 2**-11 * tensors["w"].abs().max()
    assert_close(found["b"], tensors["b"])


def test_rounded_weights_are_read_as_float32_and_say_so(tmp_path):
    folder = _models.write_shape_field(tmp_path / "whole")
    file = model_cards.write_weights(folder, tmp_path / "small", {"seed": 3})
    record = storage.load_metadata(file)
    assert (record["weights"], record["seed"]) == ("float16", 3)
    whole, small = shape_field.load(folder).field, shape_field.load(tmp_path / "small").field
    assert {value.dtype for value in small.parameters()} == {torch.float32}
    points = _models.points(200)
    assert_close(small(*points), whole(*points), rtol=1e-2, atol=1e-2)


@pytest.mark.parametrize("entry", INDEX, ids=lambda entry: entry["name"])
def test_every_model_loads_is_small_and_has_a_card(entry):
    folder = ROOT / entry["name"]
    assert {path.name: path.stat().st_size for path in folder.iterdir()} == entry["files"]
    assert sum(entry["files"].values()) <= (1 if entry["kind"] == "field" else 8) * 2**20
    if entry["kind"] == "field":
        field = stored_fields.load(folder)
        assert field.record.get("weights") == ("float16" if isinstance(field, shape_field.ShapeField) else None)
    else:
        model, size, _ = line_field.load_any(folder)
        by_features = isinstance(model, line_field.ImageDDFModel)
        assert size == 64 and all(bool(value.isfinite().all()) for value in model.parameters())
        assert (latent_prior.load(folder).encoder is None) == by_features
        if by_features:
            credits = pd.read_csv(folder / model_cards.SOURCES)
            assert credits["licence"].str.startswith(manifest.FREE).all() and not credits.isna().any(axis=None)
    card = (folder / model_cards.CARD).read_text()
    assert card.startswith(f"# {entry['name']}\n\n{entry['summary']}\n")
    if entry["kind"] != "field":
        public = {row.id: row for row in manifest.of([entry["name"]])}
        titles = pd.read_csv(folder / model_cards.SOURCES)["title"]
        told = model_cards.related([public.get(title) or _row("CC0-1.0", title, entry["name"]) for title in titles])
        assert [line for line in card.splitlines() if "makers" in line] == [f"- {each}" for each in told]
        assert bool(told) == (entry["name"] != "plane") and f"- It makes a {entry['name']} of any object" in card


def test_relatives_of_test_shapes_are_counted_once_and_named():
    tests = {row.family for row in manifest.of(["chair"]) if row.split == "test" and row.family}
    first, second = sorted(tests)[:2]
    near, far = (dataclasses.replace(_row("CC0-1.0", name), family=name) for name in (second, "nobody"))
    other = dataclasses.replace(near, id="other", family=first)
    assert model_cards.related([near, near, far]) == [
        f"1 of 2 shapes of other people are of makers or types of test shapes: {second}."
    ]
    assert model_cards.related([near, other])[0].endswith(f": {first}, {second}.") and not model_cards.related([far])


def _row(licence, creator, category="chair"):
    return manifest.Row(creator + licence, category, "train", "p", "a.obj", "", "x y z", (), licence, creator)


def test_makers_stand_once_below_their_licence():
    assert model_cards.licence([]) == [model_cards.LICENCE]
    seen = [_row("CC-BY-3.0", "Zoe"), _row("CC0-1.0", "Max"), _row("CC-BY-3.0", "Ann"), _row("CC-BY-3.0", "Zoe")]
    first, *makers = model_cards.licence(seen)
    assert "nothing else went in" not in first
    assert makers == ["CC-BY-3.0: Ann, Zoe.", "CC0-1.0: Max."]
