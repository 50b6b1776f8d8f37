"""COLLADA files made here, each against the box, the area and the volume that it must have."""

import numpy as np
import pytest
from _shapes import QUADS, area_and_volume

from ddf.core import checks
from ddf.geometry import mesh_io

POINTS = "0 0 0  1 0 0  1 1 0  0 1 0  0 0 1  1 0 1  1 1 1  0 1 1"  # the unit cube


def _words(values):
    return " ".join(str(v) for v in values)


POLYLIST = (
    '<polylist count="6"><input semantic="NORMAL" source="#n" offset="1"/>'
    '<input semantic="VERTEX" source="#v" offset="0"/>'
    f"<vcount>{_words([4] * 6)}</vcount><p>{_words(x for q in QUADS for i in q for x in (i, 0))}</p></polylist>"
)
VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'
TRIANGLES = [t for a, b, c, d in QUADS for t in (a, b, c, a, c, d)]
STRIPS = "".join(f"<p>{_words([a, b, d, c])}</p>" for a, b, c, d in QUADS)
PRIMITIVES = {
    "polylist": POLYLIST,
    "triangles": f'<triangles count="12">{VERTEX}<p>{_words(TRIANGLES)}</p></triangles>',
    "polygons": f'<polygons count="6">{VERTEX}{"".join(f"<p>{_words(q)}</p>" for q in QUADS)}</polygons>',
    "trifans": f'<trifans count="6">{VERTEX}{"".join(f"<p>{_words(q)}</p>" for q in QUADS)}</trifans>',
    "tristrips": f'<tristrips count="6">{VERTEX}{STRIPS}</tristrips>',
}


def _dae(primitives=POLYLIST, nodes='<node><instance_geometry url="#g"/></node>', extra="", points=POINTS, up="Y_UP"):
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="inch" meter="0.0254"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="s"><float_array id="a" count="24">{points}</float_array><technique_common>
<accessor source="#a" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>{primitives}</mesh></geometry></library_geometries>
{extra}<library_visual_scenes><visual_scene id="scene">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>""".encode()


@pytest.mark.parametrize("name", PRIMITIVES)
def test_the_unit_cube_is_read_from_every_kind_of_primitive(name):
    mesh = mesh_io.parse(_dae(PRIMITIVES[name]), ".dae")
    assert len(mesh.faces) == 12 and mesh.remarks == ()
    assert area_and_volume(mesh) == pytest.approx((6.0, 1.0))


NODES = {  # of the unit cube: lower and upper corner, volume
    "<matrix>2 0 0 5 0 0 -1 0 0 1 0 0 0 0 0 1</matrix>": ([5, -1, 0], [7, 0, 1], 2.0),
    "<translate>1 2 3</translate><scale>2 2 2</scale>": ([1, 2, 3], [3, 4, 5], 8.0),
    "<scale>2 2 2</scale><translate>1 2 3</translate>": ([2, 4, 6], [4, 6, 8], 8.0),
    "<scale>-1 1 1</scale>": ([-1, 0, 0], [0, 1, 1], 1.0),
    "<rotate>0 0 2 90</rotate>": ([-1, 0, 0], [0, 1, 1], 1.0),
    "<rotate>1 0 0 -90</rotate>": ([0, 0, -1], [1, 1, 0], 1.0),
}


@pytest.mark.parametrize("transform", NODES)
def test_transforms_apply_in_their_order_and_mirrors_turn_the_triangles(transform):
    lower, upper, volume = NODES[transform]
    mesh = mesh_io.parse(_dae(nodes=f'<node>{transform}<instance_geometry url="#g"/></node>'), ".dae")
    np.testing.assert_allclose(np.stack(mesh.box()), [lower, upper], atol=1e-12)
    assert area_and_volume(mesh)[1] == pytest.approx(volume)


def test_instances_children_and_library_nodes_are_placed_each():
    extra = '<library_nodes><node id="n"><scale>.5 .5 .5</scale><instance_geometry url="#g"/></node></library_nodes>'
    nodes = (
        '<node><translate>10 0 0</translate><instance_geometry url="#g"/><node><translate>0 5 0</translate>'
        '<instance_node url="#n"/></node></node><node><instance_node url="#n"/></node>'
    )
    mesh = mesh_io.parse(_dae(nodes=nodes, extra=extra), ".dae")
    assert len(mesh.faces) == 36 and area_and_volume(mesh)[1] == pytest.approx(1.25)
    np.testing.assert_allclose(np.stack(mesh.box()), [[0, 0, 0], [11, 5.5, 1]])
    np.testing.assert_allclose(mesh.vertices[8:16].min(axis=0), [10, 5, 0])


SKIN = (
    '<library_controllers><controller id="c"><skin source="#g"><bind_shape_matrix>3 0 0 0 0 3 0 0 0 0 3 0 0 0 0 1'
    "</bind_shape_matrix></skin></controller></library_controllers>"
)
TALL = '<node><scale>1 1 4</scale><instance_geometry url="#g"/></node>'
REMARKS = {  # upper corner, and what is said
    "skins are not applied: the mesh is read as modelled": (
        _dae(nodes='<node><instance_controller url="#c"/></node>', extra=SKIN),
        [3, 3, 3],
    ),
    "its up axis is Z_UP; coordinates are as written, not turned": (_dae(nodes=TALL, up="Z_UP"), [1, 1, 4]),
    "primitives of lines are left out": (_dae(f'<lines count="1">{VERTEX}<p>0 1</p></lines>{POLYLIST}'), [1, 1, 1]),
}


@pytest.mark.parametrize("told", REMARKS)
def test_what_is_not_read_is_told(told):
    data, upper = REMARKS[told]
    mesh = mesh_io.parse(data, ".dae")
    assert mesh.box()[1].tolist() == upper and mesh.remarks == (told,)


def test_concave_polygons_are_cut_and_not_fanned():
    points = "0 0 0 2 0 0 2 1 0 1 1 0 1 2 0 0 2 0 9 9 9 9 9 9"
    primitive = f'<polylist count="1">{VERTEX}<vcount>6</vcount><p>2 3 4 5 0 1</p></polylist>'
    mesh = mesh_io.parse(_dae(primitive, points=points), ".dae")
    assert area_and_volume(mesh)[0] == pytest.approx(3.0)


def test_params_name_the_columns_and_strides_are_kept():
    shifted = " ".join(f"9 {z} {y} {x}" for x, y, z in np.array(POINTS.split()).reshape(8, 3))
    data = _dae(PRIMITIVES["triangles"], points=shifted).decode()
    names = '<param name="W"/><param name="Z"/><param name="Y"/><param name="X"/></accessor>'
    head, tail = data.split('stride="3">')
    data = head + 'stride="4">' + names + tail.split("</accessor>", 1)[1]
    assert area_and_volume(mesh_io.parse(data.encode(), ".dae")) == pytest.approx((6.0, 1.0))


HOLE = f'<polygons count="1">{VERTEX}<ph><p>0 1 2 3</p><h>4 5 6</h></ph></polygons>'
LOOP = '<node id="x"><instance_geometry url="#g"/><instance_node url="#x"/></node>'
REFUSED = {
    "hole": (_dae(HOLE), "a polygon has a hole"),
    "spline": (_dae().replace(b"mesh>", b"spline>"), "a geometry is 'spline', not a mesh"),
    "circle": (_dae(nodes=LOOP), "form a circle"),
    "outside": (_dae(nodes='<node><instance_geometry url="b.dae#g"/></node>'), "'b.dae#g' points outside the file"),
    "nothing": (_dae(nodes='<node><instance_geometry url="#h"/></node>'), "there is no geometry 'h'"),
    "negative": (_dae(PRIMITIVES["triangles"].replace("<p>0", "<p>-1")), "indices start at 0"),
    "word": (_dae(PRIMITIVES["triangles"].replace("<p>0", "<p>x")), "'x' is not a whole number"),
    "counts": (_dae(POLYLIST.replace("<vcount>4", "<vcount>5")), "claims 6 of them with 25 corners; 6 with 24"),
    "fewer": (_dae(PRIMITIVES["triangles"].replace('"12"', '"13"')), "claims 13 of them"),
    "number": (_dae(points=POINTS.replace("1", "1_0", 1)), "'1_0' is not a number"),
    "short": (_dae(points=POINTS[:-2]), "8 positions reaches beyond its 23 numbers"),
    "lookat": (_dae(nodes='<node><lookat>1</lookat><instance_geometry url="#g"/></node>'), "a node has a lookat"),
    "entities": (_dae().replace(b"<COLLADA", b'<!DOCTYPE a [<!ENTITY b "c">]><COLLADA', 1), "document type"),
    "cut": (_dae()[:-30], "not readable XML"),
    "root": (b"<svg/>", "its root is 'svg', not COLLADA"),
    "scene": (_dae().replace(b"<scene>", b"<x>").replace(b"</scene>", b"</x>").replace(b"visual_", b"no_"), "no scene"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_rightly_is_refused_with_its_reason(name):
    data, reason = REFUSED[name]
    with pytest.raises(checks.InputError, match=reason):
        mesh_io.parse(data, ".dae")


def test_ids_are_those_of_their_own_geometry_first_and_two_that_could_be_meant_are_refused():
    one = _dae().decode()
    geometry = one[one.index("<geometry") : one.index("</library_geometries>")]
    larger = geometry.replace('id="g"', 'id="h"').replace(POINTS, POINTS.replace("1", "2"))
    both = one.replace(geometry, geometry + larger).replace("<node>", '<node><instance_geometry url="#h"/>')
    assert area_and_volume(mesh_io.parse(both.encode(), ".dae")) == pytest.approx((30.0, 9.0))
    with pytest.raises(checks.InputError, match="two geometry elements have the id 'g'"):
        mesh_io.parse(one.replace(geometry, geometry + geometry).encode(), ".dae")
