"""The front door: what is there, how it is shown, and what it costs to open."""

import inspect
import pydoc
import subprocess
import sys

import pytest

import dnacheck as dc

NAMES = [name for name in dir(dc) if not name.startswith("_")]


def test_the_promised_names_are_there_and_no_more_than_twenty_five():
    promised = """chain rod rings jfactor diagram twist_ratio_scan ensemble scan validate
    sensitivity profile fit Ring NickedRing HingedRing Loop Pull Laplace ClosureSampling HalfChain
    Umbrella Auto InputError SolveError""".split()
    assert set(promised) <= set(NAMES)
    assert len(NAMES) <= 26  # those of API.md, and bind
    for name in NAMES:
        assert callable(getattr(dc, name))


def test_help_shows_every_name_on_one_screen():
    text = pydoc.plain(pydoc.render_doc(dc))
    assert len(text.splitlines()) <= 60
    for name in NAMES:
        assert name in dc.__doc__


@pytest.mark.parametrize("name", [name for name in NAMES if name[0].islower()])
def test_every_verb_says_what_it_takes_gives_and_refuses(name):
    text = inspect.getdoc(getattr(dc, name))
    for section in ("Parameters", "Returns", "Raises", "Examples"):
        assert f"\n{section}\n" in text
    signature = inspect.signature(getattr(dc, name))
    for parameter in signature.parameters:
        assert parameter in text


def test_a_mistyped_name_is_answered_with_the_nearest():
    with pytest.raises(AttributeError, match="did you mean 'jfactor'"):
        _ = dc.jfacto


def test_importing_submodules_does_not_hide_a_verb():
    code = (
        "import dnacheck as dc, importlib\n"
        "for name in ('scanning.scan', 'validation.scene.scene', 'cyclization', 'equilibria',\n"
        "             'mechanics.fit', 'mechanics.profile', 'commands.scan'):\n"
        "    importlib.import_module('dnacheck.' + name)\n"
        "import inspect\n"
        "bad = [n for n in dir(dc) if inspect.ismodule(getattr(dc, n))]\n"
        "assert not bad, bad\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_opening_the_door_loads_no_numerical_library():
    code = (
        "import sys\n"
        "import dnacheck as dc\n"
        "dir(dc)\n"
        "heavy = {'numpy', 'numba', 'scipy', 'pandas', 'matplotlib', 'openmm'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
