"""The trainings that test_distributed.py runs on one process and, behind torchrun, on two: `_together.py FOLDER`."""

import dataclasses
import functools
import sys
from pathlib import Path

import _hand_made
import _models
import numpy as np
import torch
from torch import nn

from ddf.core import checks, distributed, storage
from ddf.models import reconstruction_models
from ddf.training import reconstruction_steps, training_loop

STEPS, BATCH = 3, 4
LOOP = dataclasses.replace(_models.LOOP, clip_norm=0.1, checkpoint_seconds=0.0)
TRAIN = dataclasses.replace(_models.TRAIN, loop=LOOP)
KINDS = ("ddf", "pcsiren")


def exact_model():
    """Batch statistics in float64, where sums in another order still agree to ten digits and more."""
    torch.manual_seed(0)
    layers = (nn.Conv2d(3, 5, 3), nn.BatchNorm2d(5), nn.Softplus(), nn.Flatten(), nn.BatchNorm1d(80), nn.Linear(80, 1))
    return nn.Sequential(*layers).double()


def _exact_loss(model, stop_at, step):
    if step == stop_at:
        raise KeyboardInterrupt
    images = torch.from_numpy(np.random.default_rng(step).standard_normal((BATCH, 3, 6, 6)) + 3)
    own = images[distributed.part(BATCH)]
    loss = (model(own)[:, 0] - own.amax((1, 2, 3))).square().mean()
    return loss, {"largest": own.mean()}


def fit_exact(folder, stop_at=None, fingerprint="exact"):
    model = exact_model()
    loss = functools.partial(_exact_loss, model, stop_at)
    groups = [{"params": list(model.parameters())}]
    training_loop.fit(model, groups, loss, STEPS, LOOP, folder, {"fingerprint": fingerprint}, "exact")


def fresh(kind):
    """A reconstruction model and the loss of its steps."""
    torch.manual_seed(0)
    images, shapes, samples = _hand_made.images(), _hand_made.shapes(), _hand_made.samples()
    if kind == "ddf":
        model = reconstruction_models.DDFModel(TRAIN, _hand_made.DDF.field)
        loss = functools.partial(reconstruction_steps.ddf_step, model, images, shapes, samples, TRAIN, _hand_made.DDF)
    else:
        model = reconstruction_models.PCSirenModel(TRAIN)
        loss = functools.partial(reconstruction_steps.pcsiren_step, model, images, shapes, TRAIN, _hand_made.PCSIREN)
    model.camera_head.fit(images.cameras)
    return model, loss


def train_all(folder):
    training_loop.prepare(LOOP, BATCH)
    fit_exact(folder / "exact")
    for kind in KINDS:
        model, loss = fresh(kind)
        groups = model.parameter_groups()
        training_loop.fit(model, groups, loss, STEPS, LOOP, folder / kind, {"fingerprint": kind}, kind)


def _refuse(*_):
    raise AssertionError("only the first process may write")


@distributed.shared
def _together(folder):
    number = distributed.rank()
    training_loop.prepare(dataclasses.replace(LOOP, threads=2), BATCH)
    (folder / f"threads.{number}").write_text(str(torch.get_num_threads()))
    if number:
        storage.save_tensors = storage.write_text = _refuse
    train_all(folder)
    for stop_at in (1, 2, None):
        try:
            fit_exact(folder / "resumed", stop_at)
        except KeyboardInterrupt:
            torch.distributed.barrier()  # a process that is started again comes after the first one's checkpoint
    try:
        fit_exact(folder / "none", fingerprint=f"data of {number}")
    except checks.InputError as error:
        (folder / f"refused.{number}").write_text(str(error))


if __name__ == "__main__":
    _together(Path(sys.argv[1]))
    Path(sys.argv[1], "after").touch(exist_ok=False)  # by one process
