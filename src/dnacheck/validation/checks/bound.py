"""A protein bound to every molecule: rings and J with and without it, binding constants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from dnacheck.numerics.outcome import SolveError
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Block, Column, Figure, Note, Rings, Table

if TYPE_CHECKING:
    from dnacheck.cyclization.binding import Binding
    from dnacheck.equilibria.ring import Equilibrium
    from dnacheck.model.chain import Chain

_SHAPES = ("C", "S", "")
_STIFFER = 1e6
_ENERGY_TOLERANCE_RT = 1e-5


def bound_chain(context: Context, name: str, steps: str | None = None) -> Chain:
    """A molecule's chain with the scene's guest, or another at the same site."""
    from dnacheck.model.guests import bind
    from dnacheck.validation.engine.rings import scene_chain

    scene = context.scene
    molecule = next(item for item in context.molecules if item.name == name)
    site = scene.guest.site_in(molecule.sequence.letters)
    assert site is not None  # the reader of scenes refuses what has none
    return bind(scene_chain(scene, molecule), site, steps or scene.guest.steps)


def shape_of(name: str) -> str:
    """C where bend and A-tracts are in phase (Table III), S where they are opposite, else empty."""
    from dnacheck.validation.reference.published import table3

    if name not in table3():
        return ""
    phase = table3()[name].bend_phasing
    return "C" if abs(phase - round(phase)) < 0.25 else "S"


def ratios(context: Context) -> Findings:
    """J free and bound of every molecule, and the ratio of binding constants."""
    from dnacheck.cyclization.binding import binding
    from dnacheck.cyclization.method import Run
    from dnacheck.cyclization.methods import Auto

    accuracy = context.scene.wanted.binding
    assert accuracy is not None
    found: dict[str, tuple[Chain, Binding]] = {}
    rows, unsolved = [], []
    for index, molecule in enumerate(context.molecules):
        chain = bound_chain(context, molecule.name)
        run = Run(rng=context.seed + index, tolerance=accuracy / math.sqrt(2.0))
        row: dict[str, Any] = {"name": chain.name, "shape": shape_of(chain.name)}
        try:
            linkage = binding(chain, Auto(), run)
        except SolveError as error:
            unsolved.append(chain.name)
            row["note"] = str(error)
        else:
            found[chain.name] = chain, linkage
            row |= _row(linkage)
        rows.append(row)
    rows.sort(key=lambda row: (_SHAPES.index(row["shape"]), row.get("minus_lnJ_bound", math.inf)))
    errors = [_error(linkage) for _, linkage in found.values()]
    results = [
        judge(
            "bound.ratios[solved]",
            "molecules without a ratio",
            len(unsolved),
            0,
            Rule.EQUAL,
            "every chain closes with some probability, bound or free",
            "none may be missed",
        ),
        judge(
            "bound.ratios[accuracy]",
            "largest error of ln of the ratio, as its methods measure it",
            max(errors, default=math.inf),
            accuracy,
            Rule.AT_MOST,
            "the scene's wish",
            "asked for by the scene",
        ),
        *_published(context, found),
    ]
    return Findings(results, [_table(context, rows), _figure(rows), *_rings(context, found)])


def _error(linkage: Binding) -> float:
    return math.hypot(linkage.free.total_error, linkage.bound.total_error)


def _row(linkage: Binding) -> dict[str, Any]:
    return {
        "minus_lnJ_free": linkage.free.minus_lnJ,
        "minus_lnJ_bound": linkage.bound.minus_lnJ,
        "link_free": linkage.free.links[0].link,
        "link_bound": linkage.bound.links[0].link,
        "ratio": linkage.ratio,
        "ln_ratio": linkage.ln_ratio,
        "error": _error(linkage),
        "facing_free": linkage.facing_free_deg,
        "facing_bound": linkage.facing_bound_deg,
        "change": linkage.register_change_deg,
        "note": f"{linkage.free.method}, {linkage.bound.method}",
    }


def _published(
    context: Context, found: dict[str, tuple[Chain, Binding]]
) -> list[CheckResult]:  # fmt: skip
    """The C-shaped molecules' mean against the published ratio, and the control."""
    from dnacheck.validation.reference.published import cap_ring_binding

    inside = [linkage for name, (_, linkage) in found.items() if shape_of(name) == "C"]
    if context.scene.guest.steps != "cap" or not inside:
        return []
    published = cap_ring_binding()
    mean = sum(linkage.ln_ratio for linkage in inside) / len(inside)
    results = [_against(f"{len(inside)} C-shaped molecules", mean, published)]
    first = next(name for name in found if shape_of(name) == "C")
    wrong = bound_chain(context, first, "roll=-40@-5,5")
    from dnacheck.cyclization.binding import binding
    from dnacheck.cyclization.methods import Laplace

    value = binding(wrong, Laplace(register=True)).ln_ratio
    control = _against(f"control: {first}", value, published)
    return [*results, must_fail(control, "the kinks bend towards the minor groove")]


def _against(item: str, ln_ratio: float, published: tuple[float, float]) -> CheckResult:
    ratio, sigma = published
    return judge(
        f"bound.ratios[{item}]",
        "ln of the binding constant on the ring over that on the linear molecule",
        ln_ratio,
        math.log(ratio),
        Rule.ABSOLUTE,
        "Kahn & Crothers (1992): about 200-fold for properly phased molecules",
        "two free energies of cyclization, each measured to 0.7 RT",
        sigma,
    )


def stiffened(context: Context) -> Findings:
    """Bound rings against the same steps stiffened, which needs nothing of what holds a guest."""
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring

    # The gradient of a stiff step rounds off at its stiffness times 1e-16.
    rounded = NewtonOptions(tolerance=1e-8)
    results = []
    for number, molecule in enumerate(context.molecules):
        chain = bound_chain(context, molecule.name)
        ring = find_rings(chain).lowest
        for factor in (_STIFFER, 1e2)[: 2 if number == 0 else 1]:
            elastic = chain.elastic()
            stiffness = elastic.stiffness.copy()
            stiffness[chain.bound] *= factor
            stiff = solve_ring(replace(elastic, stiffness=stiffness), ring.angles, rounded)
            control = factor != _STIFFER
            result = judge(
                f"bound.stiffened[{'control: ' if control else ''}{molecule.name}]",
                "energy of the bound ring",
                ring.energy_RT,
                stiff.energy_RT,
                Rule.ABSOLUTE,
                f"the ring of elastic steps, {factor:.0e} times stiffer where the guest is",
                "the difference falls as one over the stiffness: about 0.05 RT over 1e6",
                _ENERGY_TOLERANCE_RT,
                "RT",
            )
            results.append(must_fail(result, "the steps still give way") if control else result)
    return Findings(results)


def kinking(context: Context) -> Findings:
    """Free rings followed to bound ones as the guest bends its steps."""
    from dnacheck.equilibria.discrete.bound_search import follow_binding
    from dnacheck.equilibria.discrete.search import find_rings

    results, lines = [], []
    for molecule in context.molecules:
        chain = bound_chain(context, molecule.name)
        path = follow_binding(chain)
        lines.append(
            {
                "name": molecule.name,
                "x": [share for share, _ in path],
                "y": [ring.energy_RT for _, ring in path],
            }
        )
        share, end = path[-1]
        if share < 1.0:  # the branch ends; the figure shows where
            continue
        known = [ring.energy_RT for ring in find_rings(chain)]
        nearest = min(known, key=lambda energy: abs(energy - end.energy_RT))
        results.append(
            judge(
                f"bound.kinking[{molecule.name}]",
                "energy at the end of the branch from the free ring",
                end.energy_RT,
                nearest,
                Rule.RELATIVE,
                "a minimum that the search for bound rings found",
                "both are converged to 1e-10",
                1e-8,
                "RT",
            )
        )
    figure = Figure(
        "bound-kinking",
        "From the free ring to the bound one",
        "named_lines",
        {"lines": lines, "across": "share of the guest's bend", "up": "ring energy, RT"},
        "The lowest free ring of each molecule, followed as the guest holds its steps and bends "
        "them. A line that ends early loses its minimum there.",
        height=4.6,
    )
    return Findings(results, [figure])


def _table(context: Context, rows: Sequence[dict[str, Any]]) -> Table:
    from dnacheck.model.guests import guest_steps

    guest = guest_steps(context.scene.guest.steps)
    return Table(
        "bound-ratios",
        f"{guest.name} on rings and on linear molecules",
        [
            Column("name", "Molecule"),
            Column("shape", "Shape", help="C: bends in phase, S: opposite (Table III)"),
            Column("minus_lnJ_free", "−ln J free", "", ".3f"),
            Column("minus_lnJ_bound", "−ln J bound", "", ".3f"),
            Column("ratio", "ring / linear", "", ".3g", help="ratio of binding constants"),
            Column("ln_ratio", "ln of it", "", ".3f"),
            Column("error", "error of ln", "", ".3f"),
            Column("link_free", "link free", "", "d"),
            Column("link_bound", "link bound", "", "d"),
            Column("facing_free", "facing free", "°", ".0f"),
            Column("facing_bound", "facing bound", "°", ".0f"),
            Column("change", "change", "°", "+.0f"),
            Column("note", "Methods"),
        ],
        rows,
        "Ratio of the binding constants on the ring and on the linear molecule, J bound over J "
        "free; nothing fitted. Facing: the angle at the guest's site from the major groove to the "
        f"middle of the lowest ring. Guest: {guest.citation or guest.name}. Published for CAP: "
        "about 200-fold where the bends are in phase (C).",
        summary=not context.scene.checks.against_paper and len(rows) <= 30,
    )


def _figure(rows: Sequence[dict[str, Any]]) -> Figure:
    shown = [row for row in rows if "ratio" in row]
    return Figure(
        "bound-lnJ",
        "Free and bound: what the guest does to −ln J",
        "binding",
        {
            "rows": [
                {
                    "name": row["name"],
                    "shape": row["shape"],
                    "free": row["minus_lnJ_free"],
                    "bound": row["minus_lnJ_bound"],
                }
                for row in shown
            ]
        },
        "An arrow leads from the free molecule to the bound one. C-shaped molecules close more "
        "easily with the guest, S-shaped ones do not have to.",
        height=0.9 + 0.3 * len(shown),
    )


def _rings(context: Context, found: dict[str, tuple[Chain, Binding]]) -> list[Block]:
    """Lowest rings of the first molecule of each shape, free and bound, to turn."""
    from dnacheck.equilibria.discrete.search import find_rings

    chosen: dict[str, str] = {}
    for name in found:
        chosen.setdefault(shape_of(name), name)
    rings = []
    for shape in sorted(chosen):
        name = chosen[shape]
        chain = found[name][0]
        pair = (chain.guests[0].site + 1) % chain.n_steps
        curves = [
            {"label": "free", "style": "line", "colour": "#6b7885",
             "points": _seen_from(find_rings(chain.elastic(0.0)).lowest, pair)},
            {"label": "bound", "style": "beads", "colour": "#b4511f",
             "points": _seen_from(find_rings(chain).lowest, pair)},
        ]  # fmt: skip
        rings.append({"name": f"{name} ({shape}-shaped)" if shape else name, "curves": curves})
    if not rings:
        return [Note("bound-none", "No molecule could be bound.")]
    return [
        Rings(
            "bound-rings",
            "Rings to turn, free and bound",
            rings,
            "Seen from the guest's site, which lies at the origin of both; lengths in Å.",
        )
    ]


def _seen_from(ring: Equilibrium, pair: int) -> list[list[float]]:
    """Centres in Å along the directors of a base pair, rounded to 0.1."""
    centres, frames = ring.coordinates_A, ring.frames
    points = (centres - centres[pair]) @ frames[pair]
    return [[round(float(x), 1) for x in point] for point in points]


GROUP = Group(
    "bound",
    "Bound protein",
    "A protein holds some steps at the values that it brings; what it does to every molecule's "
    "ring, and how much more tightly it binds to rings than to linear molecules.",
    (
        Check("bound.ratios", "binding constants, ring over linear", ratios, 15.0, ("binding",),
              Level.QUICK),
        Check("bound.stiffened", "bound rings are the limit of stiff ones", stiffened, 0.5,
              ("binding",), Level.QUICK),
        Check("bound.kinking", "bound rings followed from free ones", kinking, 1.0, ("binding",),
              Level.QUICK),
    ),
)  # fmt: skip
