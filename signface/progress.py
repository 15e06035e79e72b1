"""Progress of long work: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sized
from typing import TypeVar

Item = TypeVar("Item")


def progress(items: Iterable[Item], what: str, *, total: int | None = None) -> Iterator[Item]:
    """Go through `items`, showing on standard error how far we are.

    Parameters
    ----------
    items : iterable
    what : str
        What is being done ("solving").
    total : int, optional
        How many there are, where `items` does not know its length.
    """
    count = total if total is not None else len(items) if isinstance(items, Sized) else None
    if sys.stderr.isatty():
        from tqdm import tqdm

        yield from tqdm(items, desc=what, total=count, leave=False)
        return
    step = max(1, (count or 0) // 10)
    for number, item in enumerate(items, start=1):
        yield item
        if count is not None and count > 1 and (number % step == 0 or number == count):
            print(f"{what}: {number} of {count}", file=sys.stderr, flush=True)
