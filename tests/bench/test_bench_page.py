"""The page of the benchmarks: lines, pictures, what matters most, notes."""

import dataclasses

import pytest
from _benchmarks import benchmark, changed

from bench.data import sample_extraction
from bench.fields import field_inference, rendering
from bench.lib import page, pareto, results
from ddf_lab.report import pages


def test_page_has_a_line_per_row_and_a_picture_where_there_is_an_error():
    found = {
        "training_step": changed(benchmark(error={"gradient_relative": 1e-6}), 0, error={"gradient_relative": 0.0})
    }
    text = pages.markdown(made := page.page(found))
    assert list(made.files) == ["training_step_pareto.png"]
    assert made.files["training_step_pareto.png"].startswith(b"\x89PNG")
    assert "![training step: ms against" in text and "What matters most" not in text
    assert text.count("| way ") == 3 and "a CPU, 2 cores, 2 threads; torch 2." in text
    assert "| 2 | way 1 | 1 | 20 | 18 – 22 | 1.40 | 1e-06 |" in text
    assert page.page(found).files == made.files


@pytest.mark.parametrize("error", [{}, {"gradient_relative": 0.0}])
def test_page_without_an_error_to_draw_is_a_table(error):
    made = page.page({"training_step": benchmark(error=error)})
    assert made.files == {} and pages.markdown(made).count("| way ") == 3


def test_what_a_benchmark_drew_itself_is_shown():
    assert "(training_step.png)" in pages.markdown(page.page({"training_step": benchmark()}, ["training_step.png"]))


def test_pages_of_their_own_share_a_line():
    found = {name: benchmark(name) for name in ("fit_curves", "growth", "primitive_fits", "training_step")}
    (line,) = page.page(found).lead[1:]
    assert (
        line == "On pages of their own: [fit curves, primitive fits](../fit_proof/README.md); [growth](../growth.md)."
    )
    assert len(page.page({"training_step": benchmark()}).lead) == 1


def test_clouds_come_first_with_measured_figures():
    def row(category, directions, cycles, seconds, score):
        size = {"num_directions": directions, "cycles": cycles, "jitter": 0.0, "points": 5000}
        return results.Row(category, size, (seconds,) * 3, {"f_score_tau_x100": score})

    grid = [(4, 1, 1.0, 40.0), (48, 3, 4.0, 70.0), (128, 3, 16.0, 66.0)]
    rows = [row(category, n, h, t, f + up) for category, up in (("chair", 0), ("car", 10)) for n, h, t, f in grid]
    clouds = dataclasses.replace(benchmark("cloud_sampling"), rows=rows)
    made = page.page({"cloud_sampling": clouds, "training_step": benchmark()})
    picture, sentences = made.sections[0].blocks[:2]
    assert isinstance(sentences, tuple) and isinstance(picture, pages.Figure)
    (sentence,) = sentences
    assert "of 3 settings 2 are on the frontier, from 4 directions and 1 cycle (1 s, F(τ) × 100 = 45.0)" in sentence
    assert "48 directions and 3 cycles (4 s, F(τ) × 100 = 75.0)" in sentence
    assert "the paper's way is 128 directions and 3 cycles (16 s, F(τ) × 100 = 71.0)" in sentence
    assert picture.name == "cloud_sampling_pareto.png"
    assert pages.markdown(made).count("](cloud_sampling_pareto.png)") == 1


def test_rendering_names_the_fastest_tracing_that_is_as_good():
    """Every pixel against every pixel; the refined DDF against refined tracing too."""

    def row(what, seconds, median, wrong=0.01):
        error = {"depth_median": median, "wrong_visibility": wrong}
        told = {"times_ddf": seconds / 0.1}
        return results.Row(what, {"pixels_a_side": 256}, (seconds,) * 3, error, told)

    def sentence(*more):
        return rendering.rendering_sentence(dataclasses.replace(benchmark(), rows=[*rows, *more])) or ""

    rows = [row("DDF", 0.1, 0.01), row("sphere tracing, 8 steps", 0.5, 0.02), row("mesh casting", 0.05, 1e-7)]
    told = sentence(row("sphere tracing, 9 steps", 0.4, 0.005, wrong=0.02))
    assert "no sphere tracing of a network of the same size as good, nearest sphere tracing, 9 steps" in told
    rows += [row("sphere tracing, 64 steps", 1.5, 0.009), row("sphere tracing, 64 steps, refined", 0.8, 0.009)]
    first = "the fastest tracing as good, sphere tracing, 64 steps (1,500 ms, median error of depth 0.009), 15 times"
    assert first in sentence()
    rows.append(row("DDF, refined", 0.05, 0.011))
    told = sentence()
    assert first in told and told.endswith("; mesh casting (50 ms, median error of depth 1e-07).")
    assert "; DDF, refined (50 ms, median error of depth 0.011), the fastest tracing as good, " in told
    assert "sphere tracing, 64 steps, refined (800 ms, median error of depth 0.009), 16 times as long" in told


def test_notes_hold_measured_times_against_their_goals():
    def row(what, size, seconds, **told):
        return results.Row(what, size, (seconds,) * 3, {}, told)

    shape = {"shape": "cube", "counts": "cpu", "threads": 1}
    rows = [row("Open3D alone, scene built", shape, 0.01), row("samples, file written", shape, 0.023)]
    note = sample_extraction.extraction_note(dataclasses.replace(benchmark("sample_extraction"), rows=rows)) or ""
    assert "its scene built: on 1 core cube (cpu) 2.3. The goal is at most 2." in note
    assert sample_extraction.extraction_note(dataclasses.replace(benchmark(), rows=rows[:1])) is None

    size = {"width": 128, "outputs": ["visibility", "depth"]}
    kinds = (("torch", 0.2), ("torch.compile", 0.1), ("onnxruntime", 0.12), ("onnxruntime", 0.11))
    rows = [row("", size, seconds, runtime=runtime, precision="float32") for runtime, seconds in kinds]
    rows.append(row("", size, 0.01, runtime="onnxruntime", precision="int8"))
    note = field_inference.runtimes_note(dataclasses.replace(benchmark("field_inference"), rows=rows)) or ""
    assert "two threads: visibility and depth: 1.1 (width 128). The goal is at most 1." in note


def test_pictures_take_exact_and_equal_points():
    points = [pareto.Point(1, "a", 0.1, 0.0), pareto.Point(2, "b", 0.1, 0.0), pareto.Point(3, "c", 0.01, 0.5)]
    panels = [pareto.Panel("one", "error", "ms", points)] * 4
    assert pareto.draw(panels) == pareto.draw(panels)
