"""What a model's card says of the shapes that trained it."""

from ddf.data.public import manifest
from ddf_lab.shipping import model_cards


def _row(licence, creator):
    return manifest.Row(creator + licence, "chair", "train", "p", "a.obj", "", "x y z", (), licence, creator)


def test_a_model_of_own_shapes_is_under_the_licence_of_this_repository():
    assert model_cards.licence([]) == [model_cards.LICENCE]


def test_makers_stand_once_below_their_licence():
    seen = [_row("CC-BY-3.0", "Zoe"), _row("CC0-1.0", "Max"), _row("CC-BY-3.0", "Ann"), _row("CC-BY-3.0", "Zoe")]
    first, *makers = model_cards.licence(seen)
    assert "nothing else went in" not in first
    assert makers == ["CC-BY-3.0: Ann, Zoe.", "CC0-1.0: Max."]
