"""Sets of six parameters: Olson's against the published tables, a user's own against mistakes."""

import csv

import numpy as np
import pytest

from dnacheck.model.chain import build_chain
from dnacheck.model.data_files import data_directory
from dnacheck.model.parameters import TETRANUCLEOTIDES, load_parameters
from dnacheck.model.sequence import STEP_NAMES, Sequence, complement, reverse_complement
from dnacheck.numerics.outcome import InputError

FIELD = ("tilt", "roll", "twist", "shift", "slide", "rise")
LETTERS = "ACGTTGCAACCGGATATTCGGA"


def published():
    """The ten printed steps: means (6,) and force constants (6, 6) in the field's order."""
    means, forces = {}, {}
    with (data_directory() / "published" / "olson1998_protein_dna_steps.csv").open() as handle:
        for row in csv.DictReader(handle):
            means[row["step"]] = np.array([float(row[name]) for name in FIELD])
    path = data_directory() / "published" / "olson1998_protein_dna_force_constants.csv"
    with path.open() as handle:
        for row in csv.DictReader(handle):
            matrix = np.empty((6, 6))
            for i, a in enumerate(FIELD):
                for j, b in enumerate(FIELD):
                    matrix[i, j] = float(row[f"{a}_{b}" if i <= j else f"{b}_{a}"])
            forces[row["step"]] = matrix
    return means, forces


def all_steps():
    """All sixteen steps, the six others by strand reversal."""
    means, forces = published()
    signs = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    for step in list(means):
        other = reverse_complement(step)
        if other not in means:
            means[other] = signs * means[step]
            forces[other] = np.outer(signs, signs) * forces[step]
    return means, forces


def in_field_units(table, row):
    """Ground and stiffness of one step in the field's order, degrees, Å and kT."""
    order = [1, 2, 0, 3, 4, 5]
    units = np.array([180.0 / np.pi] * 3 + [1.0] * 3)
    matrix = table.stiffness[row][np.ix_(order, order)] / np.outer(units, units)
    return table.ground[row][order] * units, matrix


def test_olson_1998_is_what_is_printed_and_its_reversal():
    table = load_parameters("olson1998")
    means, forces = all_steps()
    assert table.kind == "rigid"
    assert table.strand_symmetric
    assert "95, 11163" in table.citation
    assert len(means) == 16
    for row, step in enumerate(STEP_NAMES):
        ground, matrix = in_field_units(table, row)
        assert ground == pytest.approx(means[step], rel=1e-13, abs=1e-15)
        assert matrix == pytest.approx(forces[step], rel=1e-13, abs=1e-15)


def test_a_chain_takes_rise_as_length_and_kt_as_energy():
    chain = build_chain(Sequence("x", LETTERS), "olson1998")
    means, forces = all_steps()
    first = STEP_NAMES[Sequence("x", LETTERS).step_indices()[0]]
    ground = chain.ground[0] * np.array([180.0 / np.pi] * 3 + [chain.rise_A] * 3)
    assert ground[[1, 2, 0, 3, 4, 5]] == pytest.approx(means[first])
    strain = np.array([0.01, -0.02, 0.03, 0.1, -0.05, 0.02])
    field = strain * np.array([180.0 / np.pi] * 3 + [chain.rise_A] * 3)
    field = field[[1, 2, 0, 3, 4, 5]]
    assert strain @ chain.stiffness[0] @ strain == pytest.approx(field @ forces[first] @ field)
    assert chain.energy_scale_RT == 1.0
    assert chain.ground[:, 5].mean() == pytest.approx(1.0)


@pytest.mark.parametrize("option", ["twist_ratio", "persistence_length_A", "rise_A"])
def test_lengths_and_energies_of_the_set_are_not_overruled(option):
    with pytest.raises(InputError, match="of its own"):
        build_chain(Sequence("x", LETTERS), "olson1998", **{option: 3.4})


def toml(means, forces, head="", unit=1.0):
    lines = ['unit = "degree"', 'stiffness_unit = "kT"', head]
    for step, values in means.items():
        lines.append(f"[steps.{step}]")
        scale = np.array([unit] * 3 + [1.0] * 3)
        lines += [f"{k} = {float(v)!r}" for k, v in zip(FIELD, values * scale, strict=True)]
        lines.append(f"stiffness = {(forces[step] / np.outer(scale, scale)).tolist()}")
    return "\n".join(lines)


def load(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return load_parameters(str(path))


def refused(tmp_path, text, match):
    with pytest.raises(InputError, match=match) as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_own_sets_of_16_and_of_10_steps_are_the_same(tmp_path):
    embedded = load_parameters("olson1998")
    full = load(tmp_path, toml(*all_steps()))
    ten = load(tmp_path, toml(*published(), "complete_by_reversal = true"))
    for table in (full, ten):
        assert table.ground == pytest.approx(embedded.ground, rel=1e-12, abs=1e-15)
        assert table.stiffness == pytest.approx(embedded.stiffness, rel=1e-12, abs=1e-12)
    refused(tmp_path, toml(*published()), "missing step CT, GG, GT")


def test_tetranucleotides(tmp_path):
    """Steps between their neighbours: a rise that tells which of the 256 was taken."""
    means, forces = all_steps()
    rise = {}
    for name in TETRANUCLEOTIDES:
        pair = min(name, reverse_complement(name))
        rise[name] = 3.3 + 1e-4 * TETRANUCLEOTIDES.index(pair)
    four = {name: np.append(means[name[1:3]][:5], rise[name]) for name in TETRANUCLEOTIDES}
    text = toml(four, {name: forces[name[1:3]] for name in TETRANUCLEOTIDES})
    table = load(tmp_path, text)
    assert table.context == 4
    assert table.strand_symmetric
    chain = build_chain(Sequence("x", LETTERS), table)
    n = len(LETTERS)
    expected = [rise["".join(LETTERS[(i + k) % n] for k in (-1, 0, 1, 2))] for i in range(n)]
    assert chain.rise_A * chain.ground[:, 5] == pytest.approx(expected)
    lacking = text.replace("[steps.GATC]", "[steps.GATX]", 1)
    refused(tmp_path, lacking, "'GATX' is not a tetranucleotide")
    start = text.index("[steps.GATC]")
    refused(tmp_path, text[:start] + text[text.index("[steps.", start + 1) :], "missing step GATC")


def test_bad_input_names_the_step_and_the_mend(tmp_path):
    means, forces = all_steps()
    lowered = dict(forces)
    lowered["GA"] = forces["GA"] - 0.5 * np.eye(6)
    message = refused(tmp_path, toml(means, lowered), "step GA is not positive definite")
    lowest = np.linalg.eigvalsh(lowered["GA"])[0]
    assert f"eigenvalue {lowest:.4g}" in message
    radians = toml(means, forces, unit=np.pi / 180.0)
    refused(tmp_path, radians, "these are radians")
    degrees = toml(means, forces).replace('"degree"', '"radian"')
    refused(tmp_path, degrees, "these are degrees")
    assert load(tmp_path, radians.replace('"degree"', '"radian"')).ground == pytest.approx(
        load_parameters("olson1998").ground, rel=1e-12, abs=1e-15
    )
    scale = np.array([180.0 / np.pi] * 3 + [1.0] * 3)
    per_radian = {k: f * np.outer(scale, scale) for k, f in forces.items()}
    refused(tmp_path, toml(means, per_radian), r"kT/radian\^2")
    per_nm = np.array([1.0] * 3 + [10.0] * 3)
    refused(
        tmp_path, toml(means, {k: f * np.outer(per_nm, per_nm) for k, f in forces.items()}),
        r"kT/nm\^2",
    )  # fmt: skip
    refused(tmp_path, toml(means, forces).replace("slide", "slid", 1), "unknown key 'slid'")
    refused(tmp_path, toml(means, forces).replace("stiffness =", "#", 1), "no stiffness")
    refused(tmp_path, toml(means, forces).replace('"kT"', '"kJ/mol"'), "stiffness_unit")
    asymmetric = dict(forces)
    asymmetric["CA"] = forces["CA"] + np.triu(np.full((6, 6), 1e-3), 1)
    refused(tmp_path, toml(means, asymmetric), "CA is not symmetric")


def unreversed():
    """The set as a widely used file has it: CT, GT, TC and TG complemented, not reversed."""
    means, forces = all_steps()
    signs = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    wrong_means, wrong_forces = dict(means), dict(forces)
    for step in ("CT", "GT", "TC", "TG"):
        wrong_means[step] = signs * means[complement(step)]
        wrong_forces[step] = np.outer(signs, signs) * forces[complement(step)]
    return wrong_means, wrong_forces


def test_steps_that_were_complemented_without_being_reversed_are_named(tmp_path):
    message = refused(tmp_path, toml(*unreversed()), "strand relation")
    assert "CT, GT, TC, TG: complemented without being reversed" in message
    table = load(tmp_path, toml(*unreversed(), "strand_symmetric = false"))
    assert table.unreversed_steps == ("CT", "GT", "TC", "TG")
    assert set(table.asymmetric_steps) == {"AC", "AG", "CA", "GA", "CT", "GT", "TC", "TG"}
    warning = build_chain(Sequence("x", LETTERS), table).warnings[0]
    assert "without being reversed" in warning


def emdna(path, table):
    path.write_text(
        "\n".join(
            f"{step}={{{', '.join(repr(float(x)) for x in np.ravel(values))}}}"
            for step, values in table.items()
        )
    )
    return str(path)


def test_the_pair_of_files_that_emdna_packs(tmp_path):
    means, forces = all_steps()
    steps = emdna(tmp_path / "steps.txt", means)
    force = emdna(tmp_path / "forces.txt", forces)
    table = load_parameters(f"{steps},{force}")
    embedded = load_parameters("olson1998")
    assert table.ground == pytest.approx(embedded.ground, rel=1e-12, abs=1e-15)
    assert table.stiffness == pytest.approx(embedded.stiffness, rel=1e-12, abs=1e-12)
    wrong_means, wrong_forces = unreversed()
    table = load_parameters(
        emdna(tmp_path / "s.txt", wrong_means) + "," + emdna(tmp_path / "f.txt", wrong_forces)
    )
    assert table.unreversed_steps == ("CT", "GT", "TC", "TG")
    for text, match in (
        ("AA={1, 2, 3}", "AA has 3 numbers, not 6"),
        ("AA=1,2,3,4,5,6", "line 1: expected a line such as AA="),
        ("AA={0,0,35,0,0,x}", "not a number in AA"),
        ("AA={0,0,35,0,0,3.4}", "missing step AC"),
        ("", "no line such as"),
    ):
        (tmp_path / "bad.txt").write_text(text)
        with pytest.raises(InputError, match=match):
            load_parameters(f"{tmp_path / 'bad.txt'},{force}")
