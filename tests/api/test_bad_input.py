"""Bad input through the door: one line that names the argument and the mend."""

import math

import numpy as np
import pytest

import dnacheck as dc

CASES = {
    "empty": (lambda: dc.chain(""), "target is empty", "give"),
    "blank": (lambda: dc.chain("  "), "target is empty", "give"),
    "other letters": (lambda: dc.chain("ACGTACGTNACGT"), "position 9: 'N'", "A, C, G, T"),
    "unknown name": (lambda: dc.chain("11T16"), "target", "11T15"),
    "name in letters": (lambda: dc.chain("NCT15"), "target", "did you mean"),
    "number for a target": (lambda: dc.chain(7), "target must be", "letters"),
    "missing path": (lambda: dc.chain("absent.fasta"), "absent.fasta", "check the path"),
    "too short": (lambda: dc.rings("ACGT"), "4 base pairs are too few", "at least 10"),
    "parameters": (lambda: dc.chain("11T15", "trifonof2"), "parameter set", "trifonov2"),
    "parameters of a wrong type": (lambda: dc.chain("11T15", 3), "parameters", "name"),
    "step_form": (lambda: dc.chain("11T15", step_form="wegde"), "step_form", "wedge"),
    "a_tracts": (lambda: dc.chain("11T15", a_tracts=[3]), "a_tracts", "pairs"),
    "a_tracts beyond": (lambda: dc.chain("11T15", a_tracts="100..900"), "900", "157"),
    "ratio 0": (lambda: dc.chain("11T15", twist_ratio=0.0), "twist_ratio", "greater than 0"),
    "ratio -1": (lambda: dc.chain("11T15", twist_ratio=-1), "twist_ratio", "greater than 0"),
    "ratio NaN": (lambda: dc.chain("11T15", twist_ratio=math.nan), "twist_ratio", "finite"),
    "ratio in words": (lambda: dc.chain("11T15", twist_ratio="1.5"), "twist_ratio", "number"),
    "rise": (lambda: dc.chain("11T15", rise_A=math.inf), "rise_A", "finite"),
    "filter": (lambda: dc.rod("11T15", filter_width=0), "filter_width", "1 or more"),
    "rod of six parameters": (lambda: dc.rod(dc.chain("11T15", "olson1998")), "olson1998", "use"),
    "link": (lambda: dc.rings("11T15", link="some"), "link", "auto"),
    "link 1.5": (lambda: dc.rings("11T15", link=1.5), "link", "integer"),
    "ends": (lambda: dc.rings("11T15", ends="niked"), "ends", "nicked"),
    "ends of a rod": (lambda: dc.rings(dc.rod("11T15"), ends="hinged"), "ends", "chain"),
    "link of a nick": (lambda: dc.rings("11T15", link=15, ends="nicked"), "link 15", "leave it"),
    "loop too far": (
        lambda: dc.rings("11T15", ends=dc.Loop((900.0, 0, 0))),
        "position_A",
        "closer",
    ),
    "method": (lambda: dc.jfactor("11T15", "half-chains"), "method", "half-chain"),
    "method of a wrong type": (lambda: dc.jfactor("11T15", 3), "method", "Auto"),
    "halves": (lambda: dc.HalfChain(halves=-5), "halves", ""),
    "order": (lambda: dc.Laplace(order=7), "order", ""),
    "rng": (lambda: dc.jfactor("11T15", dc.ClosureSampling(), rng="x"), "rng", "integer"),
    "rng -1": (lambda: dc.jfactor("11T15", dc.ClosureSampling(), rng=-1), "rng", "not below 0"),
    "tolerance": (lambda: dc.jfactor("11T15", tolerance=0.0), "tolerance", "greater than 0"),
    "threads": (lambda: dc.jfactor("11T15", threads=0), "threads", "1 or more"),
    "progress": (lambda: dc.jfactor("11T15", progress=3), "progress", "callable"),
    "ratios": (lambda: dc.twist_ratio_scan("11T15", [1.0, 0.5]), "ratios must increase", "sort"),
    "bounds": (lambda: dc.diagram("11T15", bounds=(2.0, 1.0)), "bounds", "smaller first"),
    "by": (lambda: dc.ensemble(dc.rings("11T15").lowest, by="openm"), "by", "openmm"),
    "no ring": (lambda: dc.ensemble("11T15"), "ring must be", "lowest"),
    "absent scan": (lambda: dc.scan("absent.fasta"), "absent.fasta", "check the path"),
    "ratio of a scan": (
        lambda: dc.scan(__file__, twist_ratio=-1.0),
        "twist_ratio",
        "greater than 0",
    ),
    "profile": (lambda: dc.profile("11T15", ["x"]), "change", "integer"),
    "fit": (lambda: dc.fit("absent.csv"), "absent.csv", ""),
    "scene": (lambda: dc.validate("absent.toml"), "absent.toml", ""),
    "level": (lambda: dc.validate("quick", level="quik"), "level", "quick"),
}


@pytest.mark.parametrize("name", CASES)
def test_one_line_names_the_argument_and_the_mend(name):
    call, argument, mend = CASES[name]
    with pytest.raises(dc.InputError) as error:
        call()
    text = str(error.value)
    assert "\n" not in text
    assert argument in text
    assert mend in text


def test_writing_to_a_folder_that_is_not_there(tmp_path):
    ring = dc.rings("11T15").lowest
    absent = tmp_path / "absent" / "ring.pdb"
    with pytest.raises(dc.InputError, match="there is no folder"):
        ring.write(absent)
    with pytest.raises(dc.InputError, match="there is no folder"):
        dc.scan(
            tmp_path / "x.fasta" if (tmp_path / "x.fasta").write_text(">a\nACGT") else "", absent
        )
    assert not absent.parent.exists()


def test_random_numbers_by_number_sequence_or_generator():
    way = dc.ClosureSampling(first_batches=8, most_draws=1)
    one = dc.jfactor("11T15", way, rng=3).minus_lnJ
    assert dc.jfactor("11T15", way, rng=np.random.SeedSequence(3)).minus_lnJ == one
    stream = np.random.default_rng(3)
    first, second = (dc.jfactor("11T15", way, rng=stream).minus_lnJ for _ in range(2))
    assert first != second
