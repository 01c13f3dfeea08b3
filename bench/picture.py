"""The table as a picture: how many times faster than peers, and growth with the work."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from bench.table import Row

__all__ = ["draw"]

LONGEST = 46  # letters of a label


def draw(sections: Mapping[str, Sequence[Row]], path: Path) -> None:
    """Draw the rows of all sections.

    Parameters
    ----------
    sections : mapping of str to sequence of Row
    path : Path
        A PNG file.
    """
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    rows = [row for own in sections.values() for row in own]
    peers = [row for row in rows if row.faster is not None]
    figure, (bars, lines) = plt.subplots(
        1, 2, figsize=(14, 0.24 * len(peers) + 3), layout="constrained"
    )
    places = range(len(peers))[::-1]
    bars.barh(places, [row.faster for row in peers], color="#4c72b0")
    bars.set_yticks(places, [f"{short(row.what)}, {short(row.peer, 24)}" for row in peers])
    bars.tick_params(axis="y", labelsize=7)
    bars.axvline(1, color="black", linewidth=0.8)
    bars.set(xscale="log", xlabel="times faster than the peer", title="Against others")

    for name, own in sections.items():
        first = next((row for row in own if row.growth is not None), None)
        if first is not None and first.growth is not None:
            growth = first.growth
            ratios = [each / growth.seconds[0] for each in growth.seconds]
            label = f"{name}: {short(first.what)} ({growth.slope:.2f})"
            lines.plot(growth.times, ratios, marker="o", markersize=4, label=label)
    most = max(widest(rows), default=1)
    lines.plot([1, most], [1, most], color="grey", linestyle=":", label="as much longer as larger")
    lines.set(
        xscale="log",
        yscale="log",
        xlabel="times the work",
        ylabel="times as long",
        title="Growth, the first of each section (slope)",
    )
    figure.legend(fontsize=7, loc="outside lower right")
    figure.savefig(path, dpi=120)
    plt.close(figure)


def widest(rows: Iterable[Row]) -> Iterable[int]:
    """Give how far each growth was measured."""
    return (row.growth.times[-1] for row in rows if row.growth is not None)


def short(text: str, letters: int = LONGEST) -> str:
    """Cut a text that is too long for a picture."""
    return text if len(text) <= letters else f"{text[: letters - 1]}…"
