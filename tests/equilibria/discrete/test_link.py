"""A ring of the link asked for, or none: the search never answers with another topoisomer."""

import json
import random

import numpy as np
import pytest

from dnacheck import cli
from dnacheck.equilibria.continuum import lowest_continuum_ring
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.chain import build_chain
from dnacheck.model.rod import build_rod
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import SolveError, Status


def letters(count):
    rng = random.Random(42)
    return "".join(rng.choice("ACGT") for _ in range(count))


# Rings relaxed by a descent that may pass through itself leave the first link for the second.
LOST = [(339, 30, 32), (120, 15, 11)]


@pytest.mark.parametrize(("count", "link", "end"), LOST)
def test_a_link_without_a_ring_is_said(count, link, end):
    found = find_rings(build_chain(Sequence("random", letters(count))), SearchOptions(links=link))
    assert found.equilibria == ()
    assert found.status is Status.NOT_FOUND
    assert {ring.link for ring in found.ends} == {end}
    assert all(ring.residual < 1e-9 for ring in found.ends)
    with pytest.raises(SolveError, match=f"no stable ring of link {link} was found") as caught:
        _ = found.lowest
    assert caught.value.partial is found
    assert f"ended at link {end}" in str(caught.value)


@pytest.mark.parametrize("count", [120, 339])
def test_every_link_beside_the_ground_twist_has_a_ring_of_that_link(count):
    """Negative control: the refusal is not one of every link."""
    chain = build_chain(Sequence("random", letters(count)))
    for link in (int(np.floor(chain.relaxed_turns)), int(np.ceil(chain.relaxed_turns))):
        found = find_rings(chain, SearchOptions(links=link))
        assert found.equilibria
        assert all(ring.link == link and ring.stable for ring in found.equilibria)


def test_the_links_that_have_rings_are_those_of_a_twisted_ring_below_its_instability():
    """A straight ring buckles at an excess of sqrt(3) K1 / K3 turns (Michell 1889), here 1.15."""
    chain = build_chain(Sequence("random", letters(339)))
    rings = {}
    for link in range(28, 37):
        found = find_rings(chain, SearchOptions(links=link))
        assert all(ring.link == link for ring in found.equilibria)
        if found.equilibria:
            rings[link] = found.lowest
    assert set(rings) == {link for link in range(28, 37) if abs(link - chain.relaxed_turns) < 1.15}
    for link, ring in rings.items():
        again = solve_ring(chain, ring.angles)
        assert again.link == link
        assert again.stable
        assert again.energy == pytest.approx(ring.energy, rel=1e-12)


@pytest.mark.parametrize(("count", "link", "end"), LOST)
def test_commands_say_so_and_end_with_3(count, link, end, capsys):
    target = letters(count)
    for arguments in (
        ["ring", target, "--link", str(link), "--model", "discrete", "--quiet"],
        ["jfactor", target, "--link", str(link)],
        ["jfactor", target, "--link", str(link), "--method", "laplace"],
    ):
        assert cli.main(arguments) == 3
        captured = capsys.readouterr()
        assert f"no stable ring of link {link} was found" in captured.err
        assert f"ended at link {end}" in captured.err
        assert "ln J" not in captured.out


def test_json_lists_no_ring_of_another_link(capsys):
    assert cli.main(["ring", letters(120), "--link", "15", "--json"]) == 3
    record = json.loads(capsys.readouterr().out)
    assert all(item["link"] == 15 and not item["stable"] for item in record["equilibria"])
    assert any("continuum: only saddles were found" in text for text in record["warnings"])
    assert not any("converged" in text.split("convergence")[0] for text in record["warnings"])


def test_continuum_saddles_are_no_success():
    chain = build_chain(Sequence("random", letters(120)))
    found = lowest_continuum_ring(build_rod(chain), 15)
    assert found.equilibria
    assert found.minima == ()
    assert found.status is Status.NOT_FOUND
    with pytest.raises(SolveError, match="only saddles were found at link 15"):
        _ = found.lowest
    ring = lowest_continuum_ring(build_rod(chain), 11).lowest
    assert ring.link == 11
    assert ring.stable


def test_the_share_of_a_link_is_that_of_its_rings():
    """Laplace's J of one link is the term of that link in the sum over all."""
    from dnacheck.cyclization.laplace.isolated import laplace

    chain = build_chain(Sequence("random", letters(339)))
    shares = {share.link: share.minus_lnJ for share in laplace(chain).links}
    for link, value in shares.items():
        alone = laplace(find_rings(chain, SearchOptions(links=link)))
        assert [share.link for share in alone.links] == [link]
        assert alone.minus_lnJ == pytest.approx(value, abs=1e-8)
