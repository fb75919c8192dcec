"""Files: written whole or not at all, structures of rings."""
