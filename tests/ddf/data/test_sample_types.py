"""The list of sample types: what follows from it is what the paper's terms cover, and every type can be drawn."""

import dataclasses

import pytest

from ddf.core import checks
from ddf.data.samples import extraction, sample_types
from ddf.fields import losses


def test_slices_of_a_batch_are_those_of_the_papers_terms():
    assert sample_types.BATCH == ("E", "U", "A", "B", "S", "T", "O", "U+", "A+", "B+", "S+", "T+", "P")
    assert (sample_types.EIKONAL, sample_types.NORMALS, sample_types.TRANSITION) == (("E", "B"), ("U", "B"), ("S", "T"))
    assert sample_types.GROUND_TRUTH == ("U", "P")
    assert sample_types.DOUBLED_DEPTH == (("U", "A"), ("U+", "A+"), ("P", "P"))


def test_every_stored_type_has_a_count_and_is_drawn():
    assert set(sample_types.KINDS) == set(extraction.SamplesConfig().counts)


def test_every_term_has_its_weight_and_covers_a_slice():
    weights = {field.name for field in dataclasses.fields(losses.LossWeights)}
    for name, term in losses.TERMS.items():
        assert term.weight is None or term.weight in weights, name
        assert sample_types.BATCH.index(term.covers[0]) <= sample_types.BATCH.index(term.covers[1]), name


def test_counts_of_a_step_name_the_needed_types_and_known_others():
    given = dict.fromkeys(sample_types.NEEDED, 1)
    sample_types.check_counts("ddf.counts", given | {"U+": 3})
    for bad in ({**given, "X": 1}, {**given, "P": 1}, {**given, "U+": 0}, {k: 1 for k in given if k != "E"}):
        with pytest.raises(checks.InputError, match=r"ddf\.counts must give each of E, U, A, B, S, T, O >= 1"):
            sample_types.check_counts("ddf.counts", bad)
