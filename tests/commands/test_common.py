"""Options that the commands share."""

import inspect
import os

import click
import pytest

import dnacheck as dc
from dnacheck.commands.common import (
    ContinuumSettings,
    ModelSettings,
    RingSettings,
    RunSettings,
    common_options,
    continuum_options,
    model_options,
    ring_options,
    target_argument,
)
from dnacheck.model.chain import build_chain
from dnacheck.numerics.processors import available_processors


@pytest.fixture(autouse=True)
def library_threads(monkeypatch):
    """--threads sets these for the process; the test gives them back."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(variable, "1")


@click.command()
@target_argument
@ring_options
@model_options
@continuum_options
@common_options
def command(**settings):
    return settings


def parse(*arguments):
    return command.main(["11T15", *arguments], standalone_mode=False)


def test_defaults_are_those_of_the_paper():
    assert parse() == {
        "target": "11T15",
        "model": ModelSettings("trifonov2", None, None, None, "auto"),
        "ring": RingSettings("both", "auto", "ring"),
        "continuum": ContinuumSettings(15, 20, 6),
        "run": RunSettings(False, 0, available_processors(), False, False),
    }


def test_every_option_arrives():
    settings = parse(
        *"--angles own.toml --twist-ratio 0.7 --persistence-length 500 --rise 3.3".split(),
        *"--a-tracts 30..92 --model discrete --link -3 --ends nicked --filter-width 11".split(),
        *"--intervals 30 --degree 5 --json --seed 7 --threads 3 --quiet --debug".split(),
    )
    assert settings == {
        "target": "11T15",
        "model": ModelSettings("own.toml", 0.7, 500.0, 3.3, (30, 92)),
        "ring": RingSettings("discrete", -3, "nicked"),
        "continuum": ContinuumSettings(11, 30, 5),
        "run": RunSettings(True, 7, 3, True, True),
    }
    assert os.environ["OMP_NUM_THREADS"] == "3"


def test_settings_name_the_arguments_of_what_they_are_for():
    settings = parse()
    for arguments, function in (
        (settings["model"].chain_arguments(), dc.chain),
        (settings["model"].build_arguments(), build_chain),
        (settings["continuum"].rod_arguments(), dc.rod),
    ):
        assert set(arguments) <= set(inspect.signature(function).parameters)


@pytest.mark.parametrize("link", ["auto", "all"])
def test_links_by_name(link):
    assert parse("--link", link)["ring"].link == link


@pytest.mark.parametrize(
    ("option", "value", "text"),
    [
        ("--twist-ratio", "0", "give a number from 0.01 to 100"),
        ("--twist-ratio", "-1", "from 0.01 to 100"),
        ("--twist-ratio", "nan", "from 0.01 to 100"),
        ("--twist-ratio", "1e-10", "from 0.01 to 100"),
        ("--rise", "inf", "from 0.1 to 100 Å"),
        ("--rise", "1e10", "from 0.1 to 100 Å"),
        ("--persistence-length", "long", "'long' is not a number"),
        ("--persistence-length", "1e-5", "from 1 to 100000 Å"),
        ("--link", "1.5", "not 'auto', 'all' or an integer"),
        ("--link", "100000000000000000000", "from -1000000 to 1000000"),
        ("--link", "9" * 5000, "(5000 characters)"),
        ("--intervals", "1000000000", "from 1 to 10000"),
        ("--threads", "0", "from 1 to 1024"),
        ("--a-tracts", "5", "such as 30..92"),
        ("--a-tracts", "9..5", "lies after"),
        ("--a-tracts", "1..9999999999", "such as 30..92"),
        ("--degree", "0", "from 1 to 12"),
        ("--seed", "-1", "from 0 to 9223372036854775807"),
        ("--model", "both-of-them", "is not one of"),
    ],
)
def test_bad_values_are_named(option, value, text):
    with pytest.raises(click.UsageError) as caught:
        parse(option, value)
    message = caught.value.format_message()
    assert option in message
    assert text in message
