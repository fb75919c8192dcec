"""The continuum rod's diagram by AUTO-07p, the program the paper used.

``rod.f90`` states (4.9) and (4.11) in the paper's fourteen variables with s as a fifteenth; this
module writes the rod's strains and a starting solution for it, compiles it against AUTO's objects
in a temporary folder, runs it there, and reads its table of solutions. What it takes from the
package is the rod and one solution in the paper's variables.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

_FOLDERS = ("/usr/lib/auto-07p", "/usr/local/auto/07p")
_SOURCE = Path(__file__).with_name("rod.f90")


class RodLike(Protocol):
    """What the oracle needs to know about a rod."""

    bend_stiffness: float
    twist_stiffness: float
    breaks: Any
    strain_series: Any


@dataclass(frozen=True)
class AutoBranch:
    """What AUTO computed.

    Attributes
    ----------
    alpha, energy, end_moment : ndarray, shape (M,)
        Energy is 0 where it was not asked for.
    seconds : float
        Processor time of the run, from start to end of the process.
    """

    alpha: np.ndarray
    energy: np.ndarray
    end_moment: np.ndarray
    seconds: float

    @property
    def seconds_per_point(self) -> float:
        """Processor time over the number of points."""
        return self.seconds / len(self.alpha)


def installed() -> bool:
    """Whether AUTO-07p's objects and a Fortran compiler are there."""
    return _objects() is not None and shutil.which("gfortran") is not None


def _objects() -> list[str] | None:
    folders = [os.environ["AUTO_DIR"]] if "AUTO_DIR" in os.environ else []
    for folder in (*folders, *_FOLDERS):
        library = Path(folder) / "lib"
        if (library / "main.o").is_file():
            return [str(path) for path in sorted(library.glob("*.o"))]
    return None


def follow_twist(
    rod: RodLike,
    alpha: float,
    solution: np.ndarray,
    *,
    points: int = 150,
    intervals: int = 50,
    degree: int = 4,
    first_step: float = 0.05,
    longest_step: float = 0.5,
    tolerance: float = 1e-7,
    energy: bool = False,
    most: float | None = None,
) -> AutoBranch:
    """Follow a ring in the end twist alpha, on a uniform mesh that is not adapted.

    Parameters
    ----------
    alpha : float
        End twist of the start, radians.
    solution : ndarray, shape (intervals * degree + 1, 14)
        (r, q, n, mu) of the start at equal steps of s, mu_4(0) = 0.
    energy : bool
        Carry the energy as a sixteenth state: exact quadrature, a slower run.
    most : float, optional
        Stop at this alpha.

    Raises
    ------
    RuntimeError
        AUTO is not installed, does not compile, or fails.
    """
    objects = _objects()
    if objects is None or shutil.which("gfortran") is None:
        raise RuntimeError("AUTO-07p or gfortran is not installed")
    with tempfile.TemporaryDirectory(prefix="dnacheck-auto-") as folder:
        place = Path(folder)
        _write_rod(place / "rod.dat", rod)
        _write_start(place / "start.dat", rod, alpha, solution)
        n_dim = 16 if energy else 15
        stop = "" if most is None else f"UZSTOP = {{1: {most:.15g}}}\n"
        (place / "fort.2").write_text(
            f"NDIM={n_dim}, IPS=4, IRS=0, ILP=0\nICP=[1, 2, 3]\n"
            f"NTST={intervals}, NCOL={degree}, IAD=0, ISP=0, ISW=1, IPLT=0\n"
            f"NBC={n_dim}, NINT=0\nNMX={points}, NPR={10 * points}, MXBF=0, IID=2\n"
            f"ITMX=9, ITNW=7, NWTN=3, JAC=1\n"
            f"EPSL={tolerance}, EPSU={tolerance}, EPSS={tolerance}\n"
            f"DS={first_step}, DSMIN=1e-6, DSMAX={longest_step}, IADS=1\n{stop}"
        )
        _run(
            ["gfortran", "-O2", "-fopenmp", str(_SOURCE), *objects, "-o", "rod", "-J", folder],
            place,
        )
        before = os.times()
        _run([str(place / "rod")], place)
        after = os.times()
        seconds = after.children_user + after.children_system
        seconds -= before.children_user + before.children_system
        rows = []
        for line in (place / "fort.7").read_text().splitlines():
            words = line.split()
            if words and words[0] != "0" and len(words) > 6:
                rows.append([float(words[4]), *(float(word) for word in words[-2:])])
    table = np.array(rows)
    if len(table) < 2:
        raise RuntimeError("AUTO found no branch")
    return AutoBranch(table[:, 0], table[:, 1], table[:, 2], seconds)


def _run(command: list[str], place: Path) -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        command, cwd=place, env=environment, capture_output=True, text=True, timeout=600
    )
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]} failed: {done.stderr[-2000:]}")


def _write_rod(path: Path, rod: RodLike) -> None:
    series = np.asarray(rod.strain_series)
    lines = [f"{series.shape[0]} {series.shape[1]}"]
    lines += [f"{x:.17g}" for x in rod.breaks]
    for piece in series:
        lines += [" ".join(f"{x:.17g}" for x in piece[:, j]) for j in range(2)]
    path.write_text("\n".join(lines) + "\n")


def _write_start(path: Path, rod: RodLike, alpha: float, solution: np.ndarray) -> None:
    n = len(solution)
    lines = [f"{alpha:.17g} {rod.bend_stiffness:.17g} {rod.twist_stiffness:.17g}", str(n)]
    for i, row in enumerate(solution):
        lines.append(" ".join(f"{x:.17g}" for x in [*row, i / (n - 1)]))
    path.write_text("\n".join(lines) + "\n")
