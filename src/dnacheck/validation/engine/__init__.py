"""Which checks there are, which a scene needs, how they run and what their verdicts are."""
