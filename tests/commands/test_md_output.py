"""The last line of ``dnacheck md`` says what its findings say."""

from types import SimpleNamespace

import pytest

from dnacheck.commands.md_output import print_check
from dnacheck.md.check import MdCheck
from dnacheck.md.findings import Finding
from dnacheck.numerics.outcome import Status

PASS = Finding("passed", 0.1, 1.0, 0.1)
UNDECIDED = Finding("noisy", 2.0, 1.0, 1.0)
FAIL = Finding("failed", 2.0, 1.0, 0.1)


@pytest.mark.parametrize(
    ("findings", "last"),
    [
        ((PASS,), "every check passed"),
        ((PASS, UNDECIDED, UNDECIDED), "no check failed, but 2 of 3 are undecided: more --samples"),
        ((PASS, UNDECIDED, FAIL), "A CHECK FAILED"),
    ],
)
def test_undecided_is_not_passed(capsys, findings, last):
    check = SimpleNamespace(
        chain=SimpleNamespace(name="x", n_steps=158),
        platform="Reference",
        minima=(),
        rings=(),
        statistics=None,
        ensemble=None,
        findings=findings,
        trouble="",
        status=Status.CONVERGED,
        undecided=MdCheck.undecided.fget(SimpleNamespace(findings=findings)),
    )
    check.passed = MdCheck.passed.fget(check)
    print_check(check)
    out = capsys.readouterr().out.splitlines()
    assert out[-1].strip().startswith(last)
