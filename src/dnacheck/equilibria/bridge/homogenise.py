"""Continuum ring energy with the compliance that the steps have about the smooth centreline.

The rod of Section V is isotropic: bending 1/K1 and twisting 1/K3 about the smooth tangent,
uniform in arclength. The steps themselves are not quite that. Step i turns about three axes, a_tau
= d3(i), a_theta and a_phi = d2(i+1); under a moment M it turns by C_i M with C_i = sum a a^T/K
over the three. Seen from the smooth centreline the twisting axis leans by the local wedge and
a_phi is perpendicular to d3(i+1) instead of d3(i), so that where the molecule is curved bending
and twisting are coupled by a few per cent. This, and not the filter or the fit, makes nearly all
of the paper's gap (see docs/continuation.md).

To first order a change of compliance at fixed closure changes the energy by -1/2 M . dC M, with M
the moment of the solution at hand. The model's own 1/2 integral of M . C M is its energy E, so

    E_corrected = E - (1/2 sum_i M_i . C_i M_i - E)

with M_i = m(s_i) at the hinge between links i and i + 1, t = i + 1. No unknown is added and
nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuum.equations import directors
from dnacheck.equilibria.discrete.kernels.closure import linearise
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.chain import Chain, chain_frames
from dnacheck.model.rod.filtering import double_filter, padded_steps
from dnacheck.model.rod.natural_frame import NaturalFrame, evaluate_at_parameter, natural_frame
from dnacheck.model.rod.rod import Rod, _fit_breaks, as_cut
from dnacheck.model.rod.spline import fit_spline
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StepAxes:
    """Where the steps turn, and about what.

    Attributes
    ----------
    s : ndarray, shape (N,)
        Arclength of the hinge of step i, the centre of base pair i + 1.
    axes : ndarray, shape (N, 3, 3)
        Entry (i, :, k): components of the axis of angle k (tau, theta, phi) of step i along D1,
        D2, D3 of the unstressed natural frame there.
    """

    s: Array
    axes: Array

    def compliance(self, stiffness: Array) -> Array:
        """C_i in the natural frame, shape (N, 3, 3), from step stiffnesses (N, 3, 3)."""
        inverse = np.linalg.inv(stiffness)
        return np.asarray(np.einsum("iak,ikl,ibl->iab", self.axes, inverse, self.axes))


@dataclass(frozen=True)
class CorrectedEnergy:
    """What the correction makes of a ring's energy; all reduced.

    Attributes
    ----------
    energy : float
        Corrected.
    fitted : float
        The energy of the isotropic rod.
    spacing, twist, bend, coupling : float
        Parts of the difference: hinges not evenly spaced along the fitted arclength; twisting
        compliance about the smooth tangent; bending compliance across it; bend-twist coupling.
    """

    energy: float
    fitted: float
    spacing: float
    twist: float
    bend: float
    coupling: float


def step_axes(chain: Chain, rod: Rod) -> StepAxes:
    """Hinges and axes of a chain's steps, in its own order, in the natural frame of its rod.

    Raises
    ------
    InputError
        The rod was made from another chain.
    """
    if chain.n_steps != rod.n_steps:
        raise InputError(f"the rod has {rod.n_steps} steps, the chain {chain.n_steps}")
    chain = as_cut(chain, rod.cut)
    natural, start = _fitted(chain, rod)
    n = chain.n_steps
    centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    own, halves = np.empty((n, 3, 3)), np.empty((n, 5, 3))
    linearise(chain.ground, chain.form_code, centres, frames, own, halves)
    # rows are axes, in the frame of base pair 0, which the padded chain has at ``start``
    axes = np.einsum("ab,ikb->iak", start, own)
    hinges: Array = np.arange(n, dtype=float) + 1.0
    s, d1, d3 = evaluate_at_parameter(natural, hinges)
    triad = np.stack([d1, np.cross(d3, d1), d3], axis=-1)
    local = np.roll(np.einsum("iab,iac->ibc", triad, axes), rod.cut, axis=0)
    s = np.roll(s, rod.cut)
    for array in (s, local):
        array.setflags(write=False)
    return StepAxes(s, local)


def _fitted(chain: Chain, rod: Rod) -> tuple[NaturalFrame, Array]:
    """Natural frame of the fitted centreline, and frame 0 of the chain, in the padded chain's axes.

    The rod keeps the strains of its natural frame only, so the fit is made again.
    """
    options, n = rod.options, rod.n_steps
    padded = chain.ground[padded_steps(n, options.padding)]
    centres, frames = chain_frames(padded, chain.step_form)
    t = np.arange(len(centres), dtype=float) - options.padding
    smooth = double_filter(centres, options.filter_width)
    curve = fit_spline(t, smooth, _fit_breaks(n, options), options.degree, options.condition_limit)
    first: Array = frames[options.padding]
    natural = natural_frame(
        curve, 0.5, n + 0.5, first[:, 0], options.chebyshev_points, options.slowest_speed
    )
    return natural, first


def corrected_energy(
    ring: Equilibrium, chain: Chain, axes: StepAxes | None = None
) -> CorrectedEnergy:
    """Energy of a continuum ring with the compliance of the steps.

    Parameters
    ----------
    ring : Equilibrium
    chain : Chain
        The chain that the ring's rod was made from.
    axes : StepAxes, optional
        To save making them again.
    """
    axes = step_axes(chain, ring.rod) if axes is None else axes
    solution = ring.curve.solution(axes.s)
    moment = local_moment(solution[:, 3:7], solution[:, :3], ring.curve.loads)
    compliance = axes.compliance(chain.stiffness)
    uniform = np.array([1.0 / ring.rod.bend_stiffness] * 2 + [1.0 / ring.rod.twist_stiffness])
    # relative compliance of the rod, where it varies, at the hinges
    relative = ring.rod.relative_compliance(axes.s)[:, [0, 0, 1]]
    rod = uniform * relative / chain.n_steps
    as_steps = 0.5 * float(np.sum(moment**2 * rod))
    own = 0.5 * moment**2 * np.diagonal(compliance, axis1=1, axis2=2)
    twist = 0.5 * float(np.sum(moment[:, 2] ** 2 * rod[:, 2])) - float(own[:, 2].sum())
    bend = 0.5 * float(np.sum(moment[:, :2] ** 2 * rod[:, :2])) - float(own[:, :2].sum())
    bend -= float(np.sum(moment[:, 0] * moment[:, 1] * compliance[:, 0, 1]))
    coupling = -float(np.sum(moment[:, 2, None] * moment[:, :2] * compliance[:, :2, 2]))
    spacing = ring.energy - as_steps
    return CorrectedEnergy(
        energy=ring.energy + spacing + twist + bend + coupling,
        fitted=ring.energy,
        spacing=spacing,
        twist=twist,
        bend=bend,
        coupling=coupling,
    )


def local_moment(quaternions: Array, centres: Array, loads: Array) -> Array:
    """Moments about D1, D2, D3, shape (m, 3), from q (m, 4), r (m, 3) and (m(0), n)."""
    moment = loads[:3] - np.cross(centres, np.broadcast_to(loads[3:], centres.shape))
    return np.asarray(np.einsum("mij,mi->mj", directors(quaternions), moment))


def moment_energy(moment: Array, compliance: Array) -> float:
    """1/2 sum_i M_i . C_i M_i."""
    return 0.5 * float(np.einsum("ia,iab,ib->", moment, compliance, moment))
