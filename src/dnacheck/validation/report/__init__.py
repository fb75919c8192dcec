"""The report of a run: HTML for people, JSON and CSV for programs."""
