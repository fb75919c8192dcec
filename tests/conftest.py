"""Settings of the whole test run.

Hypothesis draws the same examples every time unless HYPOTHESIS_PROFILE=search, which draws new
ones and more of them; no profile has a deadline, because the first call of a kernel compiles it.
"""

import os

from hypothesis import settings

# What a command says when it compiles first depends on what ran before.
os.environ.setdefault("DNACHECK_AHEAD", "0")

settings.register_profile("fixed", derandomize=True, deadline=None, database=None, print_blob=True)
settings.register_profile("search", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))
