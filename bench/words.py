"""Feature words of indexed clips, repeated to as many as a measurement wants."""

from pathlib import Path

import numpy as np

from mocapidx.model import WordArray
from mocapidx.store.read import open_store

__all__ = ["repeated_words"]


def repeated_words(store: Path, frames: int) -> list[WordArray]:
    """Give the words of a store's documents again and again until there are enough frames."""
    with open_store(store) as snapshot:
        documents = []
        for entry in snapshot.documents():
            end = entry.frame_offset + entry.document.frames
            words = snapshot.array(entry.file, "frames/words", entry.frame_offset, end)
            documents.append(np.array(words))
    return documents * -(-frames // sum(map(len, documents)))
