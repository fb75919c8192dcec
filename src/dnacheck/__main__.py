"""``python -m dnacheck``: the same as the ``dnacheck`` command."""

import sys

from dnacheck.cli import main

if __name__ == "__main__":
    sys.exit(main())
