"""A match web on its way from a store to a file: what to compare with what, and what is known."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import combinations_with_replacement, product
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from mocapidx.errors import StoreError
from mocapidx.graphs.pair_paths import Section, Unit, grid_stride, section_margin, sections
from mocapidx.graphs.paths import PathRules
from mocapidx.graphs.web_bytes import path_counts
from mocapidx.printable import shown
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.store.web import WebDocument, WebFile, read_web, write_web
from mocapidx.tasks.stored import stored_poses

__all__ = ["Block", "Building", "KnownPairs", "Pair", "path_totals"]

BLOCK_FRAMES: Final = 2048
"""Frames of grids that are compared with as many others at once; a section is never split."""

Pair: TypeAlias = tuple[int, int]
KnownPairs: TypeAlias = dict[Pair, list[bytes]]
"""Of each pair of documents the paths of its grids, in the order of their frames."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Sections that are compared together.

    Parameters
    ----------
    rows, columns : list of Section
    pairs : list of tuple of int
        Which of the rows with which of the columns.
    cells : int
        Of the grids.
    completes : set of tuple of int
        Pairs of documents of which these are the last grids.
    """

    rows: list[Section]
    columns: list[Section]
    pairs: list[Pair]
    cells: int
    completes: set[Pair] = field(default_factory=set)


class Building:
    """A web on its way from a store to a file."""

    def __init__(
        self,
        snapshot: Snapshot,
        chosen: Sequence[tuple[WebDocument, Placed]],
        rules: PathRules,
        output: Path,
    ) -> None:
        self.snapshot, self.output = snapshot, output
        self.documents = tuple(known for known, _ in chosen)
        self.placed = [placed for _, placed in chosen]
        self.rate = snapshot.manifest.settings.rate
        self.stride = grid_stride(self.rate)
        self.path_rules, self.rules = rules, asdict(rules)
        self.open_pieces: dict[Pair, list[tuple[int, int, bytes]]] = {}
        self.before: WebFile | None = None

    def known_pairs(self) -> tuple[KnownPairs, bool]:
        """Take what a web that is there knows; also whether its rules are others."""
        if not os.path.lexists(self.output):
            return {}, False
        web = read_web(self.output)
        self.before = web
        if (web.rate, web.stride, dict(web.rules)) != (self.rate, self.stride, self.rules):
            return {}, True
        numbers = {known.identity: number for number, known in enumerate(self.documents)}
        place = [numbers.get(known.identity) for known in web.documents]
        pairs: KnownPairs = {}
        for row, (first, second) in enumerate(web.pieces[:, :2].tolist()):
            one, other = place[first], place[second]
            if one is not None and other is not None:
                pairs.setdefault((one, other), []).append(bytes(web.piece(row)))
        return pairs, False

    def blocks(self, missing: Sequence[Pair]) -> Iterator[Block]:
        """Group the sections of the missing pairs, so that clouds are made once for many."""
        wanted = set(missing)
        taking_part = sorted({number for pair in missing for number in pair})
        cut = {n: sections(n, -(-self.documents[n].frames // self.stride)) for n in taking_part}
        groups: list[list[Section]] = []
        for section in (section for number in taking_part for section in cut[number]):
            size = sum(other.frames for other in groups[-1]) if groups else BLOCK_FRAMES
            if size + section.frames > BLOCK_FRAMES:
                groups.append([])
            groups[-1].append(section)
        left = {(a, b): len(_grids(cut[a], cut[b])) for a, b in missing}
        for rows, columns in combinations_with_replacement(groups, 2):
            pairs = [
                (row, column)
                for row, column in product(range(len(rows)), range(len(columns)))
                if (rows[row].document, columns[column].document) in wanted
                and (rows[row].document, rows[row].start)
                <= (columns[column].document, columns[column].start)
            ]
            if not pairs:
                continue
            completes = set()
            for row, column in pairs:
                pair = rows[row].document, columns[column].document
                left[pair] -= 1
                if not left[pair]:
                    completes.add(pair)
            cells = sum(rows[row].frames * columns[column].frames for row, column in pairs)
            yield Block(rows, columns, pairs, cells, completes)

    def filled(self, block: Block) -> tuple[list[Unit], list[Unit], list[Pair]]:
        """Add the poses to a block."""
        rows = self._units(block.rows)
        columns = rows if block.columns is block.rows else self._units(block.columns)
        return rows, columns, block.pairs

    def _units(self, parts: Iterable[Section]) -> list[Unit]:
        margin = section_margin(self.rate, self.path_rules)
        units = []
        for section in parts:
            poses = stored_poses(self.snapshot, self.placed[section.document])
            made = self.placed[section.document].document.rig.get("made", ())
            start, end = section.start * self.stride, section.end * self.stride
            first = max(start - margin, 0)
            kept = poses[first : end + margin].copy()
            names = made if isinstance(made, (list, tuple)) else ()
            kept[:, [joint in names for joint in CANONICAL_JOINTS]] = np.nan
            units.append(Unit(section, kept, start - first))
        return units

    def add(self, block: Block, pieces: Sequence[bytes], kept: KnownPairs) -> None:
        """Take the paths of a block; a pair counts when it is complete."""
        for (row, column), piece in zip(block.pairs, pieces, strict=True):
            pair = block.rows[row].document, block.columns[column].document
            starts = block.rows[row].start, block.columns[column].start
            self.open_pieces.setdefault(pair, []).append((*starts, piece))
        for pair in sorted(block.completes):  # the order of blocks depends on what was known
            kept[pair] = [piece for *_, piece in sorted(self.open_pieces.pop(pair))]

    def web(self, kept: Mapping[Pair, Sequence[bytes]]) -> WebFile:
        """Lay out what is known so far."""
        pieces, parts, place = [], [], 0
        for pair in sorted(kept):
            for part in kept[pair]:
                pieces.append((*pair, place, len(part)))
                parts.append(part)
                place += len(part)
        table = np.array(pieces, dtype=np.int64).reshape(-1, 4)
        paths = memoryview(b"".join(parts))
        return WebFile(self.rate, self.stride, self.rules, self.documents, table, paths)

    def write(self, kept: Mapping[Pair, Sequence[bytes]]) -> None:
        """Write what is known so far; whole, or not at all."""
        write_web(self.output, self.web(kept))

    def differs(self, kept: Mapping[Pair, Sequence[bytes]]) -> bool:
        """Whether the file holds something else, though no pair is new."""
        if self.before is None:
            return True
        known = self.before.pieces[:, :2].tolist()
        return self.before.documents != self.documents or len(known) != sum(
            len(parts) for parts in kept.values()
        )

    def path_cells(self, kept: Mapping[Pair, Sequence[bytes]]) -> int:
        """Count the cells of all paths."""
        parts = (part for parts in kept.values() for part in parts if part)
        _, cells, _, inner = path_totals(parts, self.output)
        return cells + inner


def path_totals(parts: Iterable[bytes | memoryview], where: Path) -> tuple[int, int, int, int]:
    """Count what the paths of grids hold.

    Parameters
    ----------
    parts : iterable of bytes
    where : Path
        The web that they may come from, for messages.

    Returns
    -------
    tuple of int
        Chains, their cells, bridges, their inner cells.

    Raises
    ------
    StoreError
        If one of them is damaged.
    """
    totals = np.zeros(4, dtype=np.int64)
    try:
        for part in parts:
            totals += path_counts(part)
    except StoreError as exc:
        raise StoreError(
            f"{shown(where)}: damaged ({exc}); remove it and make it again with "
            "'mocapidx web build'"
        ) from exc
    chains, cells, bridges, inner = totals.tolist()
    return chains, cells, bridges, inner


def _grids(one: Sequence[Section], other: Sequence[Section]) -> list[tuple[Section, Section]]:
    """List the grids of two documents; of a document with itself, those not yet mirrored."""
    return [
        (a, b) for a, b in product(one, other) if (a.document, a.start) <= (b.document, b.start)
    ]
