"""Drives with an encoder on either side: what lies between motor and link."""
