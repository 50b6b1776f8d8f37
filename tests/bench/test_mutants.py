"""The list of faults: each changes one place that is there, and its tests are there."""

from bench.lib import measuring
from bench.mutation import mutants


def test_each_fault_has_its_place_once_and_tests_that_may_notice():
    faults = mutants.mutants()
    assert len({mutant.name for mutant in faults}) == len(faults) > 40
    for mutant in faults:
        assert mutant.old != mutant.new and mutant.new in mutant.changed(measuring.ROOT), mutant.name
        assert mutant.tests and all((measuring.ROOT / "tests" / name).exists() for name in mutant.tests), mutant.name
