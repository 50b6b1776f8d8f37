"""Unknown names are answered with the known ones and the nearest."""

import pytest

from ddf import cli
from ddf.core import errors


def test_the_nearest_is_asked_for_where_one_is_near():
    assert errors.known_names("rabit", ["chair", "rabbit"]) == "chair, rabbit (did you mean rabbit?)"
    assert errors.known_names("xyz", ["chair"]) == "chair" and errors.known_names("a", []) == "none"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["render", "rabit", "a.png"], "(did you mean rabbit?)"),
        (["reconstruct", "a.png", "chairs", "out"], "(did you mean chair?)"),
        (["models", "get", "rabit", "out"], "there are rabbit, rabbit-network, nested"),
    ],
)
def test_commands_know_the_models_and_ask_for_the_nearest(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and "torch" not in error and not list(tmp_path.iterdir())
