"""Every way in which a query may be answered, whatever the size of the index."""

import pytest

from mocapidx.queries import adaptive, source, walk

NEVER, ALWAYS = 0, 10**9
WAYS = {
    "by lists": {"LIST_COST": NEVER, "KEPT_LIST_COST": NEVER, "LISTED_RUN_COST": NEVER},
    "by walking": {"LIST_COST": ALWAYS, "COMMON": NEVER, "TURN_COST": 0, "MOVE_COST": 0},
    "by walking a little": {"LIST_COST": ALWAYS, "COMMON": NEVER},
    "by passing over": {"LIST_COST": ALWAYS, "COMMON": ALWAYS},
}


@pytest.fixture(params=WAYS.values(), ids=WAYS.keys(), scope="module")
def way(request):
    """Make the index prefer one way."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in request.param.items():
            module = next(m for m in (source, adaptive, walk) if hasattr(m, name))
            patch.setattr(module, name, value)
        yield
