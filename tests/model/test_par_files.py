"""3DNA's .par files: a shape of one's own, and what is refused."""

import numpy as np
import pytest

from dnacheck.io.sequences import read_target
from dnacheck.model.chain import build_chain, chain_frames
from dnacheck.model.par_files import read_par
from dnacheck.numerics.outcome import InputError

HEADER = (
    "#        Shear    Stretch   Stagger   Buckle   Prop-Tw   Opening     Shift     Slide     Rise"
    "      Tilt      Roll      Twist"
)
PAIR = {"A": "A-T", "C": "C-G", "G": "G-C", "T": "T-A"}


def text(letters, steps, header=HEADER, count=None):
    """A file with the given steps (shift, slide, rise, tilt, roll, twist), one a pair."""
    lines = [f"{count or len(letters):4d} # base-pairs",
             "   0 # ***local base-pair & step parameters***", header]  # fmt: skip
    for letter, step in zip(letters, steps, strict=True):
        lines.append(f"{PAIR[letter]} " + " ".join(["0.100"] * 6 + [f"{v:9.3f}" for v in step]))
    return "\n".join(lines) + "\n"


def shape(n, closed=False):
    rng = np.random.default_rng(3)
    steps = np.array([0.1, 0.2, 3.3, 1.0, 2.0, 34.5]) + 0.1 * rng.standard_normal((n, 6)).round(2)
    if not closed:
        steps[0] = 0.0
    return steps


def test_a_shape_replaces_the_ground_values_of_the_set(tmp_path):
    letters = "ACGTTGCAACGTAGGCTA"
    path = tmp_path / "shape.par"
    for closed in (False, True):
        steps = shape(len(letters), closed)
        path.write_text(text(letters, steps))
        (molecule,) = read_target(str(path))
        assert molecule.sequence.letters == letters
        chain = build_chain(molecule, "olson1998")
        here = chain.ground * [1, 1, 1, chain.rise_A, chain.rise_A, chain.rise_A]
        here[:, :3] = np.degrees(here[:, :3])
        # Row k of the file is the step from pair k - 1 to pair k.
        expected = np.roll(steps, -1, axis=0)[:, [5, 3, 4, 0, 1, 2]]
        assert here[:-1] == pytest.approx(expected[:-1], abs=1e-9)
        own = build_chain(molecule.sequence, "olson1998")
        of_set = own.ground[-1, :3]
        closing = np.radians(expected[-1, :3]) if closed else of_set
        assert chain.ground[-1, :3] == pytest.approx(closing, abs=1e-12)
        stiffness = own.stiffness[:, :3, :3]
        assert chain.stiffness[:, :3, :3] == pytest.approx(stiffness, rel=1e-12)


def refused(tmp_path, content):
    path = tmp_path / "bad.par"
    path.write_text(content)
    with pytest.raises(InputError) as error:
        read_par(path)
    message = str(error.value)
    assert "\n" not in message
    assert "bad.par" in message
    return message


def test_bad_files_are_refused_with_their_line(tmp_path):
    letters, steps = "ACGTTGCAACGT", shape(12)
    helical = HEADER.replace("Shift", "X-disp").replace("Slide", "Y-disp")
    assert "x-disp" in refused(tmp_path, text(letters, steps, helical))
    assert "line 3: columns" in refused(tmp_path, text(letters, steps, helical))
    assert "not the 13" in refused(tmp_path, text(letters, steps, count=13))
    assert "11 values" in refused(tmp_path, text(letters, steps[:, :5]))
    assert "no line with the column names" in refused(tmp_path, text(letters, steps, "   0 # x"))
    wrong = text(letters, steps).replace("C-G", "C-A", 1)
    assert "'C-A' is not a base pair" in refused(tmp_path, wrong)
    radians = steps * [1, 1, 1, np.pi / 180, np.pi / 180, np.pi / 180]
    assert "radians" in refused(tmp_path, text(letters, radians))
    assert "no base pairs" in refused(tmp_path, "")


def test_a_set_with_three_angles_does_not_take_a_shape(tmp_path):
    path = tmp_path / "shape.par"
    path.write_text(text("ACGTTGCAACGT", shape(12)))
    with pytest.raises(InputError, match="needs a set with six"):
        build_chain(read_par(path), "trifonov2")


def test_the_other_strand_of_a_shape_is_the_same_ring(tmp_path):
    path = tmp_path / "shape.par"
    letters = "ACGTTGCAACGTAGGCTA"
    path.write_text(text(letters, shape(len(letters), closed=True)))
    molecule = read_par(path)
    chain = build_chain(molecule, "olson1998")
    other = build_chain(molecule.other_strand(()), "olson1998")
    end, frames = chain_frames(chain.ground, "rigid")
    other_end, other_frames = chain_frames(other.ground, "rigid")
    # The other strand starts at the last pair: cut the ring there and read it backwards.
    assert np.linalg.norm(end[-2]) == pytest.approx(np.linalg.norm(other_end[-2]), rel=1e-12)
    turned = np.diag([1.0, -1.0, -1.0])
    assert other_frames[-2] == pytest.approx(turned @ frames[-2].T @ turned, abs=1e-12)
