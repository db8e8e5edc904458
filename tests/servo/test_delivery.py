"""How set-points arrive."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from busplan.errors import BusplanError
from busplan.servo.delivery import arrival_offsets_us, arrivals, lost_cycles, received_mm
from busplan.servo.parameters import Delivery


def test_a_seed_has_63_bits() -> None:
    assert Delivery(seed=2**63 - 1).seed == 2**63 - 1
    with pytest.raises(BusplanError, match="seed = 9223372036854775808: "):
        Delivery(seed=2**63)


def test_the_seed_decides_and_nothing_else() -> None:
    delivery = Delivery(jitter_us=5.0, loss_probability=0.3, seed=7)
    first, again = (arrivals(delivery, name="x", cycles=500, period_us=1000.0) for _ in range(2))
    np.testing.assert_array_equal(first.offsets_us, again.offsets_us)
    np.testing.assert_array_equal(first.lost, again.lost)
    reseeded = arrivals(Delivery(jitter_us=5.0, loss_probability=0.3, seed=8), name="x", cycles=500, period_us=1000.0)
    assert (first.offsets_us != reseeded.offsets_us).any()
    assert (first.lost != reseeded.lost).any()


def test_the_jitter_is_common_to_both_axes_uniform_and_bounded() -> None:
    delivery = Delivery(jitter_us=5.0, skew_us=2.0, seed=1)
    x, y = (arrival_offsets_us(delivery, name=n, cycles=10_000, period_us=1000.0) for n in ("x", "y"))
    np.testing.assert_allclose((y - x)[1:-1], 2.0)
    assert np.abs(x).max() <= 5.0
    assert x.std() == pytest.approx(5 / np.sqrt(3), rel=0.02)
    assert abs(x.mean()) < 0.1


def test_losses_hit_each_node_on_its_own_at_the_given_rate() -> None:
    x, y = (lost_cycles(Delivery(loss_probability=0.1, seed=3), name=n, cycles=100_000) for n in ("x", "y"))
    assert x.mean() == pytest.approx(0.1, abs=0.005)
    assert (x & y).mean() == pytest.approx(0.01, abs=0.002)
    assert not x[0]


def test_taking_the_losses_away_leaves_the_jitter() -> None:
    with_losses, without = (
        arrivals(Delivery(jitter_us=5.0, loss_probability=p, seed=2), name="x", cycles=50, period_us=1000.0)
        for p in (0.5, 0.0)
    )
    assert with_losses.lost.any()
    assert not without.lost.any()
    np.testing.assert_array_equal(with_losses.offsets_us, without.offsets_us)


@given(lost=st.lists(st.booleans(), min_size=1, max_size=30))
def test_on_a_straight_line_extrapolation_makes_up_for_every_loss(lost: list[bool]) -> None:
    flags = np.array([False, False, *lost])
    sent = 0.25 * np.arange(len(flags), dtype=np.float64)
    np.testing.assert_allclose(received_mm(sent, lost=flags, on_loss="extrapolate"), sent, atol=1e-12)
    held = received_mm(sent, lost=flags, on_loss="hold")
    last = np.maximum.accumulate(np.where(flags, 0, np.arange(len(flags))))
    np.testing.assert_array_equal(held, sent[last])


def test_offsets_that_would_swap_packets_are_refused() -> None:
    with pytest.raises(BusplanError, match="500 us"):
        arrivals(Delivery(jitter_us=300.0, skew_us=-201.0), name="y", cycles=5, period_us=1000.0)


@pytest.mark.parametrize(
    ("bad", "name"),
    [
        ({"jitter_us": -1.0}, "jitter_us"),
        ({"skew_us": float("nan")}, "skew_us"),
        ({"loss_probability": 1.5}, "loss_probability"),
        ({"loss_probability": float("nan")}, "loss_probability"),
        ({"on_loss": "panic"}, "on_loss"),
        ({"seed": -1}, "seed"),
    ],
)
def test_bad_values_are_named(bad: dict[str, float], name: str) -> None:
    with pytest.raises(BusplanError, match=f"^{name} = "):
        Delivery(**bad)  # type: ignore[arg-type]
