"""Meshes of any makers looked over, turned and kept as own shapes: what `ddf shapes add` does.

A folder of own shapes has `<category>/<id>.ply`, in the frame of ShapeNet v1 and facing X, and `manifest.FILE`.
"""

import functools
import hashlib
import logging
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from ddf.core import checks, seeding, storage
from ddf.data import mesh_preparation, mesh_topology, shapenet
from ddf.data.public import manifest, packages, shapes
from ddf.data.samples.draws import Surface
from ddf.data.synthetic import assemble, parts, render
from ddf.geometry import mesh_io, raycast

LOGGER = logging.getLogger(__name__)
SHARES = {"test": 0.1, "validation": 0.15}  # of a category, whole makers each
FLAT = 0.01  # of the diagonal: a box whose shortest side is shorter holds a sheet
NEAR = 0.003  # of the diagonal: copies, also coarser or of another hand, are nearer; two types of airliner are not
FACES = 50_000  # that are kept; the stage `meshes` keeps fewer
_AXIS = re.compile(r"[+-]?[xyz]", re.IGNORECASE)
_WORDS = {"up": ("axis", _AXIS), "front": ("axis", _AXIS), "split": ("side", re.compile("|".join(manifest.SPLITS)))}
_HIDDEN = re.compile(r"\.|__MACOSX")

Entry = dict[str, str]


def listed(source: Path, given: Mapping[str, str]) -> list[Entry]:
    """What there is to add: the meshes in a folder and below, or the lines of its manifest, or of a manifest;
    InputError where there is none, or one has no category.

    Args:
      given: category, up and front, where a manifest gives none; of its lines only those of a given category.
    """
    table, wanted, found = source / manifest.FILE if source.is_dir() else source, given["category"], list[Entry]()
    if source.is_dir() and not table.is_file():
        files = (path.relative_to(source) for path in sorted(source.rglob("*")) if path.suffix.lower() in mesh_io.READ)
        lines = [{"file": str(path), "category": wanted} for path in files if not any(map(_HIDDEN.match, path.parts))]
    else:
        lines = manifest.entries(table, ["file"])
    for line in lines:
        folder = Path(line["file"]).parent.name
        category = line["category"] or (folder if folder in shapenet.SYNSETS else wanted)
        shapenet.check_name(category, f"{table}: {line['file']}: give --category, or a column `category`")
        words = {name for name, (_, known) in _WORDS.items() if line.get(name) and not known.fullmatch(line[name])}
        said = {name: value for name, value in line.items() if value and name not in words}
        note = "; ".join(f"{name} {line[name]!r} is no {_WORDS[name][0]}" for name in sorted(words))
        fixed = {"file": str((table.parent / line["file"]).resolve()), "category": category, "note": note}
        if wanted in ("", category):
            found.append(dict.fromkeys(manifest.COLUMNS, "") | dict(given) | said | fixed)
    if not found:
        raise checks.InputError(f"{source}: has no mesh{wanted and ' of category '}{wanted}")
    return found


def look_over(entry: Entry) -> tuple[Entry, mesh_io.Mesh]:
    """An entry with what was found, and its mesh, welded, in the frame of ShapeNet v1, ahead along X; InputError where
    it cannot be read, is flat, or its front is up.
    """
    path = Path(entry["file"])
    ahead, above = shapes.turned(f"{entry['front']} {entry['up']}".lower())
    if ahead @ above:
        raise checks.InputError(f"front must be another axis than up; got {entry['front']} and {entry['up']}")
    raw = mesh_io.load_surface(path)
    mesh = mesh_topology.clean(raw)
    turned = mesh.vertices @ np.stack([ahead, above, np.cross(ahead, above)]).T
    mesh = mesh_preparation.decimate(mesh_io.Mesh(assemble.normalise(turned), mesh.faces), FACES)
    thinnest = np.ptp(mesh.vertices, axis=0).min()
    if thinnest < FLAT:
        raise checks.InputError(f"flat: its box is {thinnest:.2g} of its diagonal thick, must be {FLAT:g}")
    name = f"{manifest.OWN}-{re.sub(r'[^A-Za-z0-9]+', '_', path.stem)[:40]}-{storage.checksum(path)[:6]}"
    pieces, openings = mesh_topology.components(mesh).max() + 1, len(mesh_topology.opening_loops(mesh))
    found = {"id": name, "faces": str(len(mesh.faces)), "pieces": str(pieces), "openings": str(openings)}
    return entry | found | {"note": "; ".join(filter(None, (entry["note"], *raw.remarks)))}, mesh


@dataclass(frozen=True)
class Known:
    """A shape that others are compared with, in the frame of ShapeNet v1."""

    name: str
    mesh: mesh_io.Mesh

    @functools.cached_property
    def _scene(self) -> raycast.Scene:
        return raycast.Scene(self.mesh)

    @functools.cached_property
    def _points(self) -> Float[np.ndarray, "n 3"]:
        return Surface.of(self.mesh).draw(500, seeding.generator(0, "copies", self.name))[0]

    def distance(self, other: "Known") -> float:
        """The larger mean distance of points of one surface to the other, least of four turns; inf of unlike boxes."""
        apart, sides = [np.inf], np.ptp(self.mesh.vertices, axis=0)
        for quarter in range(4):
            turn = parts.rotation("y", quarter * np.pi / 2).round()
            if np.abs(sides @ np.abs(turn) - np.ptp(other.mesh.vertices, axis=0)).max() < 0.04:
                there, back = other._scene.distance(self._points @ turn), self._scene.distance(other._points @ turn.T)
                apart.append(float(max(there.mean(), back.mean())))
        return min(apart)


def of_others(categories: Collection[str]) -> list[Known]:
    """The shapes of `ddf shapes`; those that were not fetched are told."""
    rows, found = manifest.of(categories), list[Known]()
    for row in rows:
        package = packages.PACKAGES[row.package]
        if packages.has(package, [row.path]):
            with packages.reading(packages.kept(package)) as archive:
                shape = shapes.shape(shapes.load(archive, row))
            found.append(Known(row.id, mesh_io.Mesh(shape.vertices, shape.triangles)))
    if len(found) < len(rows):
        LOGGER.warning("not compared with %d shapes that `ddf shapes get` fetches", len(rows) - len(found))
    return found


def add(out: Path, source: Path, given: Mapping[str, str]) -> tuple[list[Entry], list[str]]:
    """Look over meshes and keep those that can be used, beside those that `out` has; InputError where none can.

    Args:
      out: folder of own shapes. source, given: as of `listed`.
    Returns:
      The entries of those that were kept now, and a line for each of those that were not, which is told at once.
    """
    wanted, table, taken, left_out = listed(source, given), out / manifest.FILE, dict[str, Entry](), list[str]()
    before = manifest.entries(table) if table.is_file() else []
    sides = {entry["id"]: entry["split"] for entry in before}
    files = {entry["file"] for entry in wanted if Path(entry["file"]).is_file()}  # one that is gone stays as it was
    others = [entry for entry in before if entry["file"] not in files]
    known = of_others({entry["category"] for entry in wanted})
    known += [Known(entry["id"], mesh_io.load(place(out, entry))) for entry in others]
    for each in wanted:
        try:
            entry, mesh = look_over(each)
            one, path = Known(entry["id"], mesh), place(out, entry)
            compared = (other for other in known if other.name != one.name or one.name in taken)
            apart, copied = min(((other.distance(one), other.name) for other in compared), default=(np.inf, ""))
            if apart <= NEAR:
                raise checks.InputError(f"a copy of {copied}, {apart:.2%} of the diagonal away on average")
        except (checks.InputError, OSError) as fault:
            left_out.append(f"{each['file']}: {str(fault).removeprefix(each['file'] + ': ')}")
            LOGGER.warning("%s", left_out[-1])
            continue
        known.append(one)
        storage.write_bytes(path, mesh_io.ply_bytes(mesh))
        found = {"checksum": storage.checksum(path), "split": entry["split"] or sides.get(one.name, "")}
        taken[one.name] = entry | found
    if not taken:
        raise checks.InputError(f"{source}: not one of {len(wanted)} meshes can be used; the lines above say why")
    every = split([entry for _, entry in sorted(({entry["id"]: entry for entry in others} | taken).items())])
    storage.write_rows(table, [manifest.COLUMNS, *([entry[name] for name in manifest.COLUMNS] for entry in every)])
    for gone in {place(out, entry) for entry in before} - {place(out, entry) for entry in every}:
        gone.unlink(missing_ok=True)
    return [entry for entry in every if entry["id"] in taken], left_out


def place(out: Path, entry: Entry) -> Path:
    """The mesh of an entry of a folder of own shapes."""
    return out / entry["category"] / f"{entry['id']}.ply"


def views(out: Path, entry: Entry) -> list[UInt8[np.ndarray, "137 137 4"]]:
    """The mesh of an entry from its front, a little from above, and from its side: ahead is to the right."""
    renderer = render.Renderer(shapes.shape(shapes.plain(mesh_io.load(place(out, entry)))))
    return [renderer.render(render.View(20.0, 20.0, 0.7)), renderer.render(render.View(90.0, 5.0, 0.7))]


def split(entries: Sequence[Entry]) -> list[Entry]:
    """The entries by category, each with a side; those that have one keep it, the others follow their maker.

    New makers come in the order of their names' SHA-256 and test, else validate, where `SHARES` has room for all of
    theirs. A shape without an author is a maker of its own, and so is each where one author made more than half.
    """
    found = list[Entry]()
    for category in sorted({entry["category"] for entry in entries}):
        own = [entry for entry in entries if entry["category"] == category]
        alone = Counter(entry["author"] or entry["id"] for entry in own).most_common(1)[0][1] > len(own) / 2
        makers = {entry["id"]: entry["id"] if alone else entry["author"] or entry["id"] for entry in own}
        sides = {makers[entry["id"]]: entry["split"] for entry in own if entry["split"]}
        room = {side: max(round(share * len(own)), int(len(own) > 2)) for side, share in SHARES.items()}
        room = {side: places - sum(entry["split"] == side for entry in own) for side, places in room.items()}
        counts = Counter(makers.values())
        for maker in sorted(counts.keys() - sides.keys(), key=lambda name: hashlib.sha256(name.encode()).digest()):
            sides[maker] = next((side for side, places in room.items() if counts[maker] <= places), "train")
            room |= {sides[maker]: room.get(sides[maker], 0) - counts[maker]}
        found += [{**entry, "split": entry["split"] or sides[makers[entry["id"]]]} for entry in own]
    return found
