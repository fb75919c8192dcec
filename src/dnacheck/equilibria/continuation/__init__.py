"""Families of continuum rings: pseudo-arclength continuation, branch points, diagrams."""

from dnacheck.equilibria.continuation.branch import Branch, BranchError, End, Kind, SpecialPoint
from dnacheck.equilibria.continuation.component import Component, follow_component
from dnacheck.equilibria.continuation.diagram import (
    components,
    curvature_branch,
    imperfect_component,
    lowest_component,
    perfect_diagram,
    ratio_branch,
)
from dnacheck.equilibria.continuation.follow import Bounds, follow_branch
from dnacheck.equilibria.continuation.options import ContinuationOptions
from dnacheck.equilibria.continuation.parameters import Conditions, Parameter, custom, perfect_rod

__all__ = [
    "Bounds",
    "Branch",
    "BranchError",
    "Component",
    "Conditions",
    "ContinuationOptions",
    "End",
    "Kind",
    "Parameter",
    "SpecialPoint",
    "components",
    "curvature_branch",
    "custom",
    "follow_branch",
    "follow_component",
    "imperfect_component",
    "lowest_component",
    "perfect_diagram",
    "perfect_rod",
    "ratio_branch",
]
