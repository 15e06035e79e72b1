"""What a user should know of a recording that is read all the same.

- `doubt`: said once on standard error, and kept in the take's history.
"""

from __future__ import annotations

import warnings
from pathlib import Path

from signface.errors import SignfaceWarning


def doubt(file: Path, text: str) -> str:
    """Warn that something of a file is doubtful, and give the text back for the take's history.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     note = doubt(Path("smile.trc"), "has 6 frames; NumFrames says 1200")
    >>> print(caught[0].message)
    smile.trc: has 6 frames; NumFrames says 1200
    """
    warnings.warn(f"{file}: {text}", SignfaceWarning, stacklevel=3)
    return text
