"""``dnacheck jfactor`` and ``dnacheck scan``: what they print and refuse."""

import json
import math

import pytest

from dnacheck import cli


def run(capsys, *arguments):
    code = cli.main(list(arguments))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_json_has_the_promised_members(capsys):
    code, out, _ = run(capsys, "jfactor", "08T15", "--json", "--tolerance", "0.03")
    record = json.loads(out)
    assert code == 0
    promised = {"target", "n_bp", "method", "minus_lnJ", "stderr", "J_molar", "links"}
    assert promised | {"effective_samples", "seconds", "warnings"} <= set(record)
    assert record["method"] == "closure"
    assert abs(record["minus_lnJ"] - 15.765) < 4 * record["stderr"]
    assert record["J_molar"] == pytest.approx(math.exp(-record["minus_lnJ"]))
    assert {"link", "minus_lnJ"} <= set(record["links"][0])
    assert "laplace" in record["reason"]


def test_auto_takes_laplace_where_its_measured_error_is_small_enough(capsys):
    code, out, _ = run(capsys, "jfactor", "08T15", "--json", "--tolerance", "0.6")
    record = json.loads(out)
    assert code == 0
    assert record["method"] == "laplace"
    assert 0.2 < record["bias_bound"] < 0.6
    assert abs(record["minus_lnJ"] - 15.765) < record["bias_bound"]


def test_ends_that_are_freed(capsys):
    """More closed shapes for a hinge; a nick averages over the turn of the end."""
    values = {}
    for ends in ("ring", "nicked", "hinged"):
        code, out, _ = run(
            capsys, "jfactor", "08T15", "--ends", ends, "--json", "--tolerance", "0.05"
        )
        record = json.loads(out)
        assert code == 0
        assert bool(record["links"]) == (ends == "ring")
        values[ends] = record["minus_lnJ"]
    assert values["hinged"] + 1.0 < values["ring"] < values["nicked"]


def test_free_ends_have_no_link(capsys):
    code, out, err = run(capsys, "jfactor", "08T15", "--ends", "nicked", "--link", "15")
    assert code == 2
    assert out == ""
    assert "no link" in err


def test_seed_fixes_the_result(capsys):
    results = [
        json.loads(run(capsys, "jfactor", "09T15", "--json", "--seed", seed)[1])["minus_lnJ"]
        for seed in ("1", "1", "2")
    ]
    assert results[0] == results[1] != results[2]


@pytest.mark.parametrize("tolerance", ["0", "-0.1", "nan", "inf", "wide"])
def test_a_bad_tolerance_is_bad_usage(capsys, tolerance):
    code, out, err = run(capsys, "jfactor", "08T15", "--tolerance", tolerance)
    assert code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert "--tolerance" in err


def test_a_tolerance_out_of_reach_gives_the_best_so_far(capsys):
    # the limit counts compilation too: that is done first
    assert run(capsys, "jfactor", "12A09", "--tolerance", "0.05")[0] == 0
    code, out, _ = run(
        capsys, "jfactor", "12A09", "--json", "--tolerance", "1e-5", "--max-seconds", "4"
    )
    record = json.loads(out)
    assert code == 3
    assert record["stderr"] > 1e-5
    assert abs(record["minus_lnJ"] - 19.71) < 0.1
    assert "tolerance was not met" in record["status"]


@pytest.mark.parametrize("method", ["closure", "half-chain"])
def test_time_runs_out_for_every_sampler(capsys, method):
    assert run(capsys, "jfactor", "08T15", "--method", method, "--tolerance", "0.5")[0] == 0
    limit = ("--tolerance", "1e-5", "--max-seconds", "4")
    code, out, _ = run(capsys, "jfactor", "08T15", "--json", "--method", method, *limit)
    record = json.loads(out)
    assert code == 3
    assert record["stderr"] > 1e-5
    assert abs(record["minus_lnJ"] - 15.77) < 4.0 * record["stderr"]
    assert "tolerance was not met" in record["status"]


@pytest.mark.parametrize("method", ["auto", "laplace", "closure", "half-chain", "metropolis"])
def test_a_link_without_a_stable_ring_is_said(capsys, method):
    code, out, err = run(capsys, "jfactor", "08T15", "--link", "30", "--method", method)
    assert code == 3
    assert "link 30" in err
    assert "ln J" not in out


def test_a_link_asked_for_gets_its_own_share_or_an_error(capsys):
    code, out, _ = run(capsys, "jfactor", "08T15", "--json", "--link", "14", "--method", "closure")
    record = json.loads(out)
    assert code == 0
    assert [share["link"] for share in record["links"]] == [14]
    assert record["minus_lnJ"] == record["links"][0]["minus_lnJ"] > 30.0
    assert 0.0 < record["stderr"] < 0.03
    # chains may pass through themselves: from link 17 all go to link 15
    code, out, err = run(capsys, "jfactor", "08T15", "--link", "17", "--method", "closure")
    assert code == 3
    assert "link 17" in err
    assert "ln J" not in out


# -ln J by half chains is 16.75 +- 0.03: what samplers may miss it by, and how far Laplace is above.
@pytest.mark.parametrize(
    ("method", "least", "most"),
    [
        ("laplace", 0.2, 0.4),
        ("register-laplace", 0.2, 0.4),
        ("corrected-laplace", -0.1, 0.12),
        ("closure", -0.1, 0.12),
    ],
)
def test_methods_by_name(capsys, method, least, most):
    code, out, _ = run(capsys, "jfactor", "15A09", "--json", "--method", method)
    record = json.loads(out)
    assert code == 0
    assert record["method"] == method
    assert least < record["minus_lnJ"] - 16.75 < most
    assert (record["bias_bound"] is None) == (method in ("laplace", "register-laplace"))


def test_several_molecules(capsys, tmp_path):
    path = tmp_path / "two.fasta"
    path.write_text(">a\n" + "ACGTTGCATGCCGATAACGT" * 5 + "\n>b\n" + "ACGGTGCATGCTGATAACGA" * 6)
    code, out, _ = run(capsys, "jfactor", str(path), "--json", "--tolerance", "0.05")
    records = json.loads(out)["results"]
    assert code == 0
    assert [record["target"] for record in records] == ["a", "b"]


def test_text_names_the_method_and_the_reason(capsys):
    code, out, _ = run(capsys, "jfactor", "09T15")
    assert code == 0
    assert out.startswith("09T15: -ln J = 15.5")
    assert "closure is the cheapest whose measured error" in out


def test_bad_letters_are_one_line(capsys):
    code, _, err = run(capsys, "jfactor", "ACGTNACGTACGT")
    assert code == 2
    assert "position 5" in err


def test_scan_writes_rows_and_json(capsys, tmp_path):
    source, output = tmp_path / "in.fasta", tmp_path / "out.csv"
    source.write_text(">a\n" + "ACGTTGCATGCCGATAACGT" * 5 + "\n>b\nACGN\n")
    code, out, _ = run(capsys, "scan", str(source), "-o", str(output), "--json")
    record = json.loads(out)
    assert code == 0
    assert (record["rows"], record["resumed_rows"], record["failed_rows"]) == (2, 0, 1)
    assert output.read_text().startswith(
        "name,n_bp,link,energy_RT,energy_reduced,minus_lnJ,status,quality\n"
    )
    code, _, err = run(capsys, "scan", str(source), "-o", str(output))
    assert code == 0
    assert "2 of them from before" in err


def test_scan_refuses_what_it_cannot_read_or_write(capsys, tmp_path):
    code, _, err = run(capsys, "scan", str(tmp_path / "absent"), "-o", str(tmp_path / "o.csv"))
    assert code == 2
    assert "check the path" in err
    source = tmp_path / "in.fasta"
    source.write_text(">a\n" + "ACGTTGCATGCCGATAACGT" * 5 + "\n")
    code, _, err = run(capsys, "scan", str(source), "-o", str(tmp_path / "absent" / "o.csv"))
    assert code == 2
    assert "cannot write" in err


def test_binding_prints_the_ratio_of_binding_constants(capsys):
    code, out, _ = run(capsys, "jfactor", "11T15", "--bind", "125=cap", "--method", "laplace")
    assert code == 0
    assert "binding constant, ring over linear" in out
    code, out, _ = run(
        capsys, "jfactor", "11T15", "--bind", "125=cap", "--method", "laplace", "--json"
    )
    linkage = json.loads(out)["binding"]
    assert linkage["guests"] == [{"name": "CAP", "site": 125}]
    assert linkage["ratio"] == pytest.approx(math.exp(linkage["ln_ratio"]))
