"""3MF files made here, each against the box and the volume that it must have; archives that lie are refused."""

import io
import zipfile

import numpy as np
import pytest
from _shapes import QUADS, UNIT_CUBE, area_and_volume

from ddf.core import checks
from ddf.geometry import mesh_io
from ddf.geometry.formats import scenes, threemf

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
FACES = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]
RELS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
    'Target="/3D/other.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>"
)


def _object(key, vertices=UNIT_CUBE, faces=FACES):
    rows = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in vertices)
    rows = f"<vertices>{rows}</vertices>"
    rows += "<triangles>" + "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces) + "</triangles>"
    return f'<object id="{key}" type="model"><mesh>{rows}</mesh></object>'


ONE = _object(1)


def _model(objects=ONE, build='<item objectid="1"/>', head='unit="inch"'):
    return (
        f'<?xml version="1.0"?><model {head} xmlns="{CORE}" xmlns:p="{PRODUCTION}"><resources>{objects}</resources>'
        f"<build>{build}</build></model>"
    )


def _zip(model=None, name="3D/3dmodel.model", **others):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, _model() if model is None else model)
        for other, text in others.items():
            archive.writestr(other, text)
    return stream.getvalue()


BUILDS = {  # in inches, and read as written
    '<item objectid="1" transform="2 0 0 0 2 0 0 0 2 1 2 3"/>': ([1, 2, 3], [3, 4, 5], 8.0),
    '<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>': ([-1, 0, 0], [0, 1, 1], 1.0),
    '<item objectid="1" transform="0 1 0 -1 0 0 0 0 1 0 0 0"/>': ([-1, 0, 0], [0, 1, 1], 1.0),  # a turn: x to y
    '<item objectid="1"/><item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>': ([0, 0, 0], [6, 1, 1], 2.0),
    '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 10 0 0"/>': ([10, 0, 0], [12, 2, 3], 9.0),
}
PARTS = (
    '<object id="2"><components><component objectid="1" transform="2 0 0 0 2 0 0 0 2 0 0 0"/>'
    '<component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 2"/></components></object>'
)


@pytest.mark.parametrize("build", BUILDS)
def test_items_and_components_are_placed_each(build):
    lower, upper, volume = BUILDS[build]
    mesh = mesh_io.parse(_zip(_model(_object(1) + PARTS, build)), ".3mf")
    assert np.stack(mesh.box()).tolist() == [lower, upper]
    assert area_and_volume(mesh)[1] == pytest.approx(volume)


def test_parts_of_the_production_extension_and_named_start_parts_are_followed():
    build = '<item objectid="7" p:path="/3D/Objects/a.model"/>'
    parts = {"_rels/.rels": RELS, "3D/Objects/a.model": _model(_object(7), "", "")}
    data = _zip(_model("", build, 'requiredextensions="p"').replace("unit", "x"), "3D/other.model", **parts)
    assert len(mesh_io.parse(data, ".3mf").faces) == 12


PRUSA = (
    '<config><object id="1"><volume firstid="0" lastid="11"/><volume firstid="12" lastid="23"><metadata type="volume" '
    'key="{}" value="{}"/></volume></object></config>'
)
BAMBU = '<config><object id="2"><part id="1" subtype="normal_part"/><part id="3" subtype="{}"/></object></config>'


@pytest.mark.parametrize(
    ("name", "config", "is_shape"),
    [
        ("Slic3r_PE_model", PRUSA.format("volume_type", "NegativeVolume"), False),
        ("Slic3r_PE_model", PRUSA.format("modifier", "1"), False),
        ("Slic3r_PE_model", PRUSA.format("volume_type", "ModelPart"), True),
        ("model_settings", BAMBU.format("negative_part"), False),
        ("model_settings", BAMBU.format("normal_part"), True),
    ],
)
def test_volumes_of_slicers_that_are_no_shape_are_refused(name, config, is_shape):
    data = _zip(**{f"Metadata/{name}.config": config})
    if is_shape:
        assert len(mesh_io.parse(data, ".3mf").faces) == 12
    else:
        with pytest.raises(checks.InputError, match="negative, modifier or support volumes are not read"):
            mesh_io.parse(data, ".3mf")


def test_support_objects_are_left_out_with_a_remark():
    support = _object(2).replace('"model"', '"support"')
    mesh = mesh_io.parse(_zip(_model(ONE + support, '<item objectid="1"/><item objectid="2"/>')), ".3mf")
    assert (len(mesh.faces), mesh.remarks) == (12, ("support elements are left out",))


@pytest.mark.parametrize(
    ("target", "name", "encoding"),
    [
        ("/3D/my%20part.model", "3D/my part.model", "utf-8"),
        ("3D/my part.model", "3D/my%20part.model", "utf-8"),
        ("/3D/a&amp;b.model", "3D/a&b.model", "utf-8"),
        ("/3D/../3D/Ä.model", "3D\\Ä.model", "utf-16"),
    ],
)
def test_names_of_parts_are_compared_as_opc_says(target, name, encoding):
    rels = f'<?xml version="1.0" encoding="{encoding}"?>' + RELS.replace("/3D/other.model", target)
    assert len(mesh_io.parse(_zip(None, name, **{"_rels/.rels": rels.encode(encoding)}), ".3mf").faces) == 12


def test_what_is_not_built_is_not_read():
    with pytest.raises(checks.InputError, match="no triangles found"):
        mesh_io.parse(_zip(_model(build="")), ".3mf")
    assert len(mesh_io.parse(_zip(_model(_object(1) + _object(2))), ".3mf").faces) == 12


CIRCLE = '<object id="1"><components><component objectid="1"/><component objectid="1"/></components></object>'
LATTICE = 'xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02" requiredextensions="b"'
REFUSED = {
    "zip": (b"PK\3\4 and then nothing", "not a readable 3mf mesh"),
    "part": (_zip(name="a.txt"), "'3d/3dmodel.model' is not in the archive"),
    "circle": (_zip(_model(CIRCLE)), "form a circle"),
    "object": (_zip(_model(build='<item objectid="3"/>')), "names object '3', which is not there"),
    "negative": (_zip(_model(_object(1, faces=[(0, 1, -1)]))), "uses vertex -1"),
    "word": (_zip(_model(_object(1, [["0", "0", "1,5"]]))), "a vertex's coordinate: '1,5' is not a number"),
    "missing": (_zip(_model().replace(' y="0"', "", 1)), "a vertex has no y"),
    "transform": (_zip(_model(build='<item objectid="1" transform="1 0 0"/>')), "must be 12 finite numbers"),
    "extension": (_zip(_model(head=LATTICE)), "beamlattice/2017/02', which is not read"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_rightly_is_refused_with_its_reason(name):
    data, reason = REFUSED[name]
    with pytest.raises(checks.InputError, match=reason) as caught:
        mesh_io.parse(data, ".3mf")
    assert "\n" not in str(caught.value)


def test_archives_that_unpack_without_end_are_stopped(monkeypatch):
    monkeypatch.setattr(scenes, "MAX_BYTES", 4 << 20)
    with pytest.raises(checks.InputError, match="its XML has more than 4194304 bytes"):
        mesh_io.parse(_zip(_model().replace("<build>", " " * (8 << 20) + "<build>")), ".3mf")


def test_many_components_are_stopped_in_time(monkeypatch):
    monkeypatch.setattr(threemf, "_MOST", 2000)
    objects = _object(0)
    for key in range(1, 40):
        inner = f'<component objectid="{key - 1}"/>' * 4
        objects += f'<object id="{key}"><components>{inner}</components></object>'
    with pytest.raises(checks.InputError, match=r"too many|more than 20000000 triangles"):
        mesh_io.parse(_zip(_model(objects, '<item objectid="39"/>')), ".3mf")
