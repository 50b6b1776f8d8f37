"""Data: how much there is, what preparation lost, which shapes were left out."""

from ddf.data.public import manifest
from ddf_lab.evaluation import groups
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Block, Section, Table

_CLOUDS = "Shapes, and the true clouds of the test shapes. Hidden points count in the metrics, as in Pixel2Mesh."
_MESHES = "Training meshes. Surface lost: distance from the raw mesh, % of its diagonal, median / largest over meshes."
_READING = "Hidden: no ray from outside meets the point first."


def section(results: Results) -> Section:
    """Two tables, rounding errors, failures."""
    errors = [f"`{name}` {value:.2g}" for name, value in results.largest_packing_errors().items()]
    notes = (_READING, f"Largest rounding errors of the stored samples: {', '.join(errors)}.", *frames(results))
    blocks: list[Block] = [clouds(results), meshes(results), notes]
    if len(results.failures):
        blocks.append(f"{len(results.failures)} shapes were left out:")
        rows = results.failures.to_dict("records")
        blocks.append(tuple(f"`{row['id']}` ({row['stage']}): {row['reason']}" for row in rows))
    else:
        blocks.append("No shape was left out.")
    if results.index["source"] in ("public", "both"):
        blocks += ["Makers of the real shapes, by licence:", makers(results)]
    return Section("Data", blocks)


def makers(results: Results) -> tuple[str, ...]:
    """Who made the real shapes of the experiment, for credit."""
    rows = manifest.of(results.categories)
    names = {
        licence: sorted({row.creator for row in rows if row.licence == licence})
        for licence in {r.licence for r in rows}
    }
    return tuple(f"{licence}: {', '.join(names[licence])}." for licence in sorted(names))


def frames(results: Results) -> list[str]:
    """How far the raw boxes are from those of v1, in which predictions are placed."""
    tables = [table for table in results.measures.values() if "off_centre" in table]
    if not tables:
        return []
    off = max(table["off_centre"].max() for table in tables)
    size = max((table["diagonal"] - 1).abs().max() for table in tables)
    return [f"Raw boxes: at most {off:.1g} off the origin, their diagonals at most {size:.1g} off v1's 1."]


def clouds(results: Results) -> Table:
    """Counts of shapes, and of the points of the true clouds."""
    rows = []
    for group, category in results.groups.items():
        tests = results.shapes[results.shapes["category"] == group]
        trained = list(groups.of_shapes(results.index, category, "train").values()).count(group)
        hidden = f"{100 * tests['hidden_share'].mean():.1f}"
        rows.append([group, str(trained), str(len(tests)), f"{tests['points'].median():,.0f}", hidden])
    header = ["", "train shapes", "test shapes", "points, median", "hidden, %"]
    return Table(_CLOUDS, header, rows)


def meshes(results: Results) -> Table:
    """What the training meshes are and what making them lost."""
    rows = []
    for category in results.index["categories"]:
        measures = results.measures[category]
        lost = [100.0 * measures[name] for name in ("mean_distance_seen", "hausdorff_seen")]
        watertight = f"{int(measures['watertight'].astype(bool).sum())} of {len(measures)}"
        distances = [f"{values.median():.2f} / {values.max():.2f}" for values in lost]
        rows.append([category, watertight, f"{measures['faces'].median():,.0f}", *distances])
    header = ["", "watertight", "triangles, median", "surface lost mean", "surface lost Hausdorff"]
    return Table(_MESHES, header, rows)
