"""Cases in which naive code breaks, each with what must happen and what did."""

from dnacheck.validation.cases.case import HardCase

__all__ = ["HardCase"]
