"""Items of the graph side by side: each starts when all that it reads is made; where one fails, the others go on."""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from itertools import groupby

from ddf_lab.engine import graph


def run(
    items: Sequence[graph.Item], jobs: int, start: Callable[[graph.Item], bool], stop: Callable[[], None] = lambda: None
) -> list[graph.Item]:
    """Call `start` for every item whose forerunners succeeded, group by group of stages next to each other.

    Args:
      items: in the order of the graph. jobs: side by side, for stages whose number is not fixed.
      start: does the work; whether it succeeded. stop: ends what runs, where the call is interrupted.
    Returns:
      The items that failed or were left out because of one that did; first those that failed, as they ended.
    """
    failed: list[graph.Item] = []
    left: list[graph.Item] = []
    for together, group in groupby(items, key=lambda item: item.together):
        by_seed = sorted(group, key=lambda item: item.seed)  # the first goes first
        _run_group(by_seed, together or jobs, (start, stop), failed, left)
    return failed + left


@contextlib.contextmanager
def _ended_by(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` where the body is interrupted, before its threads are waited for."""
    try:
        yield
    except KeyboardInterrupt:
        stop()
        raise


def _run_group(
    items: Iterable[graph.Item],
    width: int,
    work: tuple[Callable[[graph.Item], bool], Callable[[], None]],
    failed: list[graph.Item],
    left: list[graph.Item],
) -> None:
    waiting, (start, stop) = list(items), work
    running: dict[futures.Future[bool], graph.Item] = {}
    with futures.ThreadPoolExecutor(width) as pool, _ended_by(stop):
        while waiting or running:
            for item in list(waiting):
                if any(item.follows(other) for other in (*failed, *left)):
                    waiting.remove(item)
                    left.append(item)
                elif len(running) < width and not any(item.follows(o) for o in (*running.values(), *waiting)):
                    waiting.remove(item)
                    running[pool.submit(start, item)] = item
            done, _ = futures.wait(running, return_when=futures.FIRST_COMPLETED)
            failed += [running.pop(future) for future in done if not future.result()]
            running = {future: item for future, item in running.items() if future not in done}
