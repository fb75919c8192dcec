"""The lines that people will write, as the design has them, and every docstring's example."""

import doctest

import pytest

import dnacheck as dc
from dnacheck.validation.scene.scene import scenes_directory

DESIGN = """
chain = dc.chain("11T15")
chain = dc.chain("ACGTTGCATC" * 15, parameters="olson1998", a_tracts="none")
chain = dc.chain("11T15")
rings = dc.rings(chain)
rings.lowest, rings.to_frame()
ring = rings.lowest
ring.energy_RT, ring.bend_RT, ring.twist_RT, ring.link, ring.writhe, ring.twist_turns, ring.stable
ring.force_pN, ring.moment_pN_nm, ring.coordinates_A, ring.frames, ring.angles_deg
ring.write("ring.pdb"); ring.plot()

rod = dc.rod(chain)
dc.rings(rod).lowest

j = dc.jfactor(chain)
j = dc.jfactor(chain, method=dc.HalfChain(halves=40_000), rng=1)
j.minus_lnJ, j.stderr, j.bias_bound, j.molar, j.links

dc.diagram(rod); dc.twist_ratio_scan(chain, ratios).to_frame(); dc.ensemble(ring, by="openmm")
dc.scan("library.fasta").to_frame()
"""


def test_the_lines_of_the_design_run(tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "library.fasta").write_text(">one\n" + "ACGTTGCATC" * 15 + "\n")
    names = {"dc": dc, "ratios": [0.8, 1.5]}
    exec(DESIGN, names)
    assert (tmp_path / "ring.pdb").exists()
    assert names["j"].method == "half-chain"
    # Two methods, one J: Laplace's first anharmonic term and the half chains.
    other = dc.jfactor(names["chain"], dc.Laplace(register=True, order=1))
    assert abs(other.minus_lnJ - names["j"].minus_lnJ) < 0.15
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.mark.parametrize("name", [name for name in dir(dc) if name[0].islower()])
def test_examples_of_the_docstrings(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    verb = getattr(dc, name)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    tests = doctest.DocTestFinder(recurse=False).find(verb, name)
    assert tests[0].examples
    text = []
    for test in tests:
        runner.run(test, out=text.append)
    assert not runner.failures, "".join(text)


def test_a_scene_is_validated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = scenes_directory() / "quick.toml"
    (tmp_path / "scene.toml").write_text(scene.read_text(encoding="utf-8"), encoding="utf-8")
    record = dc.validate("scene.toml", level="quick", only=["table2.discrete"], threads=1)
    assert record.verdict.value == "pass"
    assert (tmp_path / "report" / "report.html").exists()
