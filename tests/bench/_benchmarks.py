"""A small benchmark, as it is read from its file."""

import dataclasses

from bench.lib import results

TIMES = (0.010, 0.020, 0.040)


def benchmark(name="training_step", factor=1.0, **changes):
    rows = [
        results.Row(
            f"way {i}",
            {"hidden": [8], "n": i},
            (0.9 * t * factor, t * factor, 1.1 * t * factor),
            {"off": e},
            samples=21,
        )
        for i, (t, e) in enumerate(zip(TIMES, (0.3, 0.2, 0.1), strict=True))
    ]
    return results.Benchmark(name, "a CPU", 2, 2, {"torch": "2"}, [dataclasses.replace(row, **changes) for row in rows])


def changed(benchmark, index, **changes):
    rows = list(benchmark.rows)
    rows[index] = dataclasses.replace(rows[index], **changes)
    return dataclasses.replace(benchmark, rows=rows)
