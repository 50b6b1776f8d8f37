"""Settings of fits that take a second: as the section of a config, and as text of its file."""

import dataclasses

from ddf.data.samples import sample_types
from ddf.fields import pddf
from ddf.fit import fit_settings
from ddf.training import training_loop


def counts(count):
    return sample_types.Counts(U=count, A=count, B=count, S=count, T=count, O=count)


TINY = dataclasses.replace(
    fit_settings.DEFAULT,
    field=pddf.PDDFConfig((16, 16), 3.0, 1.0, "softplus", 100.0),
    steps=6,
    minutes=None,
    samples=counts(200),
    held_out=counts(100),
    batch=dict.fromkeys(sample_types.ORDER, 20),
    loop=training_loop.LoopConfig(2e-3, "cosine", 2, 1.0, 1, 0, 2, 100.0),
)
SECTION = {
    "mesh": None,
    "field": {
        "hidden": [16, 16],
        "omega_first": 3.0,
        "omega_hidden": 1.0,
        "depth_activation": "softplus",
        "depth_sharpness": 100.0,
    },
    "steps": 5,
    "minutes": None,
    "samples": dict.fromkeys("UABSTO", 200),
    "held_out": dict.fromkeys("UABSTO", 100),
    "batch": dict.fromkeys("UABSTOE", 20),
    "weights": {
        "depth": 5.0,
        "depth_of": "gated",
        "depth_huber": None,
        "visibility": 1.0,
        "normals": 10.0,
        "weight_variance": 1.0,
        "eikonal_depth": 0.05,
        "eikonal_visibility": 0.01,
        "transition": 0.25,
        "visibility_variance": 0.0,
        "transition_speed": 1.0,
    },
    "epsilon_o": 0.05,
    "box": "tight",
    "margin": 0.02,
    "start": "flat",
    "loop": {
        "learning_rate": 1e-3,
        "schedule": "cosine",
        "warmup_steps": 2,
        "clip_norm": None,
        "threads": 1,
        "seed": 0,
        "log_every": 5,
        "checkpoint_seconds": 100.0,
    },
    "page": {"picture_size": 12, "up": "y", "rays": 50},
    "ablation": {"samples": 600, "held_out": 50, "steps": 3, "minutes": None},
}
