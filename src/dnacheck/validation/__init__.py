"""Scenes, checks with verdicts, figures and the report."""
