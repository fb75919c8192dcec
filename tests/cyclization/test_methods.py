"""Method objects: one verb, options checked when they are made, one result."""

import json
import math

import numpy as np
import pytest

from dnacheck.cyclization.methods import (
    METHODS,
    Auto,
    ClosureSampling,
    HalfChain,
    Laplace,
    Umbrella,
    method_named,
)
from dnacheck.cyclization.result import JFactor, JStatus, LinkShare
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError, SolveError


@pytest.fixture(scope="module")
def search():
    return find_rings(build_chain(embedded("08T15")))


def test_every_name_makes_a_method_of_that_name():
    assert {name: method_named(name).name for name in METHODS} == {name: name for name in METHODS}
    with pytest.raises(InputError, match="auto, laplace"):
        method_named("exact")


@pytest.mark.parametrize(
    "make",
    [
        lambda: Laplace(order=1),
        lambda: Laplace(register=True, order=2),
        lambda: Laplace(register="yes"),
        lambda: Laplace(register=True, order=1, pairs=3),
        lambda: ClosureSampling(first_batches=1),
        lambda: ClosureSampling(probe_rate=1.5),
        lambda: HalfChain(halves=10),
        lambda: HalfChain(radius=0.0),
        lambda: Umbrella(samples=2),
        lambda: Umbrella(copies=1),
    ],
)
def test_an_impossible_option_is_refused_when_the_object_is_made(make):
    with pytest.raises(InputError) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "options",
    [
        {"rng": "x"},
        {"rng": -1},
        {"rng": True},
        {"rng": None},
        {"tolerance": 0.0},
        {"tolerance": math.nan},
        {"tolerance": "small"},
        {"max_seconds": 0.0},
        {"threads": 0},
        {"threads": 1.5},
        {"progress": 3},
    ],
)
def test_an_impossible_run_is_refused_by_the_name_of_its_argument(search, options):
    (name,) = options
    with pytest.raises(InputError, match=name):
        Laplace().compute(search, **options)


def test_the_same_seed_in_any_form_gives_the_same_number_whatever_the_threads(search):
    method = ClosureSampling()
    values = [
        method.compute(search, rng=rng, threads=threads, tolerance=0.05).minus_lnJ
        for rng, threads in ((5, 1), (np.int64(5), 2), (np.random.SeedSequence(5), 1))
    ]
    assert len(set(values)) == 1
    assert method.compute(search, rng=6, tolerance=0.05).minus_lnJ != values[0]


def test_a_generator_gives_new_numbers_each_time_and_the_same_from_its_start(search):
    def pair():
        rng = np.random.default_rng(3)
        return [ClosureSampling().compute(search, rng=rng, tolerance=0.05) for _ in range(2)]

    first, second = pair()
    assert first.minus_lnJ != second.minus_lnJ
    assert [r.minus_lnJ for r in pair()] == [first.minus_lnJ, second.minus_lnJ]


def test_samplers_report_their_draws(search):
    seen = []
    result = ClosureSampling().compute(search, tolerance=0.02, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == result.samples


def test_methods_take_a_chain_rings_or_held_rings(search):
    from dnacheck.cyclization.laplace.register import register_profile

    method = Laplace(register=True)
    targets = (search.chain, search, register_profile(search))
    values = [method.compute(target).minus_lnJ for target in targets]
    assert values == pytest.approx([values[0]] * 3, abs=1e-9)


def example(**changes):
    fields = {
        "target": "x<y",
        "n_bp": 150,
        "method": "closure",
        "minus_lnJ": 16.0,
        "stderr": 0.01,
        "bias_bound": 0.002,
        "links": (LinkShare(14, 16.1, 0.011), LinkShare(15, 18.4, 0.1)),
    }
    return JFactor(**{**fields, **changes})


def test_the_dictionary_is_the_promised_json():
    record = json.loads(json.dumps(example().to_dict()))
    promised = {"target", "n_bp", "method", "minus_lnJ", "stderr", "J_molar", "links"}
    assert promised | {"effective_samples", "seconds", "warnings", "bias_bound"} <= set(record)
    assert record["J_molar"] == pytest.approx(math.exp(-16.0), rel=1e-15)
    assert "reason" not in record
    assert example(reason="cheap").to_dict()["reason"] == "cheap"


def test_a_result_prints_for_a_terminal_and_for_a_notebook():
    text = repr(example(status=JStatus.HEAVY_TAILS))
    assert text.startswith("<JFactor x<y: -ln J = 16.0000 ± 0.0100")
    assert "heavy tails" in text
    page = example()._repr_html_()
    assert "x&lt;y" in page
    assert "link 14" in page


def test_the_share_of_a_link_has_its_own_error_or_is_refused():
    whole = example()
    part = whole.of_link(15, tolerance=0.05)
    assert (part.minus_lnJ, part.stderr) == (18.4, 0.1)
    assert part.bias_bound == pytest.approx(0.002 * math.exp(2.4))
    assert part.status is JStatus.TOLERANCE_NOT_MET
    assert whole.of_link(14).status is JStatus.CONVERGED
    with pytest.raises(SolveError, match="link 13"):
        whole.of_link(13)


def test_what_was_tried_is_said(search):
    result = Auto().compute(search, tolerance=0.02)
    assert [attempt.method for attempt in result.tried][:2] == ["laplace", "register-laplace"]
    assert result.tried[-1].met
    assert result.tried[-1].method == result.method
    assert all(attempt.method in result.reason for attempt in result.tried)
