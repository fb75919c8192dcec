"""The report of a run: HTML for people, JSON and CSV for programs."""

from dnacheck.validate.report.write import RunRecord, write_report

__all__ = ["RunRecord", "write_report"]
