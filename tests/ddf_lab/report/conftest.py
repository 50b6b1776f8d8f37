"""A small experiment, evaluated and reported: once with one seed, once with two."""

import contextlib
import dataclasses
import shutil

import pytest
from _experiment_report import experiment_run, make
from _fake_experiment import FakeExperiment

from ddf.core import storage
from ddf_lab.evaluation import scoring, seeds
from ddf_lab.report import experiment_page, stage_results


@pytest.fixture(autouse=True)
def _current_folder(request, monkeypatch):
    """That of the experiment, for the tests that use it."""
    if "reported" in request.fixturenames:
        monkeypatch.chdir(request.getfixturevalue("reported")[2].parents[2])


@pytest.fixture(scope="session")
def reported(tmp_path_factory):
    """A finished experiment with categories of which the paper knows two."""
    root = tmp_path_factory.mktemp("report")
    experiment = FakeExperiment(root, categories=("chair", "plane", "primitives"), train=4, test=2)
    with contextlib.chdir(root):
        run = experiment_run(experiment)
        make("evaluate", run)
        make("report", run)
    return experiment, run, root / run.page


@pytest.fixture(scope="session")
def seeded(reported):
    """The report with two seeds, in a folder of its own; clouds of the second are those of the first, 1 % larger."""
    experiment, run, folder = reported
    further = experiment.artifacts / "pointclouds_seeds" / "1"
    for category in experiment.categories:
        for model in scoring.FILES.values():
            name = f"{category}/{model}.safetensors"
            tensors, metadata = storage.load_tensors(experiment.artifacts / "pointclouds" / name)
            clouds = {key: 1.01 * value for key, value in tensors.items() if key[0] in "LS"}
            storage.save_tensors(further / name, tensors | clouds, metadata)
    for model in stage_results.MODELS:
        shutil.copytree(experiment.artifacts / model, experiment.artifacts / f"{model}_seeds" / "1")
    with contextlib.chdir(folder.parents[2]):
        make("evaluate", dataclasses.replace(run, seed=1))
        count = experiment.artifacts / "evaluate_seeds" / seeds.COUNT
        storage.write_text(count, "2\n")
        experiment_page.write(run, folder.parent / "seeded")
        count.unlink()
    return folder, folder.parent / "seeded"
