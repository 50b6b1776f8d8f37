"""The published sizes, by the config that states them."""

from pathlib import Path

from ddf.core import config
from ddf.models import generative_settings, parameter_counts

PAPER = Path(__file__).resolve().parents[3] / "configs" / "paper_generative.yaml"


def test_the_paper_config_has_the_published_networks():
    given = config.layers(PAPER)
    vae, gan = (
        config.resolve(given, "vae", generative_settings.VAEConfig),
        config.resolve(given, "gan", generative_settings.GANConfig),
    )
    assert parameter_counts.count(vae, gan) == {
        "point_encoder": 1_347_488,
        "posterior_heads": 641_600,
        "decoder": 3_467_268,
        "decoder_field": 1_121_284,
        "decoder_modulator": 2_345_984,
        "colours_from_normals": 8_038_403,
        "normals_from_colours": 7_837_699,
        "texture_encoder": 273_232,
        "critic": 10_141_441,
        "generator_2d": 12_220_675,
    }
