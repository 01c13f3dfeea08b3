"""A page as one HTML file: style, programs, data and still pictures, and nothing from outside."""

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Final

from mocapidx.printable import count, shown
from mocapidx.reports.page.content import PageContent, PageDocument, PageHit
from mocapidx.reports.page.encode import encode_content
from mocapidx.reports.page.stills import still_picture
from mocapidx.reports.style import class_colours

__all__ = ["page_html"]

PROGRAMS: Final = (
    *("data.js", "looks.js", "figure.js", "charts.js", "cards.js", "stage.js", "keys.js"),
    "page.js",
)
"""Read as one, in this order."""

PLACE: Final = re.compile(r"\{\{(\w+)\}\}")


def page_html(content: PageContent) -> str:
    """Write the page of a report.

    Parameters
    ----------
    content : PageContent

    Returns
    -------
    str
        HTML. Equal contents give equal pages. Nothing is fetched, and the page itself forbids
        to: its policy names the digests of its style and its programs, and nothing else runs.
    """
    colours = class_colours(
        [hit.label for hit in content.hits]
        + [curve.label for document in content.documents for curve in document.curves]
    )
    style = _static("page.css")
    library, program = _static("three.min.js"), "\n".join(map(_static, PROGRAMS))
    parts = {
        "policy": _policy([library, program], [style]),
        "title": _text(content.title),
        "summary": _text(_summary(content)),
        "remarks": "".join(f"<p>{_text(remark)}</p>" for remark in content.remarks),
        "cards": _cards(content, colours),
        "nothing": "" if content.hits else '<p class="nothing">There are no hits.</p>',
        "data": encode_content(content, colours),
        "style": style,
        "library": library,
        "program": program,
    }
    template = _static("page.html")
    size = len(template) + sum(map(len, parts.values()))
    return _fill(template, parts | {"size": f"{size / 1e6:.1f} MB"})


def _static(name: str) -> str:
    return files("mocapidx.reports.page").joinpath("static", name).read_text("utf-8")


def _fill(template: str, parts: Mapping[str, str]) -> str:
    # In one pass: what looks like a place within a part is left alone.
    return PLACE.sub(lambda place: parts[place[1]], template)


def _policy(programs: Sequence[str], styles: Sequence[str]) -> str:
    scripts, sheets = (" ".join(map(_digest, texts)) for texts in (programs, styles))
    return (
        f"default-src 'none'; script-src {scripts}; style-src {sheets}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _digest(text: str) -> str:
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _text(text: str, longest: int | None = None) -> str:
    """Make a name text wherever it stands, in an attribute too."""
    return escape(shown(text, longest))


def _summary(content: PageContent) -> str:
    hits = content.hits
    ranked = any(hit.rank is not None for hit in hits)
    noun = "hit" if ranked or not hits else "annotation"
    labels = {hit.label for hit in hits}
    seconds = sum(hit.end - hit.start for hit in hits) / content.rate
    parts = [
        count(len(hits), noun),
        count(len(labels), "class", "classes"),
        count(len(content.documents), "document"),
        f"{seconds:.0f} s of motion",
    ]
    return " · ".join(parts)


def _cards(content: PageContent, colours: Mapping[str, str]) -> str:
    # The name of the only class would be the same on every card, and an example's is a long one.
    alone = len({hit.label for hit in content.hits}) == 1
    return "\n".join(
        _card(number, hit, content, "" if alone else colours[hit.label])
        for number, hit in enumerate(content.hits)
    )


def _card(number: int, hit: PageHit, content: PageContent, colour: str) -> str:
    """Lay out a card; without a colour the class goes without saying."""
    document = content.documents[hit.document]
    start, end = hit.start / content.rate, hit.end / content.rate
    rank = "" if hit.rank is None else f'<span class="rank">{hit.rank}</span> '
    name = _text(document.name)
    times = f"{start:.2f} – {end:.2f} s"
    swatch = (
        f'<svg class="swatch" viewBox="0 0 8 8" aria-hidden="true">'
        f'<rect width="8" height="8" rx="2" fill="{colour}"/></svg>'
    )
    parts = (
        f'<li class="card" data-hit="{number}"><button type="button">',
        f'<span class="view">{_still(hit, document)}</span>',
        f'<span class="line"><span class="label">{rank}',
        f"{swatch}{_text(hit.label)}" if colour else times,
        f'</span><span class="cost">{hit.cost:.3f}</span></span>',
        f'<span class="document" title="{name}"><bdi>{name}</bdi></span>',
        f'<span class="times">{times}</span>' if colour else "",
        "</button></li>",
    )
    return "".join(parts)


def _still(hit: PageHit, document: PageDocument) -> str:
    piece = next(
        each for each in document.pieces if each.start <= hit.start < each.start + len(each.words)
    )
    poses = piece.poses[hit.start - piece.start : hit.end - piece.start]
    return still_picture(poses, document.size, document.floor)
