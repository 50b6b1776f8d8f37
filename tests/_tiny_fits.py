"""Settings of fits that take a second: as a dataclass, and as the section of a file."""

import dataclasses

from ddf.data.samples import sample_types
from ddf.fields import pddf
from ddf.fit import fit_settings
from ddf.models import loop_config

TINY = dataclasses.replace(
    fit_settings.FitConfig(),
    field=pddf.PDDFConfig((16, 16), 3.0, 1.0, "softplus", 100.0),
    steps=6,
    minutes=None,
    samples=sample_types.each(200),
    held_out=100,
    batch=dict.fromkeys(sample_types.ORDER, 20),
    loop=loop_config.LoopConfig(2e-3, "cosine", 2, 1.0, 1, 0, 2, 100.0),
)
SPHERE = dataclasses.replace(  # enough for a sphere
    TINY,
    field=pddf.PDDFConfig((48, 48, 48), 3.0, 1.0, "softplus", 100.0),
    steps=500,
    samples=sample_types.each(10_000),
    held_out=1000,
    batch={"U": 250, "A": 250, "B": 125, "S": 60, "T": 60, "O": 60, "E": 20},
    loop=loop_config.LoopConfig(1e-2, "cosine", 20, 1.0, 1, 0, 50, 100.0),
)
SECTION = {
    "field": {"hidden": [16, 16], "omega_first": 3.0, "direction_scale": 1.0},
    "steps": 5,
    "minutes": None,
    "samples": dict.fromkeys("UABSTO", 200),
    "held_out": 100,
    "batch": dict.fromkeys("UABSTOE", 20),
    "weights": {
        "depth_huber": None,
        "normals": 10.0,
        "weight_variance": 1.0,
        "eikonal_depth": 0.05,
        "transition": 0.25,
    },
    "loop": {"learning_rate": 1e-3, "warmup_steps": 2, "clip_norm": None, "threads": 1, "muon": None},
}
