"""Odd values for every option of every command: one line that names the option, exit code 2.

The commands are asked what options they have, so that a new one is tried too.
"""

import click
import pytest

from dnacheck import cli

ODD = (
    "nan", "inf", "-inf", "1e400", "-1e400", "1e-400", "0", "-0", "-1", "1.5", "1e20",
    "100000000000000000000", "-100000000000000000000", "9" * 5000, "0x10", "1_0", "٣", "½",
    "", " ", "None", "true", "1,5", "1:2", "5..", "..5", "3..1", "1:2:3:4", "--", "\x00", "a\nb",
)  # fmt: skip
NAMES = tuple(cli.COMMAND_HELP)


def numeric_options():
    """Every option that takes something other than a word or a file."""
    words = (click.types.StringParamType, click.Path, click.Choice, click.File, type(click.BOOL))
    for name in NAMES:
        command = cli.cli.get_command(click.Context(cli.cli), name)
        for option in command.params:
            is_option = isinstance(option, click.Option) and not option.is_flag
            if is_option and option.nargs == 1 and not isinstance(option.type, words):
                yield pytest.param(name, option, id=f"{name} {option.opts[0]}")


def refuses(option, value):
    """Whether the option's own type refuses the value; it must say so, not crash."""
    try:
        option.type.convert(value, option, None)
    except click.BadParameter:
        return True
    return False


def test_the_options_that_matter_are_among_those_tried():
    tried = {f"{p.values[0]} {p.values[1].opts[0]}" for p in numeric_options()}
    assert {"ring --link", "ring --intervals", "jfactor --tolerance", "diagram --bp"} <= tried
    assert {"sweep --ratios", "scan --window", "md --samples", "ring --rise"} <= tried
    assert len(tried) > 60


@pytest.mark.parametrize(("name", "option"), list(numeric_options()))
def test_an_odd_value_gets_one_line_and_exit_code_2(capsys, name, option):
    refused = [value for value in ODD if refuses(option, value)]
    assert {"nan", "inf", "1e400", "9" * 5000, "", "None", "a\nb"} <= set(refused)
    for value in refused:
        code = cli.main([name, f"{option.opts[0]}={value}"])
        out, err = capsys.readouterr()
        assert code == 2, value
        assert out == ""
        assert len(err.strip().splitlines()) == 1
        assert option.opts[-1] in err or option.opts[0] in err
        assert "Traceback" not in err
        assert len(err) < 400


@pytest.mark.parametrize(
    "target",
    ["", " ", "N", "ACGU" * 10, "A", "12345", "no/such/file.fa", ">", "\x00", "é" * 20, "A" * 9],
)
@pytest.mark.parametrize("name", ["ring", "jfactor", "md", "sweep", "diagram", "sensitivity"])
def test_an_odd_target_gets_one_line_and_exit_code_2(capsys, name, target):
    code = cli.main([name, "--quiet", "--", target])
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err
