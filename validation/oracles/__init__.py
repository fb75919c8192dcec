"""Independent solvers that the package's own are compared with."""
