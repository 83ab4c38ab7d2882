"""How many filters run after an alarm, as `check` and `generate` count them."""

from faultbond.app.model_check import understood
from faultbond.synthesis.extent import count_lanes
from made import EXAMPLES, spec_of


def test_check_counts_the_filters_that_generate_counts() -> None:
    """Those of sets that come later, of slots and of couples are among them."""
    record = understood(EXAMPLES / "rc" / "model.yaml").record
    assert record["filters"] == count_lanes(spec_of("rc")) > 0
