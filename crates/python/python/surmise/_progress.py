"""How far work is, for who waits for it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Optional, Union

Progress = Union[bool, None, "Callable[[str, int, int], object]"]


class _Line:
    """One line of standard error that is written over and over."""

    def __init__(self) -> None:
        self._width = 0

    def __call__(self, stage: str, done: int, limit: int) -> None:
        text = f"{stage}: {done} of at most {limit} simulated episodes" if limit else stage
        sys.stderr.write("\r" + text.ljust(self._width))
        sys.stderr.flush()
        self._width = len(text)

    def end(self) -> None:
        if self._width:
            sys.stderr.write("\r" + " " * self._width + "\r")
            sys.stderr.flush()


def teller(progress: Progress) -> tuple[Optional[Callable[[str, int, int], object]], Callable[[], None]]:
    """Who is told, and what to do at the end. ``None``: a line where standard error is a terminal."""
    if progress is None:
        progress = sys.stderr is not None and sys.stderr.isatty()
    if progress is True:
        line = _Line()
        return line, line.end
    return (progress or None), lambda: None
