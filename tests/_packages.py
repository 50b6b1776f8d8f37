"""Small Debian packages and archives of shapes, made by hand."""

import hashlib
import io
import tarfile
import zipfile

from PIL import Image

from ddf.data.public import packages

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 2) for y in (0, 1) for z in (0, 1))
FACES = "f 1/1 2/2 4/3 3/4\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
OBJ = f"mtllib a.mtl\n{CUBE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wood\n{FACES}"
MTL = "newmtl wood\nKd 1 0.5 0\nmap_Kd wood.png\n"


def zipped(members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def png(colour=(255, 0, 0)):
    buffer = io.BytesIO()
    Image.new("RGB", (4, 4), colour).save(buffer, "PNG")
    return buffer.getvalue()


def deb(members, name="data.tar.xz", mode="w:xz"):
    """An ar archive as dpkg-deb makes it."""
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode=mode) as archive:
        for path, content in members.items():
            entry = tarfile.TarInfo(f"./{path}")
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    out = b"!<arch>\n"
    for own, content in (("debian-binary", b"2.0\n"), ("control.tar.xz", b"odd"), (name, data.getvalue())):
        out += (
            f"{own:<16}{0:<12}{0:<6}{0:<6}{'100644':<8}{len(content):<10}`\n".encode()
            + content
            + b"\n" * (len(content) % 2)
        )
    return out


def package(data, root="usr/share/pieces"):
    """What is pinned of a package's bytes."""
    return packages.Package("pieces", "1:2.0-1", len(data), hashlib.sha256(data).hexdigest(), root)


def pieces():
    """The members of a package with one textured chair in a nested archive, and files that nobody asked for."""
    inner = {"a/a.obj": OBJ, "a/a.mtl": MTL, "a/wood.png": png(), "a/notes.txt": "x", "b/b.obj": OBJ}
    return {
        "usr/share/pieces/Set.sh3f": zipped(inner),
        "usr/share/pieces/plane/Models/p.ac": b"AC3Db\n",
        "usr/share/pieces/plane/Liveries/red/p.png": png(),
        "usr/share/pieces/plane/Liveries/blue/p.png": png(),
        "usr/share/doc/pieces/copyright": b"free",
    }
