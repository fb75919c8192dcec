"""Commands with a set of six parameters."""

import json

import numpy as np
import pytest

from dnacheck.cli import main

LETTERS = "".join(np.random.default_rng(21).choice(list("ACGT"), 120))
OLSON = ["--parameters", "olson1998"]


def record(capsys, *arguments):
    assert main([*arguments, *OLSON, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_sweep_multiplies_the_twist_stiffness(capsys):
    """At 1 it is the ring of the set itself; softer twist gives no higher energy."""
    (sweep,) = record(capsys, "sweep", LETTERS, "--ratios", "0.5:1:2")["sweeps"]
    assert sweep["model"] == "discrete"
    lowest = record(capsys, "ring", LETTERS, "--model", "discrete")["equilibria"][0]
    assert sweep["energy"][1] == pytest.approx(lowest["energy_RT"], rel=1e-9)
    assert sweep["energy"][0] < sweep["energy"][1]
    assert max(sweep["residual"]) <= 1e-10


@pytest.mark.parametrize("method", ["laplace", "corrected-laplace", "closure"])
def test_methods_of_j(capsys, method):
    result = record(capsys, "jfactor", LETTERS, "--method", method)
    assert result["n_bp"] == 120
    assert np.isfinite(result["minus_lnJ"])


def test_scan(tmp_path, capsys):
    fasta, table = tmp_path / "in.fasta", tmp_path / "out.csv"
    fasta.write_text(f">one\n{LETTERS}\n>two\n{LETTERS[60:] + LETTERS[:60]}\n")
    assert main(["scan", str(fasta), "-o", str(table), *OLSON, "--quiet"]) == 0
    rows = table.read_text().splitlines()
    assert len(rows) == 3
    columns = rows[0].split(",")
    energies = [float(row.split(",")[columns.index("energy_RT")]) for row in rows[1:]]
    # Two cuts of one ring.
    assert energies[0] == pytest.approx(energies[1], rel=1e-9)


def test_a_bad_shape_is_one_line_and_exit_2(tmp_path, capsys):
    path = tmp_path / "helical.par"
    path.write_text("  10 # base-pairs\n# X-disp Y-disp h-Rise Incl. Tip h-Twist\n")
    assert main(["ring", str(path), *OLSON]) == 2
    message = capsys.readouterr().err.strip()
    assert message.count("\n") == 0
    assert "helical.par" in message
    assert "x-disp" in message
