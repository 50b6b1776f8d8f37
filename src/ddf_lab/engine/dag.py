"""The stages of an experiment as a picture that fits a screen: one box a stage, whatever number of items it has."""

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ddf.core import storage
from ddf_lab.engine import experiments, graph

BOX, GAP, MARGIN = (128, 40), (36, 16), 8  # pixels


@dataclass(frozen=True)
class Stage:
    """One box. after: the stages that it waits for, without those that these wait for. layer: as many lie before it."""

    name: str
    items: int
    after: tuple[str, ...]
    layer: int


def write(given: str, changes: Sequence[str], seeds: int) -> tuple[list[str], Path]:
    """Write dag.svg and dag.md to the folder of the experiment; the same as lines of text, and that folder."""
    experiment = experiments.find(given, changes)
    stages = layout(graph.expand(experiment.lists(seeds)))
    folder = Path("artifacts") / experiment.name
    storage.write_text(folder / "dag.svg", svg(stages))
    rows = [(stage.name, str(stage.items), ", ".join(stage.after)) for stage in stages]
    cells = [("stage", "items", "after"), ("---", "--:", "---"), *rows]
    table = "".join(f"| {' | '.join(row)} |\n" for row in cells)
    storage.write_text(folder / "dag.md", f"# Stages of {experiment.name}\n\n![](dag.svg)\n\n{table}")
    width = max(len(stage.name) for stage in stages)
    lines = [f"{name:{width}}  {items:>5}  {after}".rstrip() for name, items, after in [cells[0], *rows]]
    return lines, folder


def layout(items: Sequence[graph.Item]) -> list[Stage]:
    """The stages of the items, each behind all that it waits for."""
    before: dict[str, set[str]] = {}  # directly or not
    found: dict[str, Stage] = {}
    for name in dict.fromkeys(item.stage for item in items):
        own = [item for item in items if item.stage == name]
        direct = {o.stage for o in items for item in own if o.stage != name and o.stage in found and item.follows(o)}
        before[name] = direct.union(*(before[other] for other in direct))
        after = tuple(o for o in found if o in direct and not any(o in before[other] for other in direct))
        layer = 1 + max((found[other].layer for other in direct), default=-1)
        found[name] = Stage(name, len(own), after, layer)
    return list(found.values())


def svg(stages: Sequence[Stage]) -> str:
    """Boxes from left to right, and a line from each to those that wait for it."""
    rows: dict[int, int] = {}
    places: dict[str, tuple[int, int]] = {}
    for stage in stages:
        row = rows.setdefault(stage.layer, 0)
        places[stage.name] = (MARGIN + stage.layer * (BOX[0] + GAP[0]), MARGIN + row * (BOX[1] + GAP[1]))
        rows[stage.layer] += 1
    width, height = (max(place[i] for place in places.values()) + BOX[i] + MARGIN for i in (0, 1))
    lines, boxes = [], []
    for stage in stages:
        x, y = places[stage.name]
        for other in stage.after:
            start, end = places[other][0] + BOX[0], x
            level, own = places[other][1] + BOX[1] // 2, y + BOX[1] // 2
            middle = (start + end) // 2
            lines.append(f'<path d="M{start} {level}C{middle} {level} {middle} {own} {end} {own}"/>')
        count = f" × {stage.items}" if stage.items > 1 else ""
        centre = f'x="{x + BOX[0] // 2}" y="{y + BOX[1] // 2 + 5}"'
        boxes.append(f'<rect x="{x}" y="{y}" width="{BOX[0]}" height="{BOX[1]}" rx="6"/>')
        boxes.append(f"<text {centre}>{html.escape(stage.name + count)}</text>")
    style = (
        "rect{fill:#eef3f8;stroke:#4a6785}path{fill:none;stroke:#4a6785}text{font:14px sans-serif;text-anchor:middle}"
    )
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">'
    return "\n".join([head, f"<style>{style}</style>", *lines, *boxes, "</svg>"]) + "\n"
