"""The items that further seeds add to pipeline.yaml; make calls `python -m ddf.pipeline.further_seeds NAME SEEDS`.

They go to params.yaml, which the engine merges into the lists `runs` and `evaluations` when it is there. Seed 0 is in
pipeline.yaml itself and stays as it is whatever SEEDS says.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

PIPELINE, ADDED = Path("pipeline.yaml"), Path("params.yaml")
LISTS = ("runs", "evaluations")

Items = dict[str, dict[str, Any]]


def further(lists: Mapping[str, Items], name: str, seeds: int) -> dict[str, Items]:
    """For every item of experiment `name` one for each seed from 1 to seeds - 1, `cpu-chair-1` for `cpu-chair`."""
    return {
        group: {
            f"{key}-{seed}": item | {"option": f" --seed {seed}", "folder": f"_seeds/{seed}"}
            for seed in range(1, seeds)
            for key, item in lists[group].items()
            if item["config"] == name
        }
        for group in LISTS
    }


def main(name: str, seeds: str) -> None:
    """Write params.yaml; every call replaces what an earlier one wrote."""
    lists = yaml.safe_load(PIPELINE.read_text(encoding="utf-8"))["vars"][0]
    text = yaml.safe_dump(further(lists, name, int(seeds)), sort_keys=False)
    ADDED.write_text(f"# Written by make: the stages of further seeds (SEEDS={seeds})\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
