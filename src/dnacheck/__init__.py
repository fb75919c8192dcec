"""Elastic DNA rings: discrete wedge chains and continuum rods, each checked against the other.

Importing the package is cheap on purpose; numerical libraries are loaded by the subpackages that
need them: :mod:`dnacheck.numerics`, :mod:`dnacheck.model`, :mod:`dnacheck.equilibria`,
:mod:`dnacheck.cyclization`, :mod:`dnacheck.md` and :mod:`dnacheck.validation`.
"""

__all__ = ["__version__"]

__version__ = "0.1.0"
