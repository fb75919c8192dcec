"""The commands of ``dnacheck``, one thin module each.

The module ``dnacheck.commands.NAME`` defines ``command``, a :class:`click.Command`; its function
returns the exit code, or None for 0. Modules are imported only when their command is invoked.
"""
