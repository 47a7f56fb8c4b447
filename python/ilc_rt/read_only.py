"""A library that is only read: for reports, dashboards and everything that watches."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from ilc_rt.library import IN_MEMORY, Library

if TYPE_CHECKING:
    from typing_extensions import Self


class ReadOnlyLibrary(Library):
    """An existing library that is only read.

    Parameters
    ----------
    path : str or os.PathLike
        Path of the file. It is neither created nor changed, nor is anything beside it.

    Raises
    ------
    OSError
        If the file is missing, empty, or not a library; on every method that would write.

    Examples
    --------
    >>> from ilc_rt import ReadOnlyLibrary
    >>> ReadOnlyLibrary("missing.db")
    Traceback (most recent call last):
      ...
    FileNotFoundError: missing.db: no such library
    """

    def __new__(cls, path: str | PathLike[str]) -> Self:
        name = fspath(path)
        place = Path(name)
        if name == IN_MEMORY or not place.exists():
            message = f"{name}: no such library"
            raise FileNotFoundError(message)
        if place.is_file() and place.stat().st_size == 0:
            message = f"{name}: an empty file, and no library yet"
            raise OSError(message)
        return super().__new__(cls, path)

    def append(self, *_: Any, **__: Any) -> NoReturn:  # noqa: ANN401 (of any call)
        """Refuse to store a run."""
        self._refuse()

    def trim(self, *_: Any, **__: Any) -> NoReturn:  # noqa: ANN401 (of any call)
        """Refuse to delete runs."""
        self._refuse()

    def retain(self, *_: Any, **__: Any) -> NoReturn:  # noqa: ANN401 (of any call)
        """Refuse to delete runs."""
        self._refuse()

    def _refuse(self) -> NoReturn:
        message = f"{self.path}: opened to be read only; Library(path) can write"
        raise PermissionError(message)
