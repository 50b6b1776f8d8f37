"""What a hard case is, and the few ways in which an answer is judged: a closed form, an exact value, a refusal."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from ddf.core import checks

DTYPES = (torch.float32, torch.float64)


@dataclass(frozen=True)
class Outcome:
    """What came out, in words for the page, and whether that is what must come out.

    share: of the allowed error that was needed, where one was allowed.
    """

    came: str
    passed: bool
    share: float = 0.0


@dataclass(frozen=True)
class Case:
    """One hard case.

    given, expected: what goes in and what must come out, for the page.
    check: runs it with inputs of one type and judges the answer.
    known: by type, why the case fails today; a reason here keeps the row in the page and the test as a strict xfail.
    """

    group: str
    name: str
    given: str
    expected: str
    check: Callable[[torch.dtype], Outcome]
    known: Mapping[torch.dtype, str] = field(default_factory=dict)


class Group:
    """The cases of one part of the package, in the order in which they are written."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.cases: list[Case] = []

    def case(
        self, name: str, given: str, expected: str, known: Mapping[torch.dtype, str] | None = None
    ) -> Callable[[Callable[[torch.dtype], Outcome]], Callable[[torch.dtype], Outcome]]:
        """Decorator: the function below is the check of a new case."""

        def add(check: Callable[[torch.dtype], Outcome]) -> Callable[[torch.dtype], Outcome]:
            self.cases.append(Case(self.name, name, given, expected, check, known or {}))
            return check

        return add


def step(dtype: torch.dtype) -> float:
    """ε, the distance from 1 to the next number of this type."""
    return torch.finfo(dtype).eps


def close(found: Any, expected: Any, allowed: Any) -> Outcome:
    """|found - expected| <= allowed everywhere; equal infinities agree, NaN never does.

    Args:
      allowed: one finite number, or one for each entry; zero asks for the exact value.
    """
    if not np.isfinite(_float64(allowed)).all():
        raise ValueError(f"allowed must be finite; got {allowed}")
    left, right = _float64(found), _float64(expected)
    if left.shape != right.shape:
        return Outcome(f"shape {left.shape}, not {right.shape}", False)
    with np.errstate(invalid="ignore"):
        error = np.where(left == right, 0.0, np.abs(left - right))
    error = np.where(np.isnan(error), np.inf, error)
    bound = np.broadcast_to(_float64(allowed), error.shape)
    if error.size == 0:
        return Outcome("nothing, as asked", True)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(error == 0, 0.0, error / bound)
    worst = np.unravel_index(int(share.argmax()), share.shape)
    if error[worst] == 0:
        return Outcome("exact", True)
    if not np.isfinite(error[worst]):
        return Outcome(f"{left[worst]:.6g}, not {right[worst]:.6g}", False)
    return Outcome(f"error {error[worst]:.1e} of {bound[worst]:.0e}", bool(share[worst] <= 1), float(share[worst]))


def exact(found: Any, expected: Any) -> Outcome:
    """Equal in every entry."""
    return close(found, expected, 0.0)


def true(what: str, holds: Any) -> Outcome:
    """`what` holds for every entry."""
    share = np.asarray(holds.detach().cpu() if isinstance(holds, torch.Tensor) else holds, dtype=bool)
    return Outcome(what if share.all() else f"not {what} ({(~share).sum()} of {share.size})", bool(share.all()))


def refused(call: Callable[[], Any], message: str) -> Outcome:
    """`call` raises InputError with a message in which the pattern `message` is found."""
    try:
        call()
    except checks.InputError as error:
        return Outcome(f"refused: {error}", re.search(message, str(error)) is not None)
    return Outcome("accepted", False)


def every(*outcomes: Outcome) -> Outcome:
    """All of them; each thing that came out is told once."""
    return Outcome("; ".join(dict.fromkeys(o.came for o in outcomes)), all(o.passed for o in outcomes))


def worst(*outcomes: Outcome) -> Outcome:
    """All of them; told are those that fail, or the one that came nearest to it, of equals the last."""
    failed = [o for o in outcomes if not o.passed]
    return every(*failed) if failed else max(reversed(outcomes), key=lambda o: o.share)


def _float64(values: Any) -> np.ndarray:
    if isinstance(values, torch.Tensor):
        values = values.detach().cpu().double().numpy()
    return np.asarray(values, dtype=np.float64)
