"""Kinds of recordings that answer to the values of effects, and the one decision for all of them."""
