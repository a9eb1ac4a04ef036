"""Kinds of values that several commands take."""

import argparse


def positive(text: str) -> int:
    """A whole number from 1; raises what argparse makes a line of."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value}; allowed is a whole number from 1")
    return value
