"""The directive ``command-help``: every command's own ``--help``, asked for at build time."""

from __future__ import annotations

import importlib
from typing import Any

import click
from docutils import nodes
from docutils.parsers.rst import Directive

from dnacheck.cli import COMMAND_HELP, cli


def help_texts() -> dict[str, str]:
    """Help text of the program and of each command that is installed, by its full name."""
    root = click.Context(cli, info_name="dnacheck", max_content_width=100, terminal_width=100)
    texts = {"dnacheck": cli.get_help(root)}
    for name in COMMAND_HELP:
        try:
            command = importlib.import_module(f"dnacheck.commands.{name}").command
        except ModuleNotFoundError:
            continue
        context = click.Context(
            command, info_name=name, parent=root, max_content_width=100, terminal_width=100
        )
        texts[f"dnacheck {name}"] = command.get_help(context)
    return texts


class CommandHelp(Directive):
    """One section per command with its help as literal text."""

    def run(self) -> list[nodes.Node]:
        sections: list[nodes.Node] = []
        for name, text in help_texts().items():
            section = nodes.section(ids=[nodes.make_id(name)], names=[name])
            section += nodes.title(name, name)
            section += nodes.literal_block(text, text, language="none")
            self.state.document.note_explicit_target(section)
            sections.append(section)
        return sections


def setup(app: Any) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
