"""Error of ln J against time."""

from rods import molecule_chain

from dnacheck.validation.reference.work_precision import SpeedOptions, molecules, study

TINY = SpeedOptions(
    batches=(20, 80), pairs=(20, 320), halves=(4_000,), plain_halves=(1_000,), records=(20,)
)


def test_points_hold_times_errors_and_biases():
    found = study("09T15", molecule_chain("09T15"), TINY, seed=1)
    methods = [point.method for point in found.points]
    assert methods[:2] == ["laplace", "register-laplace"]
    assert {"corrected-laplace", "closure", "half-chain", "metropolis"} <= set(methods)
    # A thousand plain halves have no pair that meets: said, not raised.
    assert len(found.failed) == 1
    assert found.failed[0].startswith("half-chain-plain, 2 x 1000 halves: ")
    laplace = found.points[1]
    assert laplace.error == abs(laplace.bias)
    assert found.reference_error < 0.1 * laplace.error
    for point in found.points:
        assert point.seconds > 0.0
        assert point.minus_lnJ - found.reference == point.bias
    closure = [point for point in found.points if point.method == "closure"]
    assert closure[1].error < closure[0].error
    corrected = [point for point in found.points if point.method == "corrected-laplace"]
    assert corrected[1].error < corrected[0].error < laplace.error


def test_a_study_is_reproducible():
    brief = SpeedOptions(batches=(20,), pairs=(20,), halves=(), plain_halves=(), records=())
    runs = [study("09T15", molecule_chain("09T15"), brief, seed=1) for _ in range(2)]
    assert [p.minus_lnJ for p in runs[0].points] == [p.minus_lnJ for p in runs[1].points]


def test_three_molecules_from_easy_to_hard():
    chains = molecules()
    assert [name.partition(":")[0] for name in chains] == ["easy", "middling", "hard"]
    assert chains["hard: random, 386 bp"].n_steps == 386
