"""Formulas are drawn from ordinary LaTeX, and what cannot be drawn is said."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "docs" / "_ext"))

from mathtext import normalised, svg


@pytest.mark.parametrize(
    ("latex", "expected"),
    [
        (r"\frac14\cos\frac\phi2", r"\frac{1}{4}\cos\frac{\phi}{2}"),
        (r"\frac a{b^2}", r"\frac{a}{b^2}"),
        (r"\hat\mathbf x \le 3", r"\hat{\mathbf{x}} \leq 3"),
        (r"\sqrt[3]{x} + \sqrt N", r"\sqrt[3]{x} + \sqrt{N}"),
        (r"\Big(\sum_i x_i\Big)", r"(\sum_i x_i)"),
        (r"\sqrt{\frac{K}{2\pi}}", r"\sqrt{\frac{K}{2\pi}}"),
    ],
)
def test_arguments_get_braces(latex, expected):
    assert normalised(latex) == expected
    assert "<path d=" in svg(latex)


def test_unknown_command_is_an_error():
    with pytest.raises(ValueError, match="nosuchcommand"):
        svg(r"\nosuchcommand x")
