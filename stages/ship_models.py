"""Write the models that come with the package, src/ddf/shipped: fields of our own shapes, and trained reconstructions.

Fields are fitted here, in minutes; reconstructions are those of the experiment's seed 0, which must be there.
"""

from pathlib import Path

from ddf.core import config
from ddf_lab.engine import stage
from ddf_lab.shipping import model_cards

OUT = Path("src/ddf/shipped")


def run(config_path: Path) -> None:
    """Fit the fields that are not there, round, export, describe."""
    fitted = config.artifact_dir(config_path, "shipped_fields")
    model_cards.write_all(config_path, fitted, OUT)


if __name__ == "__main__":
    stage.main(run, __doc__)
