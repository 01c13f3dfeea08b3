"""Template files: the motion templates of several classes in one HDF5 file with a sealed end.

Behind the HDF5 image, where HDF5 itself does not look, stand a table of the datasets, a digest
of all before it and a magic number. Our reader starts there: it checks the digest first, takes
the datasets straight from their places, and never lets HDF5 see a byte. The layout is::

    HDF5 image | table (JSON) | size of the table, 8 bytes | BLAKE2b, 32 bytes | magic, 16 bytes
"""

import contextlib
import io
import json
import math
import os
import struct
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.durable import durable_replace
from mocapidx.errors import ParameterError, StoreError
from mocapidx.model import FloatArray
from mocapidx.store.manifest import file_digest
from mocapidx.store.regular import open_regular, read_exactly

__all__ = ["TEMPLATES_LIMIT", "StoredTemplates", "read_templates", "write_templates"]

FORMAT: Final = "mocapidx-templates"
FORMAT_VERSION: Final = 1
READABLE_VERSIONS: Final = frozenset({1})
TEMPLATES_LIMIT: Final = 256 << 20  # bytes
MAGIC: Final = b"mocapidx-mt-seal"
SEAL: Final = struct.Struct("<Q32s16s")
MOST_FEATURES: Final = 64
