"""Samples as NumPy arrays, and what can be made of them."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import numpy.typing as npt

Samples = npt.NDArray[np.void]


def to_pandas(samples: Samples) -> Any:
    """A ``pandas.DataFrame`` of what ``bus.sample`` gave, with the time in s as its index.

    Raises ``ImportError`` where pandas is not installed: ``pip install motorlink[pandas]``.
    """
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError("pandas is not installed: `pip install pandas`") from error
    return pandas.DataFrame({name: samples[name] for name in samples.dtype.names or ()}).set_index("t")
