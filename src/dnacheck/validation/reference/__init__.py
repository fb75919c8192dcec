"""What is compared with: published tables, exact limits, independent programs."""
