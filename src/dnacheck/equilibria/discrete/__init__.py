"""Closed equilibria of the chain of base-pair steps (Section IV A)."""
