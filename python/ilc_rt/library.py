"""The library of all runs, in one SQLite file."""

from __future__ import annotations

import math
from importlib import import_module
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from ilc_rt import _native
from ilc_rt.closing import Closing
from ilc_rt.errors import BadInputError
from ilc_rt.given import given
from ilc_rt.retention import DESCRIPTIONS, kept_by, selected, with_descriptions

if TYPE_CHECKING:
    import builtins
    from collections.abc import Callable, Iterator

    Progress = Callable[[int, int], object]

    from numpy.typing import ArrayLike
    from typing_extensions import Self

IN_MEMORY = ":memory:"
#: More runs than any library has.
ALL = 2**31
#: Runs that are deleted in one transaction: some tenths of a second.
DELETED_AT_ONCE = 10_000
#: Runs that are deleted in one transaction where few are left: about a second.
DELETED_TOGETHER = 200_000


class Library(Closing, _native.Library):
    """Every run of every campaign, in one SQLite file.

    Parameters
    ----------
    path : str or os.PathLike
        Path of the file, created if missing. ``:memory:`` is an in-memory library. The path is
        never interpreted as an address.

    Raises
    ------
    OSError
        If the file cannot be opened or is not a library; it is left unchanged.

    Notes
    -----
    Reading opens the file read-only and closes it at once: a library without write permission can
    be read, and no side files are created.

    Examples
    --------
    >>> from ilc_rt import Library
    >>> with Library(":memory:") as library:
    ...     len(library), library.select(law="norm_optimal", tracking_rms_m=(0.0, 1e-5))
    (0, [])
    """

    _path: str

    def __new__(cls, path: str | PathLike[str]) -> Self:
        library = super().__new__(cls, {"path": fspath(path)})
        library._path = fspath(path)
        return library

    @property
    def path(self) -> str:
        """Path of the file, or ``:memory:``."""
        return self._path

    def close(self) -> None:
        """Leave the file as it is: every call has written what it stored."""

    def __len__(self) -> int:
        """Return the number of stored runs."""
        return self._count()

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the stored runs, oldest first, as `list` gives them."""
        return iter(self.list())

    def list(self, cell: str | None = None) -> list[dict[str, Any]]:
        """Return the stored runs, oldest first, without their arrays.

        Parameters
        ----------
        cell : str or None
            Only runs of the cell of this name.

        Returns
        -------
        list of dict
            Provenance and figures of each run; lengths in metres, angles in radians. A
            figure over several axes is over the linear ones, or over all of a cell
            whose axes are all rotary; contour errors are None where the path has none.

        Raises
        ------
        OSError
            If the file cannot be read.
        """
        return self._page({"cell": cell, "offset": 0})

    def page(
        self,
        cell: str | None = None,
        campaign: str | None = None,
        limit: int | None = None,
        offset: int = 0,
    ) -> builtins.list[dict[str, Any]]:
        """Return a part of the stored runs, oldest first, without their arrays.

        Only this part of the file is read.

        Parameters
        ----------
        cell : str or None
            Only runs of the cell of this name.
        campaign : str or None
            Only runs of campaigns whose names begin like this.
        limit : int or None
            Largest number of runs; None: all.
        offset : int
            Number of runs to leave out before.

        Returns
        -------
        list of dict
            As `list` gives them.

        Raises
        ------
        BadInputError
            If limit or offset is negative.
        OSError
            If the file cannot be read.
        """
        for key, value in (("limit", limit), ("offset", offset)):
            if value is not None and value < 0:
                message = f"{key} = {value}: a number of runs, 0 or more"
                raise BadInputError(message)
        return self._page(given(locals()))

    def select(self, **wanted: Any) -> builtins.list[dict[str, Any]]:  # noqa: ANN401 (values of any key)
        """Return the runs whose entries have wanted values, oldest first.

        Parameters
        ----------
        **wanted
            By keys of `list`, and by ``program`` and ``law_parameters`` of `load`, as JSON text or
            as what it means; these two are read with the arrays of the runs that the other keys
            leave. A pair of numbers, or of texts, is a range with both ends, either
            of which may be None; any other value is compared. Dates are compared as texts, so
            ``created_utc=("2026-11", None)`` has all runs from November 2026 on. A vector of
            disturbances is in a range if each of its elements is.

        Returns
        -------
        list of dict
            As `list` gives them. A run without a value is never in a range.

        Raises
        ------
        BadInputError
            If a run has no such key; the message names those that it has.
        OSError
            If the file cannot be read.

        Examples
        --------
        >>> from ilc_rt import Library
        >>> library = Library(":memory:")
        >>> library.select(cell="gantry", disturbance=(20.0, 25.0), created_utc=("2026-11", None))
        []
        """
        described = {key: wanted.pop(key) for key in DESCRIPTIONS if key in wanted}
        return with_descriptions(selected(self.list(), wanted), described, self._rows)

    def to_dataframe(self, **wanted: Any) -> Any:  # noqa: ANN401 (pandas is optional)
        """Return the runs as a table of pandas, one row per run; `wanted` as for `select`.

        Returns
        -------
        pandas.DataFrame
            The keys of `list` as columns, with ``id`` as index.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        table = import_module("pandas").DataFrame(self.select(**wanted))
        return table.set_index("id") if len(table) else table

    def to_parquet(self, path: str | PathLike[str], **wanted: Any) -> None:  # noqa: ANN401
        """Write the runs, without their arrays, to a Parquet file.

        Parameters
        ----------
        path : str or os.PathLike
            The file.
        **wanted
            As for `select`.

        Raises
        ------
        ImportError
            If pyarrow is not installed.
        OSError
            If the file cannot be written.
        """
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
        parquet.write_table(arrow.Table.from_pylist(self.select(**wanted)), fspath(path))

    def load(self, id: int) -> dict[str, Any]:
        """Return a run with its arrays.

        Parameters
        ----------
        id : int
            Key of the run, as `list` gives it.

        Returns
        -------
        dict
            The keys of `list`, and ``law_parameters`` and ``program`` (JSON), ``reference_m``,
            ``input``, ``encoder_m``, ``tool_m`` (or None), ``error_m`` of shape (n_samples,
            n_axes), ``contour_m`` of shape (n_samples,) (None: the path has no contour),
            ``disturbance`` of shape (n_disturbances,) (None: none is measured).

        Raises
        ------
        OSError
            If there is no such run, or its arrays do not match their digest.
        """
        return super().load(id)

    def recall(
        self,
        disturbance: ArrayLike,
        top: int = 30,
        cell: str | None = None,
        *,
        error: float = 0.0,
    ) -> builtins.list[dict[str, Any]]:
        """Return the runs made under a similar disturbance, nearest first.

        With `error` the most relevant first, as the law `relevance` weighs them: by
        ``1 / (error rms^2 + |d - d_j|^2)`` ([dimarco2016], Eq. (4.12), without the error's rate).

        Parameters
        ----------
        disturbance : float or array_like of float64, shape (n_disturbances,)
            The disturbance.
        top : int
            Largest number of runs.
        cell : str or None
            Only runs of the cell of this name.
        error : float
            Weight of the square of a run's RMS error in m, against the square of the distance;
            that of the law is ``error / disturbance`` of its weights. 0: only the distance counts.

        Returns
        -------
        list of dict
            The keys of `list`, and ``distance``, in the unit of the disturbance. Ties: the older
            run first.

        Raises
        ------
        BadInputError
            If the weight is negative or not finite.
        ValueError, TypeError
            If the disturbance is not a number, or not finite.
        OSError
            If the file cannot be read.
        """
        if not (math.isfinite(error) and error >= 0.0):
            message = f"error = {error}: a weight of 0 or more"
            raise BadInputError(message)
        if error == 0.0:
            return super().recall(disturbance, top, cell)
        # All of them first: a good run may be far away.
        near = super().recall(disturbance, ALL, cell)
        near.sort(key=lambda run: error * run["tracking_rms_m"] ** 2 + run["distance"] ** 2)
        return near[:top]

    def append(
        self,
        u: ArrayLike,
        e: ArrayLike,
        cycle_s: float,
        disturbance: ArrayLike | None = None,
        reference_m: ArrayLike | None = None,
        *,
        cell: str = "elsewhere",
        campaign: str = "elsewhere",
        law: str = "elsewhere",
    ) -> int:
        """Store a run that was made elsewhere.

        Parameters
        ----------
        u : ndarray of float64, shape (n_samples,) or (n_samples, n_axes)
            Its learned input, in m, m/s or N.
        e : ndarray of float64, same shape as `u`
            Its error in m, reference minus measurement.
        cycle_s : float
            Its sample time in s.
        disturbance : float, array_like of float64 or None
            The disturbance it was made under, shape (n_disturbances,).
        reference_m : ndarray of float64 or None
            Its set points in m, same shape as `u`; None: zero, so that the path is a single point.
            The contour error is the distance to the path near the same time.
        cell, campaign, law : str
            Names; the run number continues that of the campaign.

        Returns
        -------
        int
            Key of the run.

        Raises
        ------
        ValueError, TypeError
            If an array has the wrong shape, dtype or a number that is not finite,
            cycle_s is not above 0, or a name is empty or has control characters.
        OSError
            If the file cannot be written.

        Examples
        --------
        >>> import numpy as np
        >>> from ilc_rt import Library
        >>> library = Library(":memory:")
        >>> library.append(np.zeros(3), np.ones(3), cycle_s=0.01, disturbance=21.5)
        1
        >>> library.recall(20.0)[0]["distance"]
        1.5
        """
        return super()._append(given(locals()))

    def trim(self, keep: int, cell: str | None = None, *, progress: Progress | None = None) -> int:
        """Delete all but the most relevant runs, and return how many were deleted.

        Parameters
        ----------
        keep : int
            Number of runs to keep.
        cell : str or None
            Only among runs of the cell of this name.
        progress : callable or None
            As of `retain`.

        Returns
        -------
        int
            Number of deleted runs.

        Raises
        ------
        OSError
            As of `retain`; if runs have different numbers of disturbances, nothing is deleted.

        Notes
        -----
        The relevance of DPW-ILC, with RMS error and disturbance scaled by their spread over these
        runs and summed over all their disturbances; without disturbances the smallest errors stay.
        """
        return self._delete(self._least_relevant(keep, cell), progress)

    def retain(
        self,
        *,
        newest: int | None = None,
        days: float | None = None,
        best: int | None = None,
        cell: str | None = None,
        progress: Progress | None = None,
    ) -> int:
        """Delete all runs that no rule keeps, and return how many were deleted.

        The newest run of each campaign always stays: the next number follows from it.

        Parameters
        ----------
        newest : int or None
            Keep this number of newest runs.
        days : float or None
            Keep the runs of the last days.
        best : int or None
            Keep of each campaign this number of runs with the smallest RMS errors; runs that
            only measure and rolled back ones are not among them.
        cell : str or None
            Only among runs of the cell of this name.
        progress : callable or None
            Called with the number of deleted runs, and of all that are to be deleted.

        Returns
        -------
        int
            Number of deleted runs.

        Raises
        ------
        BadInputError
            If there is no rule, or one is negative or not finite.
        OSError
            If the file cannot be written. If only its size cannot be changed, the message says
            that the runs are deleted.

        Notes
        -----
        Oldest first, a thousand in one transaction: a campaign that stores a run meanwhile does not
        wait for all of them. Then the file shrinks. After an interruption the rest stays, and the
        same call goes on.
        """
        runs = self.list(cell)
        kept = kept_by(runs, newest=newest, days=days, best=best)
        return self._delete([run["id"] for run in runs if run["id"] not in kept], progress)

    def _delete(self, gone: builtins.list[int], progress: Progress | None) -> int:
        n_left = len(self) - len(gone) if gone else 0
        first = 0
        while first < len(gone):
            if progress is not None:
                progress(first, len(gone))
            rest = len(gone) - first
            # A few that are left are copied: all others go faster together than one by one.
            is_most = 4 * n_left < rest <= DELETED_TOGETHER
            count = rest if is_most else DELETED_AT_ONCE
            self._remove(gone[first : first + count])
            first += count
        if gone:
            self._shrink(len(gone))
        return len(gone)

    def export(self, id: int, path: str | PathLike[str]) -> None:
        """Write a run to a file: ``.npz``, ``.csv`` or ``.json``, by its extension.

        Parameters
        ----------
        id : int
            Key of the run, as `list` gives it.
        path : str or os.PathLike
            The file.

        Raises
        ------
        BadInputError
            If the extension is unknown or the file cannot be written.
        OSError
            If there is no such run, or its arrays do not match their digest.
        """
        # Imported late: `export` imports records, and records import libraries.
        import_module("ilc_rt.export").export_run(self.load(id), path)
