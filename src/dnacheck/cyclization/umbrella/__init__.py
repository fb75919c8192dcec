"""Metropolis sampling under closure restraints of growing strength, joined by MBAR."""
