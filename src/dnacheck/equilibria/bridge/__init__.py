"""From the continuum ring to base pairs and from the steps to the rod."""
