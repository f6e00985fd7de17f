"""Where the progress of a long computation is reported."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Callable, Optional, Union

#: ``True`` shows a tqdm bar where tqdm is installed, else lines on standard error; a function is called with
#: what is being done, in a few words.
Progress = Union[bool, Callable[[str], object]]


@contextmanager
def listener(progress: Progress) -> Iterator[Optional[Callable[[str], object]]]:
    """The function that the progress is reported to."""
    if not progress:
        yield None
    elif callable(progress):
        yield progress
    else:
        try:
            from tqdm.auto import tqdm  # type: ignore[import-untyped, unused-ignore]
        except ImportError:
            yield lambda what: print(f"  {what} …", file=sys.stderr)
            return
        with tqdm(bar_format="{desc} [{elapsed}]", leave=False) as bar:

            def tell(what: str) -> None:
                bar.set_description_str(what)
                bar.update()

            yield tell
