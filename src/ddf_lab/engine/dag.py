"""The stages of an experiment as lines of text, one a stage, whatever number of items it has."""

from collections.abc import Sequence

from ddf_lab.engine import graph


def lines(items: Sequence[graph.Item]) -> list[str]:
    """A heading, then name, items and what it waits for of every stage; without those that the latter wait for."""
    before: dict[str, set[str]] = {}  # directly or not
    rows = [("stage", "items", "after")]
    for name in dict.fromkeys(item.stage for item in items):
        own = [item for item in items if item.stage == name]
        direct = {o.stage for o in items for item in own if o.stage != name and o.stage in before and item.follows(o)}
        after = [o for o in before if o in direct and not any(o in before[other] for other in direct)]
        before[name] = direct.union(*(before[other] for other in direct))
        rows.append((name, str(len(own)), ", ".join(after)))
    width = max(len(name) for name, _, _ in rows)
    return [f"{name:{width}}  {count:>5}  {after}".rstrip() for name, count, after in rows]
