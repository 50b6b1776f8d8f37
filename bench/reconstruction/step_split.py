"""One optimisation step timed by parts, inside the package's own step: what it calls is wrapped while it runs.

`data` draws the batch, `encoders` are both networks forwards, `field` the value and derivative losses of the DDF or
decoder and Chamfer distance of PC-SIREN, `mask` the rendered mask; `backward` is all of them back.
"""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any
from unittest import mock

from ddf.data.batches import category_data, resident
from ddf.fields import losses, pddf
from ddf.models import encoders, reconstruction_models
from ddf.training import chamfer_loss, training_steps
from ddf_lab.engine import step_cost

# What is wrapped: part of the split, owner, name.
PARTS = (
    ("data", training_steps.Batch, "draw"),
    ("data", category_data.SampleSet, "draw"),
    ("data", resident.Samples, "draw"),
    ("data", category_data.ShapeSet, "subsets"),
    ("encoders", encoders.Encoder, "forward"),
    ("field", losses, "shape_loss"),
    ("field", pddf.PointDecoder, "forward"),
    ("field", chamfer_loss, "chamfer_loss"),
    ("mask", reconstruction_models, "mask_loss"),
)


@contextlib.contextmanager
def split(seconds: dict[str, float]) -> Iterator[None]:
    """While this lasts, the calls named in `PARTS` add their seconds to `seconds`."""

    def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            started = step_cost.now()
            result = function(*arguments, **named)
            seconds[part] = seconds.get(part, 0.0) + step_cost.now() - started
            return result

        return call

    with contextlib.ExitStack() as stack:
        for part, owner, name in PARTS:
            function = timed(part, getattr(owner, name))
            is_class_method = isinstance(vars(owner).get(name), classmethod)
            stack.enter_context(mock.patch.object(owner, name, staticmethod(function) if is_class_method else function))
        yield


def one_step(trial: step_cost.Trial, number: int) -> dict[str, float]:
    """Seconds of the parts of one whole step, of the step itself, and its loss."""
    seconds: dict[str, float] = {}
    times = [step_cost.now()]
    with split(seconds):
        loss, _ = trial.loss(number)
    times.append(step_cost.now())
    trial.optimiser.zero_grad()
    loss.backward()
    times.append(step_cost.now())
    trial.optimiser.step()
    times.append(step_cost.now())
    whole = {"backward": times[2] - times[1], "optimiser": times[3] - times[2], "step": times[3] - times[0]}
    return seconds | {"other": times[1] - times[0] - sum(seconds.values())} | whole | {"loss": float(loss.detach())}
