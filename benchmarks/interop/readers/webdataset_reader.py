"""Read shards with the package webdataset, and a card with mlcroissant: SHARD, CARD and output."""

import sys

import mlcroissant
import numpy as np
import webdataset

shard, card, out = sys.argv[1:]
samples = list(webdataset.WebDataset(shard, shardshuffle=False))
rows = list(mlcroissant.Dataset(card).records("items"))
np.savez(
    out,
    keys=[one["__key__"] for one in samples],
    names=sorted(samples[0]),
    db=[float(row["items/expected_db"]) for row in rows],
)
