"""Exact hits: the same sequence of segments with respect to the selected features."""

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray
from mocapidx.queries.adaptive import adaptive_hits
from mocapidx.queries.fuzzy import fuzzy_hits
from mocapidx.queries.source import Source
from mocapidx.queries.steps import FuzzyQuery

__all__ = ["exact_hits"]


def exact_hits(query: FuzzyQuery, source: Source) -> IndexArray:
    """Find the exact hits of a sequence of feature vectors.

    The feature function is the selection: documents are cut where one of the selected features
    changes. If the selection is all of one sub-index, these are its segments and the hits are
    found by shifted intersection of inverted lists; else as adaptive hits, of which the paper
    shows that they are the same.

    Parameters
    ----------
    query : FuzzyQuery
        One cube a step, all with the same mask; neighbours differ.
    source : Source
        Where to look.

    Returns
    -------
    ndarray of int64, shape (H, L + 1)
        Where each step of each hit starts, and where the last one ends, in positions;
        ascending by start.

    Raises
    ------
    ParameterError
        If the query has alternatives, or steps over different features.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 5.1, equations 4 to 7, and the last
       but one paragraph of section 5.2.
    """
    masks = {mask for step in query.steps for mask, _ in step.cubes}
    if len(masks) > 1 or max(len(step.cubes) for step in query.steps) > 1:
        raise ParameterError(
            "an exact query has one feature vector a step, over the same features throughout; "
            "use the mode fuzzy or adaptive for alternatives"
        )
    if [part.mask for part in source.touched(query.mask)] == [query.mask]:
        return fuzzy_hits(query, source)
    return adaptive_hits(query, source)
