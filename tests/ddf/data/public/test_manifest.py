"""The manifest of public shapes: plain names, proper frames, and splits by their rule."""

import hashlib
from collections import Counter

import numpy as np
import pytest

from ddf.data import dataset, shapenet
from ddf.data.public import manifest, packages, shapes

CHOSEN = {"chair": 16, "plane": 24, "car": 9}  # categories whose test shapes were chosen, with their number

FREE = {"CC0-1.0", "CC-BY-3.0", "CC-BY-3.0-US"}
LICENCES = FREE | {"CC-BY-SA-3.0", "CC-BY-SA-4.0", "GPL-2.0-only", "GPL-2.0-or-later", "EPL-2.0 OR GPL-2.0-or-later"}


def test_rows_have_plain_unique_ids_known_places_and_licences():
    rows = manifest.rows()
    assert len({row.id for row in rows}) == len(rows) > 400
    for row in rows:
        shapenet.check_name(row.id, "manifest")
        assert row.category in shapenet.SYNSETS and row.package in packages.PACKAGES and row.creator
        assert row.licence in LICENCES and row.free == (row.licence in FREE)
        assert ".." not in row.path and not row.path.startswith("/") and (not row.looks or row.looks.endswith("/"))
        assert np.linalg.det(shapes.turned(row.axes)) == pytest.approx(1)


def test_splits_follow_the_hash_of_the_id_but_for_the_chosen_test_shapes():
    rows = manifest.rows()
    tests = Counter(row.category for row in rows if row.split == "test")
    assert {name: tests[name] for name in CHOSEN} == CHOSEN
    for row in rows:
        share = int(hashlib.sha256(row.id.encode()).hexdigest()[:8], 16) / 2**32
        by_hash = "validation" if share < 0.15 else "train"
        if row.category not in CHOSEN and share >= 0.8:
            by_hash = "test"
        assert row.split == by_hash or (row.split == "test" and row.category in CHOSEN), row.id


def test_no_maker_and_no_type_of_aircraft_is_on_both_sides_of_an_experiment():
    rows = manifest.rows()
    used = dataset.DatasetConfig(source="public", categories=dict.fromkeys(CHOSEN)).rows()
    tested = [row for row in rows if row.category in CHOSEN and row.split == "test"]
    assert [row for row in used if row.split == "test"] == tested
    others = [row for row in used if row.split != "test"]
    assert not {row.family for row in others if row.family} & {row.family for row in tested}
    makers = {(row.category, row.creator) for row in others if not row.creator.endswith(" authors")}
    assert not makers & {(row.category, row.creator) for row in tested}
    left_out = {row.id for row in rows if row.category in CHOSEN} - {row.id for row in used}
    assert len(left_out) == 31 and {"735__735", "c182rg__c182rg", "SF3__SF3"} <= left_out


@pytest.mark.real
def test_every_shape_of_a_kept_package_reads_upright_with_colours(monkeypatch):
    kept = [package for package in packages.PACKAGES.values() if packages.has(package, manifest.wanted(package.name))]
    if not kept:
        pytest.skip("no package of shapes is kept; `ddf shapes get`")
    for package in kept:
        with packages.reading(packages.kept(package)) as archive:
            own = [row for row in manifest.rows() if row.package == package.name]
            for row in own[:: max(len(own) // 3, 1)]:
                shape = shapes.shape(shapes.load(archive, row))
                sides = np.ptp(shape.vertices, axis=0)
                assert np.linalg.norm(sides) == pytest.approx(1, abs=1e-6), row.id
                assert 0 <= shape.colours.min() and shape.colours.max() <= 1
                if row.category == "plane":
                    assert sides[1] < min(sides[0], sides[2]), row.id
                if row.category == "car":
                    assert sides[0] > max(sides[1], sides[2]), row.id
