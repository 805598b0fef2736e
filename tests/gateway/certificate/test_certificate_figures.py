"""Numbers as a certificate gives them."""

import pytest

from gateway.certificate.figures import significant, with_u


@pytest.mark.parametrize(
    ("value", "u_value", "written"),
    [
        (1.476512, 0.00017, "1.47651 ± 0.00034"),
        (-12.3456, 0.55, "-12.3 ± 1.1"),
        (8087.24, 73.0, "8090 ± 150"),
        (-0.001, 0.8, "0.0 ± 1.6"),
        (261152.0, 5.0, "261152 ± 10"),
        (5.0, 0.0, "5"),
        (1.0, float("nan"), "1"),
        (float("nan"), 1.0, "—"),
        (3.2e12, 1.0e10, "3.2e+12 ± 2e+10"),
        (1e-12, 1e-14, "1e-12 ± 2e-14"),
    ],
)
def test_a_value_bears_two_digits_of_its_expanded_uncertainty(value: float, u_value: float, written: str) -> None:
    assert with_u(value, u_value) == written


def test_what_is_not_known_is_a_dash() -> None:
    assert [significant(value) for value in (None, float("inf"), 0.0, 0.012345)] == ["—", "—", "0", "0.0123"]
