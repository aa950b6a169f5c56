"""Recordings with an effect that nobody knows: `hiding` draws them, `sealing` keeps the answer, `trial` runs."""
