"""The training meshes of a category, ready for ray casting."""

import functools
from collections.abc import Sequence
from pathlib import Path

from ddf.core import checks, storage
from ddf.geometry import raycast

OPEN_PACKS = 8  # of training meshes, with their ray casting scenes; a shape of another one costs some 20 ms


class Scenes:
    """The training mesh of each shape, in the field frame, ready for ray casting; a few packs are kept open."""

    def __init__(self, folder: Path, ids: Sequence[str]) -> None:
        """Scenes of the given shapes, in their order, from the packs of stage `meshes`.

        Raises:
          InputError: a shape is in no pack, or a pack is damaged; it is named.
        """
        self.paths = storage.shard_files(folder, ".meshes.safetensors", "meshes")
        places = {name: path for path in self.paths for name in storage.load_metadata(path)["ids"]}
        missing = [name for name in ids if name not in places]
        if missing:
            raise checks.InputError(f"{folder}: no prepared mesh of shape {missing[0]}; run the meshes stage again")
        self._places = [(places[name], name) for name in ids]
        self._open = functools.lru_cache(maxsize=OPEN_PACKS)(_Pack)

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int, /) -> raycast.Scene:
        path, name = self._places[index]
        return self._open(path).scene(name)


class _Pack:
    """The meshes of one pack, each made a scene when it is first asked for."""

    def __init__(self, path: Path) -> None:
        from ddf.data import mesh_shards  # a step that casts no rays runs without its packages

        self._meshes = mesh_shards.read_pack(path).meshes
        self._scenes: dict[str, raycast.Scene] = {}

    def scene(self, name: str) -> raycast.Scene:
        if name not in self._scenes:
            self._scenes[name] = raycast.Scene(self._meshes[name])
        return self._scenes[name]
