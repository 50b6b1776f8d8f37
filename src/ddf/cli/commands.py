"""The commands of `ddf`: every function that a module below declares is one, by `declare.command`.

What a module imports at its top is what bare help waits for: what takes long to load belongs inside the functions. A
command returns its result, one JSON object with --json, to which `frame` adds what it wrote. Two keys are for people
alone: `table` (label to value, shown instead of the rest) and `verdict` (one line, shown last).
"""

import importlib
import importlib.util

from ddf.cli import declare, doctor, experiments, fields, meshes, models, shapes, views

ROOMS = {"mesh": "meshes and clouds", "field": "fields", "model": "trained models", "experiment": "experiments"}
IN_A_CHECKOUT = ("run", "info")  # those that `ddf_lab` brings
_MODULES = [meshes, shapes, fields, views, models, experiments, doctor]
if importlib.util.find_spec("ddf_lab"):
    _MODULES.append(importlib.import_module("ddf_lab.commands"))
COMMANDS: dict[str, declare.Command] = {each.name: each for module in _MODULES for each in declare.found_in(module)}
