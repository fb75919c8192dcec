"""Who computes the pieces of a scan: this process, local processes, or a Dask cluster."""

from __future__ import annotations

import logging
import multiprocessing
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from dnacheck import __version__
from dnacheck.numerics.outcome import InputError, SolveError
from dnacheck.scanning.pieces import Piece, Result, Settings, compute

_AHEAD = 2
"""Pieces handed out per worker before their results are waited for."""
_MOST_DEATHS = 10
"""Times that a pool may lose a worker before the scan gives up."""
_CONNECT_SECONDS = 10
_EXTRA = "install dnacheck[cluster]"


class Crew(Protocol):
    """Workers that compute pieces in any order."""

    def run(self, settings: Settings, pieces: Iterable[Piece]) -> Iterator[Result]:
        """Results as they come."""
        ...


class Alone:
    """This process."""

    def run(self, settings: Settings, pieces: Iterable[Piece]) -> Iterator[Result]:
        """Results in order."""
        for piece in pieces:
            yield compute(settings, piece)


@dataclass(frozen=True)
class Processes:
    """Processes of this machine; one that dies is replaced and its pieces are done again."""

    workers: int

    def run(self, settings: Settings, pieces: Iterable[Piece]) -> Iterator[Result]:
        """Results as they come."""
        waiting = iter(pieces)
        again: list[Piece] = []
        for _ in range(_MOST_DEATHS):
            context = multiprocessing.get_context("spawn")
            with ProcessPoolExecutor(self.workers, mp_context=context) as pool:
                try:
                    yield from _spread(pool, self.workers, settings, waiting, again)
                    return
                except BrokenProcessPool:
                    continue
                finally:
                    pool.shutdown(wait=False, cancel_futures=True)
        raise SolveError(
            f"workers died {_MOST_DEATHS} times; the pieces done so far are kept: give fewer "
            "workers, or more memory, and run the same command again"
        )


class Cluster:
    """Workers of a Dask cluster."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def run(self, settings: Settings, pieces: Iterable[Piece]) -> Iterator[Result]:
        """Results as they come; Dask does the pieces of a dead worker again."""
        shared = self.client.scatter([settings], broadcast=True, hash=False)[0]
        pool = self.client.get_executor(pure=False, retries=3)
        threads = sum(self.client.nthreads().values()) or 1
        yield from _spread(pool, threads, shared, iter(pieces), [])


def _spread(
    pool: Executor, workers: int, settings: Any, waiting: Iterator[Piece], again: list[Piece]
) -> Iterator[Result]:
    """Hand out pieces, a few ahead, and yield results; what broke off is left in ``again``."""
    pending: dict[Future[Result], Piece] = {}
    try:
        while True:
            while len(pending) < _AHEAD * workers:
                piece = again.pop() if again else next(waiting, None)
                if piece is None:
                    break
                try:
                    pending[pool.submit(compute, settings, piece)] = piece
                except BrokenProcessPool:
                    again.append(piece)
                    raise
            if not pending:
                return
            done, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=lambda done_one: pending[done_one].number):
                result = future.result()
                del pending[future]
                yield result
    except BrokenProcessPool:
        again.extend(pending.values())
        pending.clear()
        raise
    finally:
        for future in pending:
            future.cancel()


@contextmanager
def crew(processes: int, workers: int | None, scheduler: str | None) -> Iterator[Crew]:
    """Workers for a scan.

    Parameters
    ----------
    processes : int
        Of this machine, where neither of the others is given; 1 computes in this one.
    workers : int, optional
        Start a local Dask cluster of so many; plain processes where that extra is not installed.
    scheduler : str, optional
        Address of a running Dask scheduler, such as ``tcp://10.0.0.1:8786``; its workers are used
        and nothing else is.

    Raises
    ------
    InputError
        No scheduler answers there, or its workers have other versions.
    """
    if scheduler is None and workers is None:
        yield Alone() if processes == 1 else Processes(processes)
        return
    try:
        import distributed
    except ImportError:
        if scheduler is not None:
            raise InputError(f"--scheduler needs Dask; {_EXTRA}") from None
        yield Processes(workers or processes)
        return
    logging.getLogger("distributed").setLevel(logging.ERROR)
    if scheduler is None:
        with (
            distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=logging.ERROR,
            ) as local,
            distributed.Client(local) as client,
        ):
            yield Cluster(client)
        return
    with _connected(distributed, scheduler) as client:
        _same_versions(client)
        yield Cluster(client)


def _connected(distributed: Any, scheduler: str) -> AbstractContextManager[Any]:
    try:
        client: AbstractContextManager[Any] = distributed.Client(
            scheduler, timeout=_CONNECT_SECONDS
        )
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--scheduler {scheduler}: no Dask scheduler answers there ({type(error).__name__}); "
            "start one with 'dask scheduler' and give the address that it prints"
        ) from None
    return client


def _version() -> str:
    return __version__


def _same_versions(client: Any) -> None:
    if not client.nthreads():
        client.wait_for_workers(1, timeout=_CONNECT_SECONDS)
    try:
        found = set(client.run(_version).values())
    except Exception as error:  # whatever a foreign worker raises at the import
        raise InputError(
            f"--scheduler: a worker cannot load dnacheck ({type(error).__name__}); install "
            f"dnacheck {__version__} there"
        ) from None
    if found != {__version__}:
        raise InputError(
            f"--scheduler: workers have dnacheck {', '.join(sorted(found))}, this is "
            f"{__version__}; install the same version"
        )
    try:
        client.get_versions(check=True)
    except ValueError as error:
        line = " ".join(str(error).split())[:200]
        raise InputError(f"--scheduler: client and workers differ ({line})") from None
