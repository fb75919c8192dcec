"""Independent check of rings: OpenMM bead chains, read back with MDAnalysis."""
