"""Write the models that come with the package, src/ddf/shipped: fields of our own shapes, and trained reconstructions.

Fields are fitted here, in minutes; reconstructions are those of the experiment's seed 0, which must be there.
"""

from pathlib import Path

from ddf_lab import model_cards
from ddf_lab.engine import stage
from ddf_lab.run import Run

OUT = Path("src/ddf/shipped")


@stage.main()
def make(run: Run) -> None:
    """Fit the fields that are not there, round, export, describe."""
    model_cards.write_all(run, run.folder("shipped_fields"), OUT)
