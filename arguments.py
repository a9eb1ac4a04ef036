"""Kinds of values that several commands take."""

import argparse
from collections.abc import Sequence
from typing import Any


def positive(text: str) -> int:
    """A whole number from 1; raises what argparse makes a line of."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value}; allowed is a whole number from 1")
    return value


class Once(argparse.Action):
    """An option that may be given once: a second one is refused, where argparse would drop the first silently."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        """Keep the value."""
        before = getattr(namespace, self.dest, None)
        if before is not None:
            parser.error(f"argument {option_string}: given twice, {before} and {values}; give one")
        setattr(namespace, self.dest, values)
