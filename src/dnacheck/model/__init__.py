"""From letters to an elastic chain of base-pair steps, and on to a smooth rod."""
