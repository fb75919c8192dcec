"""Checks, one module per chapter of the report; each defines ``GROUP``.

To add a check, write a function Context -> Findings in the module it belongs to and list it in
the module's ``GROUP``; to add a group, list its module in ``registry.GROUP_MODULES`` too. A
module imports solvers inside its functions, so that listing the checks stays quick.
"""
