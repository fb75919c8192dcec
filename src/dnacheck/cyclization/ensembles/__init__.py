"""Metropolis ensembles of free and of closed chains."""
