"""The one error a user can mend, and the one warning.

Everything a user can put right (a missing file, a marker that is not in the layout, a neutral time outside the
take) is raised as `SignfaceError`. The command line prints its message as one line and exits with status 2.
"""

from __future__ import annotations

from os import PathLike


def counted(number: int, noun: str) -> str:
    """`1 take`, `2 takes`.

    Examples
    --------
    >>> counted(1, "take"), counted(2, "take")
    ('1 take', '2 takes')
    """
    return f"{number} {noun}" + ("" if number == 1 else "s")


class SignfaceError(Exception):
    """Something the user can mend: what file, what is wrong, what to do.

    Parameters
    ----------
    problem : str
        What is wrong, as a short clause without a final full stop.
    file : path, optional
        The file concerned; it opens the message.
    hint : str, optional
        What to do about it; it closes the message.

    Examples
    --------
    >>> import signface as sf
    >>> try:
    ...     sf.read_take("absent.c3d")
    ... except sf.SignfaceError as error:
    ...     print(error)
    absent.c3d: no such file
    """

    def __init__(self, problem: str, *, file: str | PathLike[str] | None = None, hint: str | None = None) -> None:
        self.problem = problem
        self.file = None if file is None else str(file)
        self.hint = hint
        message = problem if self.file is None else f"{self.file}: {problem}"
        if hint:
            message = f"{message}. {hint[0].upper()}{hint[1:]}"
        super().__init__(" ".join(message.split()))

    def at(self, file: str | PathLike[str]) -> SignfaceError:
        """The same error, naming this file where it names none.

        Examples
        --------
        >>> import signface as sf
        >>> print(sf.SignfaceError("is empty", hint="export it again").at("take.csv"))
        take.csv: is empty. Export it again
        """
        return self if self.file is not None else type(self)(self.problem, file=file, hint=self.hint)


class SignfaceWarning(UserWarning):
    """Something a user should know of a result that was given all the same; the command line prints it as one line.

    Examples
    --------
    >>> import warnings
    >>> import signface as sf
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     warnings.warn("two head markers were seen in one frame only", sf.SignfaceWarning)
    >>> print(caught[0].message)
    two head markers were seen in one frame only
    """
