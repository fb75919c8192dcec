"""Half chains: first and second halves drawn apart, all pairs that meet counted."""
