"""The settings that the page compares with the paper's."""

from types import SimpleNamespace

import pytest
from _experiment_report import ROOT

from ddf.core import schema
from ddf_lab.report.experiment.sections import limits
from ddf_lab.run import Run

PLACES = {"app. si3dr", "app. singlefits", "app. genmodel", "table si3dr", "§3.3", "§3.4", "§4.3"}


def _changed(name):
    results = SimpleNamespace(settings=Run.read(ROOT / "configs" / f"{name}.yaml").sections())
    return {name: rest for name, *rest in limits.changed_settings(results)}  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("name", ["smoke", "cpu", "cpu_paper"])
def test_what_differs_from_the_paper_stands_beside_what_it_prints(name):
    found, papers = _changed(name), _changed("paper")
    assert all(here for here, _ in found.values())
    assert set(papers) <= set(found)  # what the paper does not give stands in every page
    assert {printed for _, printed in papers.values()} == {limits.NOT_GIVEN}
    if name == "cpu":
        (proposals,) = (rest for key, rest in found.items() if key.startswith("`ddf.proposals"))
        assert proposals == ["points 160", "none (app. si3dr)"]
        assert found["`train.batch_size`: images of a step"] == ["12", "32 (app. si3dr)"]


def test_a_source_is_a_place_of_the_paper_and_holds_for_the_default_alone():
    for name in ("cpu", "generative", "fit"):
        for section, value in Run.read(name).sections().items():
            for each in schema.listed(value, section):
                assert each.source == "" or each.source in PLACES, each.key
    fit = {each.key: each.source for each in schema.listed(Run.read("fit").sections()["fit"], "fit")}
    assert fit["fit.weights.transition"] == fit["fit.field.omega_first"] == fit["fit.loop.schedule"] == ""
    vae = {each.key: each.source for each in schema.listed(Run.read("generative").sections()["vae"], "vae")}
    assert (
        vae["vae.field.hidden"] == "app. genmodel"
        and vae["vae.loop.schedule"] == vae["vae.field.direction_scale"] == ""
    )
