"""What import-linter's contracts cannot say about who imports whom."""

import grimp
import pytest


def is_kernel(module):
    return any(part == "kernels" or part.endswith("_kernels") for part in module.split("."))


def allowed_for_kernels(module):
    return is_kernel(module) or module.startswith("dnacheck.numerics.")


@pytest.fixture(scope="module")
def graph():
    return grimp.build_graph("dnacheck", cache_dir=None)


def test_kernels_import_nothing_of_ours_but_numerics_and_kernels(graph):
    kernels = sorted(filter(is_kernel, graph.modules))
    assert kernels
    wrong = {
        (kernel, imported)
        for kernel in kernels
        for imported in graph.find_modules_directly_imported_by(kernel)
        if not allowed_for_kernels(imported)
    }
    assert wrong == set()


@pytest.mark.parametrize(
    ("imported", "allowed"),
    [
        ("dnacheck.numerics.rotations", True),
        ("dnacheck.equilibria.discrete.kernels.closure", True),
        ("dnacheck.cyclization.kernels.walk", True),
        ("dnacheck.model.chain", False),
        ("dnacheck.model.kernelsmith", False),
    ],
)
def test_the_rule_for_kernels_tells_right_from_wrong(imported, allowed):
    assert allowed_for_kernels(imported) is allowed
