"""The library of all runs, in one SQLite file."""

from __future__ import annotations

from importlib import import_module
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

from ilc_rt import _native
from ilc_rt.errors import BadInputError
from ilc_rt.given import given

if TYPE_CHECKING:
    import builtins
    from collections.abc import Iterator
    from types import TracebackType

    from numpy.typing import ArrayLike
    from typing_extensions import Self


class Library(_native.Library):
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

    def __new__(cls, path: str | PathLike[str]) -> Self:
        return super().__new__(cls, path=fspath(path))

    def __enter__(self) -> Self:
        """Return itself; a library holds no file open between calls."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the file as it is: every call has written what it stored."""

    def __len__(self) -> int:
        """Return the number of stored runs."""
        return len(self.list())

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
        return super().list(cell)

    def select(self, **wanted: Any) -> builtins.list[dict[str, Any]]:  # noqa: ANN401 (values of any key)
        """Return the runs whose entries have wanted values, oldest first.

        Parameters
        ----------
        **wanted
            By keys of `list`. A pair of numbers, or of texts, is a range with both ends, either
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
        runs = self.list()
        unknown = [key for key in wanted if runs and key not in runs[0]]
        if unknown:
            message = f"{unknown[0]}: a run has {', '.join(runs[0])}"
            raise BadInputError(message)
        return [run for run in runs if all(_is(run[key], value) for key, value in wanted.items())]

    def to_dataframe(self, **wanted: Any) -> Any:  # noqa: ANN401 (pandas is optional)
        """Return the runs as a table of pandas, one row per run.

        Parameters
        ----------
        **wanted
            As for `select`.

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
        self, disturbance: ArrayLike, top: int = 30, cell: str | None = None
    ) -> builtins.list[dict[str, Any]]:
        """Return the runs made under a similar disturbance, nearest first.

        Parameters
        ----------
        disturbance : float or array_like of float64, shape (n_disturbances,)
            The disturbance.
        top : int
            Largest number of runs.
        cell : str or None
            Only runs of the cell of this name.

        Returns
        -------
        list of dict
            The keys of `list`, and ``distance``, in the unit of the disturbance. Ties: the older
            run first.

        Raises
        ------
        ValueError, TypeError
            If the disturbance is not a number, or not finite.
        OSError
            If the file cannot be read.
        """
        return super().recall(disturbance, top, cell)

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
        return super()._append(**given(locals()))

    def trim(self, keep: int, cell: str | None = None) -> int:
        """Delete all but the most relevant runs, and return how many were deleted.

        Parameters
        ----------
        keep : int
            Number of runs to keep.
        cell : str or None
            Only among runs of the cell of this name.

        Returns
        -------
        int
            Number of deleted runs.

        Raises
        ------
        OSError
            If the file cannot be written or shrunk, or the runs have different numbers of
            disturbances (then nothing is deleted).

        Notes
        -----
        The relevance of DPW-ILC, with RMS error and disturbance scaled by their spread over these
        runs and summed over all their disturbances; without disturbances the runs with the smallest
        errors are kept. The file shrinks.
        """
        return super().trim(keep, cell)

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


def _is(value: Any, wanted: Any) -> bool:  # noqa: ANN401 (any value of a run)
    """Return whether a value is the wanted one, or within the wanted range."""
    import numpy as np  # only here: the program `ilc` starts without it

    if not isinstance(wanted, tuple) or len(wanted) != 2:
        return np.array_equal(value, wanted)
    if value is None:
        return False
    low, high = wanted
    values = np.ravel(value).tolist()
    return all((low is None or one >= low) and (high is None or one <= high) for one in values)
