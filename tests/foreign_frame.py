"""A frame as libraries other than pandas have it, such as Polars: columns by name, a shape, and no index."""

from __future__ import annotations

import numpy as np


class ForeignFrame:
    def __init__(self, columns):
        self._of = {name: np.asarray(values) for name, values in columns.items()}
        self.columns = list(self._of)
        self.shape = (len(next(iter(self._of.values()))), len(self._of))

    def __getitem__(self, name):
        return self._of[name]

    def __len__(self):
        return self.shape[0]

    def __array__(self, dtype=None, copy=None):
        return np.column_stack(list(self._of.values())).astype(dtype or float)
